// Recordings with constants of their own: from files to what a design makes of them.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/matching/designer.h"
#include "oted/matching/prior.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/replay.h"
#include "oted/stages/design/replay/prediction_evidence.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::recordings_test {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kPendulumXml = R"(<mujoco>
  <option timestep="0.005"/>
  <worldbody><body name="arm"><joint name="hinge" axis="0 1 0" damping="0.05"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.3"/>
    <body name="payload" pos="0 0 -0.5"><geom type="sphere" size="0.05" mass="0.2"/></body>
  </body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-2 2" ctrllimited="true"/></actuator>
</mujoco>)";
constexpr const char* kTask = R"([task]
model = "pendulum.xml"
control_period = 0.02
[task.constants]
payload = { field = "body/payload/mass", scale = "absolute" }
[parameters]
damping = { field = "joint/hinge/damping", range = [0.0, 0.5], scale = "absolute" }
)";
constexpr double kTrueDamping = 0.12;

/// A pendulum that carried 0.1 kg in one file and 0.6 kg in another.
class Pendulum {
 public:
  Pendulum() {
    WriteFileAtomically(folder_ / "pendulum.xml", kPendulumXml);
    Record("light.csv", 0.1);
    Record("heavy.csv", 0.6);
  }

  /// The task with this [data].
  RunConfig Config(const std::string& data) const {
    return RunConfig::FromToml(fmt::format("{}[data]\n{}\n", kTask, data), folder_ / "task.toml");
  }
  const TestFolder& folder() const { return folder_; }

 private:
  void Record(const char* file, double payload) {
    const RunConfig config = RunConfig::FromToml(kTask, folder_ / "task.toml");
    const auto factory = MakeSimulatorFactory(config.task, config.parameters);
    const auto simulator = factory->Make(1, 1);
    simulator->SetParameters(0, std::vector<double>{kTrueDamping});
    std::vector<double> state = {0.3, 0};
    EXPECT_TRUE(simulator->SetState(0, state, {.observations = {}, .actions = {}, .constants = {&payload, 1}}));
    Dataset logs;
    for (int i = 0; i < 300; ++i) {
      const std::vector<double> torque = {1.2 * std::sin(0.11 * i) + 0.6 * std::sin(0.031 * i + payload)};
      logs.observations.AppendRow(state);
      logs.actions.AppendRow(torque);
      const int lane = 0;
      simulator->Step({&lane, 1}, torque);
      state.assign(simulator->observation(0).begin(), simulator->observation(0).end());
      logs.next_observations.AppendRow(state);
      logs.terminals.push_back(0);
      logs.timeouts.push_back(i == 299);
    }
    logs.observation_names = factory->spec().observation_names;
    logs.action_names = factory->spec().action_names;
    logs.period_s = 0.02;
    WriteDataset(logs, folder_ / file);
  }

  TestFolder folder_;
};

constexpr const char* kKnown = R"(recordings = [
  { path = "light.csv", constants = { payload = 0.1 } },
  { path = "heavy.csv", constants = { payload = 0.6 } }])";
constexpr const char* kUnknown = "recordings = [{ path = \"light.csv\" }, { path = \"heavy.csv\" }]";

/// The simulator and the logs of a configuration.
struct Inputs {
  explicit Inputs(const RunConfig& config)
      : logs(ReadEpisodes(config.data, SpecOf(config.task))),
        factory(MakeSimulatorFactory(config.task, config.parameters, logs.EpisodeStarts())) {}
  Dataset logs;
  std::unique_ptr<SimulatorFactory> factory;
};

double FittedDamping(const Inputs& inputs) {
  NullSink log;
  const Prior prior = Prior::Uniform(1);
  const ReplayFit fit = MatchTrajectories({*inputs.factory,
                                           inputs.logs,
                                           prior,
                                           RngKey(1),
                                           [](int, int, const Eigen::VectorXd&) {},
                                           {.log = &log, .n_threads = 1}},
                                          {.rows = 300, .starts = 1, .coarse = 4});
  return LogitToZ(inputs.factory->parameters(), {fit.mean.data(), 1})[0];
}

TEST(Recordings, OfDifferentPayloadsGiveTheTrueFrictionWhereThePayloadsAreKnown) {
  const Pendulum pendulum;
  EXPECT_NEAR(FittedDamping(Inputs(pendulum.Config(kKnown))), kTrueDamping, 1e-4);
  EXPECT_GT(std::abs(FittedDamping(Inputs(pendulum.Config(kUnknown))) - kTrueDamping), 0.01);
}

