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

using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pointwise;

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
  const auto windows = ReplayWindows(*simulator, inputs.logs, AsLogged(begins), 50, truth);
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

/// The pendulum with a servo of this stiffness [N m/rad] and of at most this torque [N m].
std::string ServoXml(double stiffness, double torque) {
  std::string xml = kPendulumXml;
  const std::string motor = "<motor name=\"motor\" joint=\"hinge\" ctrlrange=\"-2 2\" ctrllimited=\"true\"/>";
  return xml.replace(xml.find(motor), motor.size(),
                     fmt::format("<position name=\"servo\" joint=\"hinge\" ctrlrange=\"-2 2\" ctrllimited=\"true\" "
                                 "kp=\"{}\" forcerange=\"{} {}\" forcelimited=\"true\"/>",
                                 stiffness, -torque, torque));
}

std::unique_ptr<SimulatorFactory> ServoFactory(const TestFolder& folder, const std::string& rest) {
  const std::string task = "[task]\nmodel = \"servo.xml\"\ncontrol_period = 0.02\n" + rest;
  const RunConfig config = RunConfig::FromToml(task, folder / "task.toml");
  return MakeSimulatorFactory(config.task, config.parameters);
}

/// Angles of 60 steps towards 1 rad, of a lane with this z in a recording with these constants.
std::vector<double> StepResponse(const SimulatorFactory& factory, const std::vector<double>& z,
                                 const std::vector<double>& constants) {
  const auto simulator = factory.Make(1, 1);
  simulator->SetParameters(0, z);
  EXPECT_TRUE(
      simulator->SetState(0, std::vector<double>{0, 0}, {.observations = {}, .actions = {}, .constants = constants}));
  std::vector<double> angles;
  for (int i = 0; i < 60; ++i) {
    const int lane = 0;
    simulator->Step({&lane, 1}, std::vector<double>{1});
    angles.push_back(simulator->observation(0)[0]);
  }
  return angles;
}

constexpr const char* kGain = "[task.constants]\ngain = { field = \"actuator/servo/kp\" }\n[parameters]\n";
constexpr const char* kIdle = "idle = { field = \"opt/wind[0]\", range = [0, 1], scale = \"absolute\" }\n";

// The firmware's gain is known of each recording, what a unit of it is worth is not.
TEST(Recordings, AKnownGainMultipliesTheStiffnessThatIsSearched) {
  const TestFolder folder;
  const auto truth = [&](double stiffness, double torque) {
    WriteFileAtomically(folder / "servo.xml", ServoXml(stiffness, torque));
    return StepResponse(*ServoFactory(folder, std::string("[parameters]\n") + kIdle), {0}, {});
  };
  const auto soft = truth(4 * 0.5 * 0.25, 1.5 * 0.5), hard = truth(4 * 0.5 * 2, 1.5 * 0.5), alone = truth(4 * 0.5, 1.5);
  WriteFileAtomically(folder / "servo.xml", ServoXml(4, 1.5));
  const auto tied = ServoFactory(
      folder, std::string(kGain) + kIdle +
                  "torque = { field = [\"actuator/servo/kp\", \"actuator/servo/forcerange\"], range = [0.4, 1.2] }\n");
  ASSERT_EQ(tied->parameters().size(), 2);
  EXPECT_EQ(tied->parameters()[1].field, "actuator/servo/kp + actuator/servo/forcerange");
  EXPECT_THAT(StepResponse(*tied, {0, 0.5}, {0.25}), Pointwise(DoubleNear(1e-12), soft));
  EXPECT_THAT(StepResponse(*tied, {0, 0.5}, {2}), Pointwise(DoubleNear(1e-12), hard));
  // A parameter that has no other path is driven through the constant alone.
  const auto one = ServoFactory(
      folder, std::string(kGain) + "stiffness = { field = \"actuator/servo/kp\", range = [0.4, 1.2] }\n" + kIdle);
  ASSERT_EQ(one->parameters().size(), 2);
  EXPECT_THAT(StepResponse(*one, {0.5, 0}, {}), Pointwise(DoubleNear(1e-12), alone)) << "as in the model";
}

TEST(Recordings, AConstantInUnitsOfItsOwnAndAParameterOnTheSameNumberAreRefused) {
  const TestFolder folder;
  WriteFileAtomically(folder / "servo.xml", ServoXml(4, 1.5));
  const std::string gain = "[task.constants]\ngain = { field = \"actuator/servo/kp\", scale = \"absolute\" }\n";
  EXPECT_THAT(MessageOf<UsageError>([&] {
                ServoFactory(folder,
                             gain + "[parameters]\nkp = { field = \"actuator/servo/kp\", range = [0.4, 1.2] }\n");
              }),
              HasSubstr("both set actuator/servo/gainprm[0]"));
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

TEST(Recordings, AFileThatIsNamedTwiceCountsOnce) {
  const Pendulum pendulum;
  const Inputs once(pendulum.Config(kUnknown));
  const Inputs twice(pendulum.Config("recordings = [\"light.csv\", { path = \"heavy.csv\" }, \"light.csv\"]"));
  EXPECT_EQ(twice.logs.observations, once.logs.observations);
  EXPECT_EQ(twice.logs.Episodes().size(), 2u);
  ASSERT_EQ(twice.logs.warnings.size(), once.logs.warnings.size() + 1);
  EXPECT_THAT(twice.logs.warnings.back(), HasSubstr("repeat rows of an earlier recording"));
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
