// A residual torque takes what no parameter explains: predictions get better, and a parameter that would stand in for
// it keeps its value.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/presets.h"
#include "oted/stages/design/prior_source.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::joint_residual_design_test {

/// A pendulum with a spring as a cable makes it, which the model lacks: it pulls to one side.
constexpr const char* kXml = R"(<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body><joint name="hinge" axis="0 1 0" damping="0.02"SPRING/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="0.5"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-3 3" forcerange="-3 3"/></actuator>
</mujoco>)";
constexpr double kMass = 1.2;  // of the target, times nominal

const ParameterSpec kSearched = {.name = "mass", .field = "body/#1/mass + body/#1/inertia", .low = 0.5, .high = 2};

class Pendulum {
 public:
  std::unique_ptr<MujocoSimulatorFactory> Factory(const std::vector<ParameterSpec>& specs,
                                                  const std::string& spring = "") const {
    std::string xml = kXml;
    xml.replace(xml.find("SPRING"), 6, spring);
    return std::make_unique<MujocoSimulatorFactory>(HingeTask(folder_, xml), specs);
  }

  Dataset Logs() const {
    const auto target = Factory({kSearched}, R"( stiffness="0.4" springref="60")");
    return WithSensorNoise(LogsUnderTorques(*target, {kMass}, 0.9), 0.001, RngKey(3));
  }

 private:
  TestFolder folder_;
};

ReplayFit Match(const SimulatorFactory& factory, const Dataset& logs, const std::string& prior_source) {
  NullSink log;
  const Prior prior = MakePrior(prior_source, factory.parameters());
  const RunContext context{.log = &log, .n_threads = 1};
  return MatchTrajectories({factory, logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
                           {.rows = 400, .starts = 2, .coarse = 16});
}

TEST(DesignOfAResidual, LeavesTheMassWhatItIsWhereASpringIsMissing) {
  const Pendulum pendulum;
  const Dataset logs = pendulum.Logs();
  const auto alone = pendulum.Factory({kSearched});
  const ReplayFit without = Match(*alone, logs, "uniform");
  const auto with_residual = pendulum.Factory(ExpandPresets({"residual"}, {kSearched}, *alone).parameters);
  ASSERT_EQ(with_residual->parameters().size(), 8);
  const ReplayFit with = Match(*with_residual, logs, "gaussian");
  const auto mass = [](const SimulatorFactory& factory, const ReplayFit& fit) {
    const ParameterSpace& space = factory.parameters();
    const std::vector<double> z = LogitToZ(space, {fit.mean.data(), static_cast<size_t>(fit.mean.size())});
    for (int i = 0; i < space.size(); ++i) {
      if (space[i].name == "mass") return z[static_cast<size_t>(i)];
    }
    return 0.0;
  };
  const double error = std::abs(mass(*with_residual, with) - kMass),
               error_without = std::abs(mass(*alone, without) - kMass);
  EXPECT_LT(error, 0.05);
  EXPECT_GT(error_without, 2 * error);
  EXPECT_LT(with.evidence->noise_std[0], 2e-3) << "the sensors have 1e-3";
}

}  // namespace oted::joint_residual_design_test
