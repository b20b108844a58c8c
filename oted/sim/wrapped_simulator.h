#pragma once
/// What simulators around another simulator have in common: they show what the one inside shows.

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "oted/sim/simulator.h"

namespace oted {

class WrappedSimulator : public Simulator {
 public:
  explicit WrappedSimulator(std::unique_ptr<Simulator> inside) : inside_(std::move(inside)) {}

  int n_lanes() const override { return inside_->n_lanes(); }
  std::span<const double> observation(int lane) const override { return inside_->observation(lane); }
  double reward(int lane) const override { return inside_->reward(lane); }
  LaneStatus status(int lane) const override { return inside_->status(lane); }
  std::span<const double> pose(int lane) const override { return inside_->pose(lane); }
  std::vector<double> pose_rates(int lane) const override { return inside_->pose_rates(lane); }
  void TakeTaskPolicy(TaskPolicy policy, int lane, Rng& rng, std::span<double> action) const override {
    inside_->TakeTaskPolicy(policy, lane, rng, action);
  }

 protected:
  Simulator& inside() { return *inside_; }
  const Simulator& inside() const { return *inside_; }

 private:
  std::unique_ptr<Simulator> inside_;
};

}  // namespace oted
