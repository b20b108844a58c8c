#pragma once
/// A simulator whose every number is known in closed form, for tests. Include from *_test.cc files only.

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/sim/simulator.h"

namespace oted {

struct PointMassOptions {
  double action_low = -1, action_high = 1;
  double terminate_beyond = std::numeric_limits<double>::infinity();  ///< |x| after a step: terminal
  double diverge_beyond = std::numeric_limits<double>::infinity();  ///< |x| after a step: diverged, numbers become NaN
  double velocity_clip = std::numeric_limits<double>::infinity();   ///< of the observed velocity
  int max_episode_steps = 20;
  bool can_set_state = true;
};

/// A point on a line:  v' = (1 - damping) v + gain a,   x' = x + 0.1 v',   reward -x'^2,   observation (x, v).
/// It starts at x ~ U(-1, 1), v = 0. With damping 1, the nominal value, the best action drives x straight to zero.
/// Parameters: gain in [0.2, 2], damping in [0.2, 1], and idle in [0, 1], which has no effect.
class PointMass : public Simulator {
 public:
  static SimulatorSpec MakeSpec(const PointMassOptions& options) {
    SimulatorSpec spec;
    spec.task = "PointMass";
    spec.observation_shape = {2};
    spec.observation_names = {"x", "v"};
    spec.act_dim = 1;
    spec.action_low = {options.action_low};
    spec.action_high = {options.action_high};
    spec.control_period_s = 0.1;
    spec.max_episode_steps = options.max_episode_steps;
    spec.can_set_state = options.can_set_state;
    return spec;
  }
  static ParameterSpace MakeParameters() {
    return ParameterSpace({{.name = "gain", .field = "env/gain", .low = 0.2, .high = 2.0},
                           {.name = "damping", .field = "env/damping", .low = 0.2, .high = 1.0},
                           {.name = "idle", .field = "env/idle", .low = 0.0, .high = 1.0}});
  }

  PointMass(const PointMassOptions& options, int n_lanes, int n_threads)
      : options_(options), spec_(MakeSpec(options)), n_threads_(n_threads), lanes_(static_cast<size_t>(n_lanes)) {}

  const SimulatorSpec& spec() const override { return spec_; }
  const ParameterSpace& parameters() const override { return parameters_; }
  int n_lanes() const override { return static_cast<int>(lanes_.size()); }

  void SetParameters(int lane, std::span<const double> z) override {
    parameters_.CheckInside(z);
    At(lane).gain = z[0];
    At(lane).damping = z[1];
  }
  void Reset(int lane, Rng& rng) override { Start(At(lane), rng.Uniform(-1, 1), 0); }
  bool SetStateFromObservation(int lane, std::span<const double> observation) override {
    if (!spec_.can_set_state) throw UsageError("task 'PointMass' has no settable state; start at its resets");
    if (std::abs(observation[1]) >= options_.velocity_clip) return false;
    Start(At(lane), observation[0], observation[1]);
    return true;
  }
  std::optional<bool> EndsAt(int lane, std::span<const double> observation) override {
    if (!SetStateFromObservation(lane, observation)) return std::nullopt;
    return std::abs(observation[0]) > options_.terminate_beyond;
  }
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    OTED_CHECK(actions.size() == lanes_.size());
    ParallelFor(static_cast<int>(lanes.size()), n_threads_, [&](int i) {
      const size_t lane = static_cast<size_t>(lanes[static_cast<size_t>(i)]);
      StepLane(lanes_[lane], actions[lane]);
    });
  }
  std::span<const double> observation(int lane) const override { return At(lane).observation; }
  double reward(int lane) const override { return At(lane).reward; }
  LaneStatus status(int lane) const override { return At(lane).status; }

 private:
  struct Lane {
    double gain = 1, damping = 1, x = 0, v = 0, reward = 0;
    int clock = 0;
    LaneStatus status = LaneStatus::kRunning;
    std::vector<double> observation = {0, 0};
  };
  Lane& At(int lane) { return lanes_.at(static_cast<size_t>(lane)); }
  const Lane& At(int lane) const { return lanes_.at(static_cast<size_t>(lane)); }

  void Show(Lane& lane) const {
    lane.observation = {lane.x, std::clamp(lane.v, -options_.velocity_clip, options_.velocity_clip)};
  }
  void Start(Lane& lane, double x, double v) const {
    lane.x = x;
    lane.v = v;
    lane.clock = 0;
    lane.reward = 0;
    lane.status = LaneStatus::kRunning;
    Show(lane);
  }
  void StepLane(Lane& lane, double action) const {
    lane.v = (1 - lane.damping) * lane.v + lane.gain * std::clamp(action, options_.action_low, options_.action_high);
    lane.x += 0.1 * lane.v;
    lane.reward = -lane.x * lane.x;
    ++lane.clock;
    Show(lane);
    if (std::abs(lane.x) > options_.diverge_beyond) {
      lane.status = LaneStatus::kDiverged;
      lane.observation = {NAN, NAN};
      lane.reward = NAN;
    } else if (std::abs(lane.x) > options_.terminate_beyond) {
      lane.status = LaneStatus::kTerminated;
    } else if (options_.max_episode_steps > 0 && lane.clock >= options_.max_episode_steps) {
      lane.status = LaneStatus::kTruncated;
    } else {
      lane.status = LaneStatus::kRunning;
    }
  }

  PointMassOptions options_;
  SimulatorSpec spec_;
  ParameterSpace parameters_ = MakeParameters();
  int n_threads_;
  std::vector<Lane> lanes_;
};

class PointMassFactory : public SimulatorFactory {
 public:
  explicit PointMassFactory(const PointMassOptions& options = {})
      : options_(options), spec_(PointMass::MakeSpec(options)), parameters_(PointMass::MakeParameters()) {}
  const SimulatorSpec& spec() const override { return spec_; }
  const ParameterSpace& parameters() const override { return parameters_; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<PointMass>(options_, n_lanes, n_threads);
  }

 private:
  PointMassOptions options_;
  SimulatorSpec spec_;
  ParameterSpace parameters_;
};

}  // namespace oted
