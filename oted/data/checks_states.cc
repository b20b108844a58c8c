#include "oted/data/checks_states.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

constexpr double kTolerance = 1e-5;   // of the value, and of the channel's range: float32 and a conversion
constexpr double kLayoutShare = 0.5;  // of the numbers that must agree for the layout to be the one assumed
constexpr double kAgreement = 0.999;  // of the numbers that must agree for "logged after the action"

/// Compares the columns of `observations` with [qpos from column `skip` on, qvel].
class Comparison {
 public:
  Comparison(const Dataset& d, int skip) : d_(d), skip_(skip), n_positions_(d.qpos.cols() - skip) {
    for (int j = 0; j < d.obs_dim(); ++j) {
      double extreme = 0;
      for (int i = 0; i < d.size(); ++i) extreme = std::max(extreme, std::abs(d.observations(i, j)));
      extreme_.push_back(extreme);
      if (j >= n_positions_) clip_ = std::max(clip_, extreme);
    }
  }

  bool Agrees(const Array2<double>& observations, int i, int j) const {
    const bool is_velocity = j >= n_positions_;
    const double logged = observations(i, j);
    const double state = is_velocity ? d_.qvel(i, j - n_positions_) : d_.qpos(i, j + skip_);
    if (std::abs(logged - state) <= kTolerance * (std::abs(state) + extreme_[static_cast<size_t>(j)])) return true;
    // A clipped velocity: on the largest value that any velocity has, and the state's beyond it.
    return is_velocity && std::abs(logged) >= clip_ && logged * state > 0 && std::abs(state) >= clip_;
  }

  /// Share of all numbers that agree, when `observations` stand beside the states.
  double Share(const Array2<double>& observations) const {
    int64_t n = 0;
    for (int i = 0; i < d_.size(); ++i) {
      for (int j = 0; j < d_.obs_dim(); ++j) n += Agrees(observations, i, j);
    }
    return static_cast<double>(n) / (static_cast<double>(d_.size()) * d_.obs_dim());
  }

 private:
  const Dataset& d_;
  int skip_, n_positions_;
  std::vector<double> extreme_;
  double clip_ = 0;
};

}  // namespace

void CheckStates(const Dataset& d, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!d.has_states() || !facts.flat_observations || !facts.mujoco_observations) return;
  // Gymnasium leaves out the root's x (locomotion on a line) or x and y (Ant); other tasks show everything, or show
  // something else.
  const int skip = d.qpos.cols() + d.qvel.cols() - d.obs_dim();
  if (skip < 0 || skip > 2 || skip > d.qpos.cols()) return;
  const Comparison comparison(d, skip);
  const double share = comparison.Share(d.observations);
  if (share < 1 && comparison.Share(d.next_observations) > kAgreement) {
    findings.push_back({.check = "states_after_action",
                        .severity = Severity::kWarning,
                        .what = "infos/qpos and infos/qvel agree with next_observations, not with observations",
                        .row = 0,
                        .count = d.size(),
                        .meaning = "they were logged after the action: a state set from them is one row late",
                        .remedy = "write the state before the action into the action's row"});
    return;
  }
  if (share < kLayoutShare) return;
  int n_rows = 0, first = -1;
  std::vector<int> n_in(static_cast<size_t>(d.obs_dim()), 0);
  for (int i = 0; i < d.size(); ++i) {
    bool agrees = true;
    for (int j = 0; j < d.obs_dim(); ++j) {
      if (comparison.Agrees(d.observations, i, j)) continue;
      ++n_in[static_cast<size_t>(j)];
      agrees = false;
    }
    if (!agrees && n_rows++ == 0) first = i;
  }
  if (n_rows == 0) return;
  std::vector<std::string> channels;
  for (int j = 0; j < d.obs_dim(); ++j) {
    if (n_in[static_cast<size_t>(j)] > 0) channels.push_back(facts.ObservationName(j));
  }
  findings.push_back(
      {.check = "states_disagree",
       .severity = Severity::kWarning,
       .what = fmt::format("in {} rows the observations are not [qpos{}, qvel] of the same row: {}", n_rows,
                           skip == 0 ? "" : fmt::format(" from number {} on", skip), fmt::join(channels, ", ")),
       .row = first,
       .count = n_rows,
       .channels = channels,
       .meaning = "observations carry noise, offsets or another frame, or the two were logged at different times",
       .remedy = "find out which of the two is right; the design reads the observations alone"});
}

}  // namespace oted
