// Friction that falls with speed and grows with load is found from logs; without it, what is searched stands in for it.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/freed.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::joint_friction_design_test {

constexpr const char* kXml = R"(<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body><joint name="hinge" axis="0 1 0" damping="0.02" frictionloss="0.05"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="0.5"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-3 3" ctrllimited="true"/></actuator>
</mujoco>)";
const std::vector<double> kTruth = {0.08, 0.4, 0.12};

ParameterSpec Absolute(const std::string& name, double high) {
  return {.name = name, .field = "joint/hinge/" + name, .low = 0, .high = high, .scale = ParameterScale::kAbsolute};
}
const std::vector<ParameterSpec> kFriction = {Absolute("stribeck_torque", 0.3), Absolute("stribeck_velocity", 2),
                                              Absolute("load_friction", 0.4)};

class Hinge {
 public:
  std::unique_ptr<MujocoSimulatorFactory> Factory(const std::vector<ParameterSpec>& specs) const {
    return std::make_unique<MujocoSimulatorFactory>(HingeTask(folder_, kXml), specs);
  }
  Dataset Logs() const { return LogsUnderTorques(*Factory(kFriction), kTruth, 1.1); }

 private:
  TestFolder folder_;
};

std::vector<double> Match(const SimulatorFactory& factory, const Dataset& logs) {
  NullSink log;
  const Prior prior = Prior::Uniform(factory.parameters().size());
  const RunContext context{.log = &log, .n_threads = 1};
  const ReplayFit fit =
      MatchTrajectories({factory, logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
                        {.rows = 400, .starts = 2, .coarse = 16});
  return LogitToZ(factory.parameters(), {fit.mean.data(), static_cast<size_t>(fit.mean.size())});
}

TEST(DesignOfJointFriction, RecoversAllOfItsNumbers) {
  const Hinge hinge;
  const std::vector<double> z = Match(*hinge.Factory(kFriction), hinge.Logs());
  for (size_t k = 0; k < z.size(); ++k) EXPECT_NEAR(z[k] / kTruth[k], 1, 0.02) << kFriction[k].name;
}

TEST(DesignOfJointFriction, WithoutItDryFrictionIsWrong) {
  const Hinge hinge;
  const std::vector<double> z = Match(*hinge.Factory({Absolute("frictionloss", 0.4)}), hinge.Logs());
  EXPECT_GT(z[0], 0.07) << "the target's is 0.05";
}

/// The model searches its damping alone; the target holds more at rest than it knows of.
TEST(DesignOfJointFriction, FrictionAtRestIsTheFirstSuspect) {
  constexpr double kAtRest = 0.15;
  const Hinge hinge;
  const Dataset logs = WithSensorNoise(
      LogsUnderTorques(*hinge.Factory({Absolute("stribeck_torque", 0.3)}), {kAtRest}, 1.1), 2e-3, RngKey(2));
  const auto factory = hinge.Factory({{.name = "damping", .field = "joint/hinge/damping", .low = 0.2, .high = 5}});
  NullSink log;
  const Prior prior = Prior::Uniform(1);
  const RunContext context{.log = &log, .n_threads = 1};
  const ReplayFit fit =
      MatchTrajectories({*factory, logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
                        {.rows = 400, .starts = 2, .coarse = 16});
  TrialKeeper keeper;
  const std::vector<Suspect> suspects = TrySuspects({.factory = *factory,
                                                     .dataset = logs,
                                                     .prior = prior,
                                                     .fit = *fit.evidence,
                                                     .z = ToZ(factory->parameters(), fit.mean),
                                                     .kept_aside = RngKey(1),
                                                     .context = context,
                                                     .keeper = keeper},
                                                    3);
  ASSERT_FALSE(suspects.empty());
  EXPECT_EQ(suspects[0].spec.name, "stribeck_torque");
  ASSERT_TRUE(suspects[0].trial.has_value());
  EXPECT_TRUE(suspects[0].trial->kept);
  EXPECT_NEAR(suspects[0].trial->value / kAtRest, 1, 0.1);
}

}  // namespace oted::joint_friction_design_test
