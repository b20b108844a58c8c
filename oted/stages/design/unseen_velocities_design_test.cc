// A legged robot of which the logs show positions alone, without noise: what finding the velocities costs is no error
// of the simulator.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/matching/verdict.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/replay/prediction_evidence.h"
#include "oted/stages/design/testing.h"

namespace oted::unseen_velocities_design_test {

using Eigen::VectorXd;

// A body on a spring leg that slides up and down a guide, lands and jumps off again, and an arm on it.
constexpr const char* kXml = R"(<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody><geom name="floor" type="plane" size="9 9 1" friction="1"/>
    <body pos="0 0 0.6">
      <joint name="x" type="slide" axis="1 0 0" damping="0.1"/>
      <joint name="height" type="slide" axis="0 0 1"/><joint name="pitch" axis="0 1 0" stiffness="20" damping="0.5"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.05" mass="2"/>
      <body><joint name="leg" type="slide" axis="0 0 -1" range="-0.1 0.1" limited="true" stiffness="300" damping="3"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.04" mass="1"/></body></body></worldbody>
  <actuator><motor name="jump" joint="leg" gear="60" ctrlrange="-1 1" ctrllimited="true"/>
    <motor name="tilt" joint="pitch" gear="8" ctrlrange="-1 1" ctrllimited="true"/></actuator>
</mujoco>)";
const std::vector<ParameterSpec> kSearched = {
    {.name = "friction", .field = "geom/*/friction[0]", .low = 0.2, .high = 2},
    {.name = "gain", .field = "actuator/*/gainprm[0]", .low = 0.2, .high = 2},
    {.name = "gravity", .field = "opt/gravity[2]", .low = 0.2, .high = 2}};
const std::vector<double> kTruth = {0.6, 1.3, 1.2};

class Jumper {
 public:
  Jumper() : factory_(Task(), kSearched) {}

  Dataset Logs() const {
    const auto simulator = factory_.Make(1, 1);
    simulator->SetParameters(0, kTruth);
    Dataset logs;
    Rng rng(3);
    for (int episode = 0; episode < 5; ++episode) {
      simulator->Reset(0, rng);
      const double rate = rng.Uniform(0.1, 0.3), phase = rng.Uniform(0, 6);
      const auto action = [&](int i) {
        return std::vector<double>{std::sin(rate * i + phase), 0.5 * std::sin(0.37 * rate * i)};
      };
      AppendEpisode(*simulator, 120, action, logs);
    }
    return logs;
  }

  HeldOutPrediction Predict(const Dataset& logs, const std::vector<double>& z, double noise) const {
    const ReadingModel readings = ReadingModel::Of(factory_.spec(), logs);
    const VectorXd guess = VectorXd::Constant(logs.obs_dim(), noise);
    return PredictLogs({.factory = factory_,
                        .kept_aside = logs,
                        .learned = nullptr,
                        .z = z,
                        .noise = guess,
                        .readings = readings,
                        .narrow = {},
                        .key = RngKey(1),
                        .n_threads = 1})
        .value();
  }

 private:
  ModelTask Task() const {
    ModelTask task = HingeTask(folder_, kXml);
    task.observations = {"joint/height/qpos", "joint/pitch/qpos", "joint/leg/qpos"};
    task.unobserved = {"joint/x/qpos"};
    return task;
  }

  TestFolder folder_;
  MujocoSimulatorFactory factory_;
};

/// Some starts are not found, in logs that the truth made itself as well: so few windows need not tell its floor.
TEST(UnseenVelocities, OfExactLogsTheTruthLeavesNoMoreThanItsFloorAndAnotherSimulatorDoes) {
  const Jumper jumper;
  const Dataset logs = jumper.Logs();
  for (const double noise : {1e-9, 1e-6}) {
    const HeldOutPrediction at_truth = jumper.Predict(logs, kTruth, noise);
    EXPECT_TRUE(ChannelsOff(at_truth).empty()) << noise;
    EXPECT_TRUE(PredictsBetter(at_truth)) << noise;
    EXPECT_FALSE(ReachesFloor(jumper.Predict(logs, {0.6, 1.2, 1.2}, noise))) << noise;
  }
}

}  // namespace oted::unseen_velocities_design_test
