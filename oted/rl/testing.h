#pragma once
/// A task with discrete actions whose optimum is known. Include from *_test.cc files only.

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "oted/base/error.h"
#include "oted/sim/simulator.h"

namespace oted {

struct CorridorOptions {
  bool as_image = false;
  int max_episode_steps = 12;
  double diverge_share = 0;     ///< of steps, at random
  bool endless_reward = false;  ///< reward 1 for every step, whatever is done, and no goal
};

/// Five cells in a row; actions left, right. The agent starts in the middle, and a goal lies at one end or the other,
/// drawn anew for each episode and shown: +1 there, two steps away. The observation is the two places as numbers, or a
/// picture of the cells (0 empty, 1 agent, 2 goal), three rows high.
/// Parameter: slip, the probability that a step goes nowhere.
class Corridor : public Simulator {
 public:
  static SimulatorSpec MakeSpec(const CorridorOptions& options) {
    SimulatorSpec spec;
    spec.task = "Corridor";
    spec.observation_shape = {options.as_image ? 15 : 2};
    if (options.as_image) {
      spec.image_shape = {3, 5, 1};
      spec.observation_levels.assign(15, 3);
    }
    spec.act_dim = 1;
    spec.n_discrete_actions = 2;
    spec.action_low = {0};
    spec.action_high = {1};
    spec.max_episode_steps = options.max_episode_steps;
    return spec;
  }
  static ParameterSpace MakeParameters() {
    return ParameterSpace({{.name = "slip", .field = "env/slip", .low = 0, .high = 0.9}});
  }
  Corridor(const CorridorOptions& options, int n_lanes)
      : options_(options), spec_(MakeSpec(options)), lanes_(static_cast<size_t>(n_lanes)) {}

  const SimulatorSpec& spec() const override { return spec_; }
  const ParameterSpace& parameters() const override { return parameters_; }
  int n_lanes() const override { return static_cast<int>(lanes_.size()); }
  void SetParameters(int lane, std::span<const double> z) override { At(lane).slip = z[0]; }
  void Reset(int lane, Rng& rng) override {
    Lane& l = At(lane);
    l.x = 2;
    l.goal = rng.Below(2) == 0 ? 0 : 4;
    l.clock = 0;
    l.rng = Rng(rng.Next());
    l.status = LaneStatus::kRunning;
    Show(l);
  }
  bool SetStateFromObservation(int, std::span<const double>) override { throw UsageError("no settable state"); }
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    for (const int lane : lanes) {
      Lane& l = At(lane);
      const double action = actions[static_cast<size_t>(lane)];
      OTED_CHECK(action == 0 || action == 1);
      if (l.rng.Uniform() >= l.slip) l.x = std::clamp(l.x + (action > 0 ? 1 : -1), 0, 4);
      ++l.clock;
      const bool there = !options_.endless_reward && l.x == l.goal;
      l.reward = there || options_.endless_reward ? 1 : 0;
      l.status = there                                   ? LaneStatus::kTerminated
                 : l.clock >= options_.max_episode_steps ? LaneStatus::kTruncated
                                                         : LaneStatus::kRunning;
      Show(l);
      if (l.rng.Uniform() < options_.diverge_share) {
        l.status = LaneStatus::kDiverged;
        l.reward = NAN;
        std::fill(l.observation.begin(), l.observation.end(), NAN);
      }
    }
  }
  std::span<const double> observation(int lane) const override { return lanes_[static_cast<size_t>(lane)].observation; }
  double reward(int lane) const override { return lanes_[static_cast<size_t>(lane)].reward; }
  LaneStatus status(int lane) const override { return lanes_[static_cast<size_t>(lane)].status; }

 private:
  struct Lane {
    int x = 2, goal = 4, clock = 0;
    double slip = 0, reward = 0;
    LaneStatus status = LaneStatus::kRunning;
    Rng rng{0};
    std::vector<double> observation;
  };
  Lane& At(int lane) { return lanes_[static_cast<size_t>(lane)]; }
  void Show(Lane& l) const {
    if (!options_.as_image) {
      l.observation = {static_cast<double>(l.x), static_cast<double>(l.goal)};
      return;
    }
    l.observation.assign(15, 0);
    l.observation[5 + static_cast<size_t>(l.goal)] = 2;
    l.observation[5 + static_cast<size_t>(l.x)] = 1;
  }

  CorridorOptions options_;
  SimulatorSpec spec_;
  ParameterSpace parameters_ = MakeParameters();
  std::vector<Lane> lanes_;
};

class CorridorFactory : public SimulatorFactory {
 public:
  explicit CorridorFactory(const CorridorOptions& options = {})
      : options_(options), spec_(Corridor::MakeSpec(options)), parameters_(Corridor::MakeParameters()) {}
  const SimulatorSpec& spec() const override { return spec_; }
  const ParameterSpace& parameters() const override { return parameters_; }
  std::unique_ptr<Simulator> Make(int n_lanes, int) const override {
    return std::make_unique<Corridor>(options_, n_lanes);
  }

 private:
  CorridorOptions options_;
  SimulatorSpec spec_;
  ParameterSpace parameters_;
};

}  // namespace oted