TEST(Recordings, AreReplayedAndPredictedWithTheirConstants) {
  const Pendulum pendulum;
  const Inputs inputs(pendulum.Config(kKnown));
  const std::vector<double> truth = {kTrueDamping};
  const std::vector<int> begins = {10, 410};
  const auto simulator = inputs.factory->Make(2, 1);
  const auto windows = ReplayWindows(*simulator, inputs.logs, begins, 50, truth);
  for (size_t w = 0; w < 2; ++w) {
    const auto errors = ReplayError(LoggedWindow(inputs.logs, begins[w], 50), windows[w], ChannelSpreads(inputs.logs));
    EXPECT_LT(errors.back(), 1e-6) << "window " << w;
  }
  const Eigen::VectorXd noise = Eigen::VectorXd::Constant(2, 1e-3);
  const auto prediction = PredictLogs({*inputs.factory,
                                       inputs.logs,
                                       nullptr,
                                       truth,
                                       noise,
                                       ReadingModel::Of(inputs.factory->spec(), inputs.logs),
                                       {},
                                       RngKey(1),
                                       1});
  ASSERT_TRUE(prediction.has_value());
  EXPECT_LT(prediction->horizons.back().channels[0].designed, 1e-4) << "[rad] after a second";
}

TEST(Recordings, ACsvMayHaveTheConstantsAsColumns) {
  const Pendulum pendulum;
  const Inputs inputs(pendulum.Config(kKnown));
  WriteDataset(inputs.logs, pendulum.folder() / "both.csv");
  const Dataset again = Inputs(pendulum.Config("path = \"both.csv\"")).logs;
  EXPECT_THAT(again.constant_names, ElementsAre("payload"));
  ASSERT_EQ(again.size(), 600);
  EXPECT_EQ(again.constants(0, 0), 0.1);
  EXPECT_EQ(again.constants(599, 0), 0.6);
  const Dataset heavy = again.Select({again.Episodes()[1]});
  EXPECT_EQ(heavy.constants(0, 0), 0.6);
}

TEST(Recordings, ResultsDependOnTheirConstants) {
  const Pendulum pendulum;
  const std::string known = Inputs(pendulum.Config(kKnown)).logs.sha256;
  EXPECT_NE(known, Inputs(pendulum.Config(kUnknown)).logs.sha256);
  EXPECT_EQ(known, Inputs(pendulum.Config(kKnown)).logs.sha256);
}

TEST(Recordings, AConfigurationReadsBackWhatItWrites) {
  const Pendulum pendulum;
  const RunConfig config = pendulum.Config(kKnown);
  const RunConfig again = RunConfig::FromToml(config.ToToml(), pendulum.folder() / "again.toml");
  EXPECT_EQ(again.ToToml(), config.ToToml());
  ASSERT_EQ(again.data.recordings.size(), 2u);
  EXPECT_EQ(again.data.recordings[1].constants.at("payload"), 0.6);
  EXPECT_EQ(again.task.Identity(), config.task.Identity());
  EXPECT_THAT(again.task.ConstantNames(), ElementsAre("payload"));
}

TEST(Recordings, MistakesAreErrorsWithARemedy) {
  const Pendulum pendulum;
  const auto refused = [&](const std::string& data) {
    return MessageOf<UsageError>([&] { ReadEpisodes(pendulum.Config(data).data, SpecOf(pendulum.Config(data).task)); });
  };
  EXPECT_THAT(refused("recordings = [{ path = \"light.csv\", constants = { paylod = 1 } }]"),
              HasSubstr("did you mean 'payload'?"));
  EXPECT_THAT(refused("recordings = [{ file = \"light.csv\" }]"), HasSubstr("has no path"));
  EXPECT_THAT(refused("recordings = [{ path = \"light.csv\", payload = 1 }]"), HasSubstr("data.recordings.payload"));
  EXPECT_THAT(refused("recordings = [{ path = \"light.csv\", constants = { payload = \"much\" } }]"),
              HasSubstr("data.recordings.constants.payload"));
  RunConfig both = pendulum.Config(std::string("path = \"light.csv\"\n") + kKnown);
  EXPECT_THAT(MessageOf<UsageError>([&] { both.Check(); }), HasSubstr("keep one of them"));
  both.data.Take("heavy.csv");
  EXPECT_NO_THROW(both.Check());
}

TEST(Recordings, AConstantThatChangesWithinAnEpisodeIsAnError) {
  const Pendulum pendulum;
  WriteFileAtomically(pendulum.folder() / "odd.csv",
                      "episode,obs.q,obs.v,act.u,payload\n0,0,0,0,0.1\n0,0,0,0,0.1\n0,0,0,0,0.2\n0,0,0,,\n");
  EXPECT_THAT(MessageOf<DataError>([&] { Inputs inputs(pendulum.Config("path = \"odd.csv\"")); }),
              HasSubstr("line 4: constant 'payload' changes from 0.1 to 0.2 within an episode"));
}

}  // namespace oted::recordings_test
