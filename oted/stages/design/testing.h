#pragma once
/// Plants that only tests of the design know.

#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/matching/held_out.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/testing.h"

namespace oted {

/// All of the logs learn. @param recording  HeldOutParts::recording; empty: every episode is a recording
inline HeldOutParts AllLearn(Dataset logs, std::vector<int> recording = {}) {
  HeldOutParts parts{.learn = std::move(logs), .judge = {}};
  for (int e = 0; e < static_cast<int>(parts.learn.Episodes().size()); ++e) {
    if (recording.empty() || e == 0 || recording[static_cast<size_t>(e)] != recording[static_cast<size_t>(e) - 1]) {
      parts.logged_as.push_back(e);
    }
    parts.recording.push_back(recording.empty() ? e : recording[static_cast<size_t>(e)]);
  }
  return parts;
}

/// The point mass between walls at -0.5 and 0.5: beyond one it comes back at half its speed. A replay whose start is
/// off by a little meets the wall a step earlier or later, and is off by much.
class BetweenWalls : public PointMass {
 public:
  BetweenWalls(int n_lanes, int n_threads) : PointMass({}, n_lanes, n_threads), clock_(static_cast<size_t>(n_lanes)) {}
  void Reset(int lane, Rng& rng) override {
    PointMass::Reset(lane, rng);
    clock_[static_cast<size_t>(lane)] = 0;
  }
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    PointMass::Step(lanes, actions);
    for (const int lane : lanes) {
      const double x = observation(lane)[0], v = observation(lane)[1];
      if (std::abs(x) > 0.5 && x * v > 0) SetStateFromObservation(lane, std::vector<double>{x, -0.5 * v});
      ++clock_[static_cast<size_t>(lane)];
    }
  }
  LaneStatus status(int lane) const override {
    return clock_[static_cast<size_t>(lane)] >= 20 ? LaneStatus::kTruncated : LaneStatus::kRunning;
  }

 private:
  std::vector<int> clock_;
};

class BetweenWallsFactory : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<BetweenWalls>(n_lanes, n_threads);
  }
};

/// The point mass of which nobody sees the velocity.
class PositionAlone : public PointMass {
 public:
  static SimulatorSpec SpecOfPosition() {
    SimulatorSpec spec = MakeSpec({});
    spec.observation_shape = {1};
    spec.observation_names = {"x"};
    spec.can_set_state = false;
    spec.hidden = {{.name = "v", .rate_of = 0}};
    return spec;
  }
  PositionAlone(int n_lanes, int n_threads) : PointMass({}, n_lanes, n_threads) {}
  const SimulatorSpec& spec() const override { return spec_; }
  bool SetStateFromObservation(int, std::span<const double>) override { throw UsageError("x alone is no state"); }
  bool SetState(int lane, std::span<const double> state, const LoggedHistory&) override {
    return PointMass::SetStateFromObservation(lane, state);
  }
  std::span<const double> observation(int lane) const override { return PointMass::observation(lane).first(1); }

 private:
  SimulatorSpec spec_ = SpecOfPosition();
};

class PositionAloneFactory : public PointMassFactory {
 public:
  const SimulatorSpec& spec() const override { return spec_; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<PositionAlone>(n_lanes, n_threads);
  }

 private:
  SimulatorSpec spec_ = PositionAlone::SpecOfPosition();
};

/// A joint that a model's file in `folder` describes, as a task.
inline ModelTask HingeTask(const TestFolder& folder, const std::string& xml) {
  WriteFileAtomically(folder / "hinge.xml", xml);
  ModelTask task;
  task.name = "Hinge";
  task.model = folder / "hinge.xml";
  task.control_period = 0.01;
  task.observations = {"joint/*/qpos", "joint/*/qvel"};
  task.max_episode_steps = 1000;
  return task;
}

/// A pendulum of 0.4 m beside a wall that it does not reach where the model has it.
inline constexpr const char* kBesideAWall = R"(<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body><joint name="hinge" axis="0 1 0" damping="0.05"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.38" size="0.02" mass="0.5"/></body>
    <body name="wall" pos="0.6 0 -0.2"><geom type="box" size="0.1 0.2 0.4"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-3 3"/></actuator>
</mujoco>)";

/// An episode of lane 0 from its present state on, appended to `logs`. @param action  of each step
template <class Action>
void AppendEpisode(Simulator& simulator, int n_steps, const Action& action, Dataset& logs) {
  for (int i = 0; i < n_steps; ++i) {
    const std::vector<double> acted = action(i);
    logs.observations.AppendRow(simulator.observation(0));
    logs.actions.AppendRow(acted);
    const int lane = 0;
    simulator.Step({&lane, 1}, acted);
    logs.next_observations.AppendRow(simulator.observation(0));
    logs.terminals.push_back(0);
    logs.timeouts.push_back(i == n_steps - 1);
  }
}

/// Two episodes of 400 control steps under slow and fast torques. @param slow  the slow torque's amplitude [N m]
inline Dataset LogsUnderTorques(const SimulatorFactory& factory, const std::vector<double>& z, double slow) {
  const auto simulator = factory.Make(1, 1);
  simulator->SetParameters(0, z);
  Dataset logs;
  for (const double rate : {0.021, 0.034}) {
    Rng rng(1);
    simulator->Reset(0, rng);
    const auto torque = [&](int i) {
      return std::vector<double>{slow * std::sin(rate * i) + 0.5 * std::sin(5.3 * rate * i)};
    };
    AppendEpisode(*simulator, 400, torque, logs);
  }
  return logs;
}

}  // namespace oted
