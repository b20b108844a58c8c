// A residual torque takes what no parameter explains: predictions get better, and a parameter that would stand in for
// it keeps its value.

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/presets.h"
#include "oted/stages/design/prior_source.h"
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
    WriteFileAtomically(folder_ / "hinge.xml", xml);
    ModelTask task;
    task.name = "Hinge";
    task.model = folder_ / "hinge.xml";
    task.control_period = 0.01;
    task.observations = {"joint/*/qpos", "joint/*/qvel"};
    task.max_episode_steps = 1000;
    return std::make_unique<MujocoSimulatorFactory>(task, specs);
  }

  Dataset Logs() const {
    const auto simulator = Factory({kSearched}, R"( stiffness="0.4" springref="60")")->Make(1, 1);
    simulator->SetParameters(0, std::vector<double>{kMass});
    Dataset logs;
    for (const double rate : {0.021, 0.034}) {
      Rng rng(1);
      simulator->Reset(0, rng);
      for (int i = 0; i < 400; ++i) {
        const std::vector<double> torque = {0.9 * std::sin(rate * i) + 0.5 * std::sin(5.3 * rate * i)};
        logs.observations.AppendRow(simulator->observation(0));
        logs.actions.AppendRow(torque);
        const int lane = 0;
        simulator->Step({&lane, 1}, torque);
        logs.next_observations.AppendRow(simulator->observation(0));
        logs.terminals.push_back(0);
        logs.timeouts.push_back(i == 399);
      }
    }
    return WithSensorNoise(logs, 0.001, RngKey(3));
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
