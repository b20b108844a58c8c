#include "oted/sim/minigrid/density_likelihood.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "oted/base/error.h"
#include "oted/sim/minigrid/view.h"

namespace oted {

using minigrid::CellFact;
using minigrid::Kind;

namespace {

constexpr double kNever = -std::numeric_limits<double>::infinity();

double BinomialCoefficient(size_t n, size_t k) {
  double value = 1;
  for (size_t i = 1; i <= k; ++i) value = value * static_cast<double>(n - k + i) / static_cast<double>(i);
  return value;
}

/// Reads one episode's observations into facts.
class Reader {
 public:
  Reader(const MinigridTask& task, const Dataset& data) : task_(task), data_(data), side_(task.size - 2) {
    facts_.assign(static_cast<size_t>(side_ * side_), CellFact::kUnknown);
    facts_.front() = facts_.back() = CellFact::kFree;
    agent_.grid = minigrid::Grid(task.size, task.size);
  }

  std::vector<CellFact> Read(const Episode& episode) {
    for (int row = episode.begin; row < episode.end; ++row) {
      See(data_.observations.row(row), row);
      if (task_.moves_balls()) return facts_;  // where they were at the start
      Move(row);
    }
    See(data_.next_observations.row(episode.end - 1), episode.end - 1);
    return facts_;
  }

 private:
  [[noreturn]] void Fail(int row, const std::string& what) const {
    throw DataError(fmt::format("observation {}: {}; are these episodes of '{}' from their start, all in one piece?",
                                row, what, task_.name));
  }

  void See(std::span<const double> observation, int row) {
    if (observation.back() != agent_.direction) {
      Fail(row, fmt::format("the agent looks in direction {}, wanted {}", observation.back(), agent_.direction));
    }
    if (task_.observation == GridObservation::kWhole) {
      for (int x = 0; x < task_.size; ++x) {
        for (int y = 0; y < task_.size; ++y)
          Note({x, y}, observation[static_cast<size_t>((x * task_.size + y) * 3)], row);
      }
      return;
    }
    for (int i = 0; i < minigrid::kView; ++i) {
      for (int j = 0; j < minigrid::kView; ++j) {
        // The agent's own cell shows what it carries, which says nothing of the cell.
        if (i == minigrid::kView / 2 && j == minigrid::kView - 1) continue;
        Note(minigrid::ViewCell(agent_, i, j), observation[static_cast<size_t>((i * minigrid::kView + j) * 3)], row);
      }
    }
  }

  void Note(minigrid::Position at, double number, int row) {
    if (at.x < 1 || at.y < 1 || at.x > side_ || at.y > side_) return;
    CellFact fact = CellFact::kFree;
    switch (static_cast<Kind>(static_cast<int>(number))) {
      case Kind::kUnseen:
        return;
      case Kind::kWall:
      case Kind::kLava:
      case Kind::kBall:
        fact = CellFact::kObstacle;
        break;
      case Kind::kAgent:
        // It stands on lava once it has stepped into it; the cell was noted before.
        return;
      default:
        break;
    }
    CellFact& known = facts_[static_cast<size_t>((at.y - 1) * side_ + at.x - 1)];
    if (known != CellFact::kUnknown && known != fact) {
      Fail(row, fmt::format("cell ({}, {}) is no longer what it was", at.x, at.y));
    }
    known = fact;
  }

  // The agent's next place. The cell ahead of it is always seen.
  void Move(int row) {
    const auto action = static_cast<int>(data_.actions(row, 0));
    if (action == minigrid::kLeft) {
      agent_.direction = (agent_.direction + 3) & 3;
    } else if (action == minigrid::kRight) {
      agent_.direction = (agent_.direction + 1) & 3;
    } else if (action == minigrid::kForward) {
      const minigrid::Position to = agent_.front();
      if (to.x < 1 || to.y < 1 || to.x > side_ || to.y > side_) return;
      const CellFact fact = facts_[static_cast<size_t>((to.y - 1) * side_ + to.x - 1)];
      if (fact == CellFact::kUnknown) Fail(row, "the cell ahead of the agent is not visible");
      if (fact == CellFact::kObstacle && task_.obstacle == GridObstacle::kWall) return;
      agent_.x = to.x;
      agent_.y = to.y;
    }
  }

