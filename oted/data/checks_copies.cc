#include "oted/data/checks_copies.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

constexpr double kSame = 1e-8;  // of the variance that may be left: what a table's digits round
constexpr int kFewestMoves = 20;

/// The share of the variance of `seen` that no line through `done` explains; 1 where the action hardly ever changes.
double Unexplained(const Array2<double>& seen, int j, const Array2<double>& done, int a) {
  const int n = seen.rows();
  double mean_x = 0, mean_y = 0, xx = 0, yy = 0, xy = 0;
  int n_moves = 0;
  for (int i = 0; i < n; ++i) {
    mean_x += done(i, a) / n;
    mean_y += seen(i, j) / n;
    n_moves += i > 0 && done(i, a) != done(i - 1, a);
  }
  for (int i = 0; i < n; ++i) {
    const double x = done(i, a) - mean_x, y = seen(i, j) - mean_y;
    xx += x * x;
    yy += y * y;
    xy += x * y;
  }
  return n_moves < kFewestMoves || xx <= 0 || yy <= 0 ? 1 : 1 - xy * xy / (xx * yy);
}

}  // namespace

void CheckCopies(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!facts.flat_observations || !facts.continuous_actions) return;
  for (const int j : facts.States()) {
    if (j >= dataset.obs_dim()) continue;
    for (int a = 0; a < dataset.act_dim(); ++a) {
      const bool here = Unexplained(dataset.observations, j, dataset.actions, a) < kSame;
      if (!here && Unexplained(dataset.next_observations, j, dataset.actions, a) >= kSame) continue;
      const std::string state = facts.ObservationName(j), action = facts.ActionName(a);
      findings.push_back(
          {.check = "copied_channels",
           .severity = Severity::kWarning,
           .what = fmt::format("{} of {} follows {} without any error", state, here ? "the same row" : "the next row",
                               action),
           .count = dataset.size(),
           .channels = {state, action},
           .meaning = "one was logged in the other's place, the command as what was measured or what "
                      "was measured as the command: nothing of the motor can be identified",
           .remedy = fmt::format("log what was measured as {} and what was commanded as {}", state, action)});
    }
  }
}

}  // namespace oted