  const MinigridTask& task_;
  const Dataset& data_;
  int side_;
  minigrid::State agent_;  // where it is; the grid stays empty
  std::vector<CellFact> facts_;
};

}  // namespace

std::vector<CellFact> SeenCells(const MinigridTask& task, const Dataset& data, const Episode& episode) {
  OTED_CHECK(task.layout == MinigridLayout::kObstacles && episode.size() > 0);
  const int side = task.observation == GridObservation::kWhole ? task.size : minigrid::kView;
  data.CheckFits(task.name, side * side * 3 + 1, 1);
  return Reader(task, data).Read(episode);
}

DensityLikelihood::DensityLikelihood(const MinigridTask& task) : task_(task) {
  task_.Check();
  if (task_.layout != MinigridLayout::kObstacles) {
    throw UsageError(fmt::format("task '{}' has no density; the likelihood is for MiniGrid-Obstacles-NxN", task_.name));
  }
  if (task_.solvable) grids_ = &minigrid::SolvableGrids::Of(task_.size - 2);
}

void DensityLikelihood::Add(std::span<const CellFact> facts) {
  OTED_CHECK(static_cast<int>(facts.size()) == task_.n_free_cells() + 2);
  const auto cells = facts.subspan(1, facts.size() - 2);
  const auto obstacles = static_cast<int>(std::ranges::count(cells, CellFact::kObstacle));
  const auto n_unknown = static_cast<size_t>(std::ranges::count(cells, CellFact::kUnknown));
  const int free = static_cast<int>(cells.size() - n_unknown) - obstacles;

  std::vector<uint8_t> blocked;
  for (const CellFact fact : facts) blocked.push_back(fact != CellFact::kFree);
  // With a path through seen cells every completion is solvable, and the unseen cells drop out.
  const bool sure = grids_ == nullptr || minigrid::IsSolvable(task_.size - 2, blocked);
  std::vector<double> completions;
  if (!sure) {
    completions = grids_->Completions(facts);
    if (std::ranges::all_of(completions, [](double count) { return count == 0; })) {
      throw DataError(fmt::format(
          "episode {}: no path can lead from start to goal, though the task's grids are solvable", n_episodes_));
    }
  } else if (task_.placement == GridPlacement::kCount) {
    for (size_t k = 0; k <= n_unknown; ++k) completions.push_back(BinomialCoefficient(n_unknown, k));
  }
  ++n_episodes_;
  n_seen_ += obstacles + free;
  n_obstacles_seen_ += obstacles;
  if (!completions.empty()) seen_.push_back({obstacles, std::move(completions)});
}

void DensityLikelihood::Add(const Dataset& data) {
  for (const Episode& episode : data.Episodes()) Add(SeenCells(task_, data, episode));
}

double DensityLikelihood::LogLikelihood(double z) const {
  OTED_CHECK(z >= 0 && z < 1);
  const auto n = static_cast<size_t>(task_.n_free_cells());
  double sum = 0;
  if (task_.placement == GridPlacement::kCount) {
    const auto count = static_cast<size_t>(std::lround(z * static_cast<double>(n)));
    const double rooms = grids_ != nullptr ? grids_->counts()[count] : BinomialCoefficient(n, count);
    for (const Seen& seen : seen_) {
      const auto unseen = static_cast<size_t>(static_cast<ptrdiff_t>(count) - seen.obstacles);
      if (unseen >= seen.completions.size() || seen.completions[unseen] == 0 || rooms == 0) return kNever;
      sum += std::log(seen.completions[unseen] / rooms);
    }
    return sum;
  }
  if (z == 0 && n_obstacles_seen_ > 0) return kNever;
  if (n_obstacles_seen_ > 0) sum += n_obstacles_seen_ * std::log(z);
  sum += (n_seen_ - n_obstacles_seen_) * std::log1p(-z);
  for (const Seen& seen : seen_) sum += minigrid::LogMixture(seen.completions, z);
  if (grids_ != nullptr) sum -= n_episodes_ * minigrid::LogMixture(grids_->counts(), z);
  return sum;
}

DensityEstimate DensityLikelihood::EstimateAt(double z, double low, double high) const {
  DensityEstimate estimate{z, LogLikelihood(z), std::numeric_limits<double>::infinity()};
  // By second differences; placement by count has no derivative, its steps are one cell wide.
  const double h = task_.placement == GridPlacement::kCount ? 1.0 / task_.n_free_cells() : 1e-3;
  if (z - h <= low || z + h >= high) return estimate;
  const double curvature = (LogLikelihood(z - h) - 2 * estimate.log_likelihood + LogLikelihood(z + h)) / (h * h);
  if (std::isfinite(curvature) && curvature < 0) estimate.standard_error = 1 / std::sqrt(-curvature);
  return estimate;
}

DensityEstimate DensityLikelihood::MaximumOnGrid(double low, double high, double step) const {
  OTED_CHECK(low >= 0 && low < high && high < 1 && step > 0);
  constexpr double kRounding = 1e-9;
  double best = low, best_value = kNever;
  bool found = false;
  for (int i = static_cast<int>(std::ceil(low / step - kRounding)); i * step <= high + kRounding; ++i) {
    const double z = std::clamp(i * step, low, high);
    const double value = LogLikelihood(z);
    if (found && !(value > best_value)) continue;
    found = true;
    best = z;
    best_value = value;
  }
  if (!found) throw UsageError(fmt::format("no multiple of {} lies in [{}, {}]; widen the range", step, low, high));
  return EstimateAt(best, low, high);
}

DensityEstimate DensityLikelihood::Maximum(double low, double high) const {
  OTED_CHECK(low >= 0 && low < high && high < 1);
  // A coarse look first: with rejection the likelihood need not have one peak only.
  const int n_coarse = task_.placement == GridPlacement::kCount ? 1000 : 200;
  const auto at = [&](int i) { return low + (high - low) * i / n_coarse; };
  int best = 0;
  double best_value = kNever;
  for (int i = 0; i <= n_coarse; ++i) {
    const double value = LogLikelihood(at(i));
    if (value > best_value) {
      best = i;
      best_value = value;
    }
  }
  if (task_.placement == GridPlacement::kCount) return EstimateAt(at(best), low, high);
  // Golden section between the neighbours.
  const double ratio = (std::sqrt(5.0) - 1) / 2;
  double a = at(std::max(best - 1, 0)), b = at(std::min(best + 1, n_coarse));
  double c = b - ratio * (b - a), d = a + ratio * (b - a);
  double value_c = LogLikelihood(c), value_d = LogLikelihood(d);
  while (b - a > 1e-7) {
    if (value_c >= value_d) {
      b = d;
      d = c;
      value_d = value_c;
      c = b - ratio * (b - a);
      value_c = LogLikelihood(c);
    } else {
      a = c;
      c = d;
      value_c = value_d;
      d = a + ratio * (b - a);
      value_d = LogLikelihood(d);
    }
  }
  const double middle = (a + b) / 2;
  // The ends themselves, for a likelihood that rises up to a bound.
  const double z = LogLikelihood(middle) >= best_value ? middle : at(best);
  return EstimateAt(z, low, high);
}

}  // namespace oted
