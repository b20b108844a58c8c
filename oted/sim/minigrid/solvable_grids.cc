#include "oted/sim/minigrid/solvable_grids.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>

#include "oted/base/error.h"

namespace oted::minigrid {
namespace {

// The edge of the sweep: for each column the component of its last cell. 0 is an obstacle, 1 the start's component.
using Edge = std::array<uint8_t, SolvableGrids::kMaxSide>;

uint64_t KeyOf(const Edge& edge) {
  uint64_t key = 0;
  for (size_t i = edge.size(); i-- > 0;) key = key << 4 | edge[i];
  return key;
}

// Components other than the start's get numbers in order of appearance, so that equal partitions are equal edges.
void Canonicalise(Edge& edge) {
  std::array<uint8_t, 16> renamed{};
  uint8_t next = 2;
  for (uint8_t& label : edge) {
    if (label < 2) continue;
    if (renamed[label] == 0) renamed[label] = next++;
    label = renamed[label];
  }
}

// The edge after a cell in column `column`; false when no cell of the edge is connected to the start.
bool Advance(Edge& edge, size_t column, bool obstacle, bool is_start) {
  if (is_start) {
    edge[column] = 1;
    return true;
  }
  const uint8_t above = edge[column], before = column > 0 ? edge[column - 1] : uint8_t{0};
  if (obstacle) {
    edge[column] = 0;
  } else if (above != 0 && before != 0) {
    const uint8_t joined = std::min(above, before), other = std::max(above, before);
    for (uint8_t& label : edge) label = label == other ? joined : label;
  } else if (before != 0) {
    edge[column] = before;
  } else if (above == 0) {
    edge[column] = 15;  // new: renamed below
  }
  Canonicalise(edge);
  return std::ranges::count(edge, uint8_t{1}) > 0;
}

double Power(double base, size_t exponent) { return exponent == 0 ? 1.0 : std::pow(base, exponent); }

}  // namespace

bool IsSolvable(int side, std::span<const uint8_t> obstacles) {
  OTED_CHECK(side >= 2 && side <= 32 && static_cast<int>(obstacles.size()) == side * side);
  std::array<uint64_t, 34> free{}, reached{};  // rows 1, ..., side; the rows around them stay empty
  for (size_t y = 0; y < static_cast<size_t>(side); ++y) {
    for (size_t x = 0; x < static_cast<size_t>(side); ++x) {
      free[y + 1] |= static_cast<uint64_t>(obstacles[y * static_cast<size_t>(side) + x] == 0) << x;
    }
  }
  const size_t last = static_cast<size_t>(side);
  reached[1] = free[1] & 1;
  const auto grow = [&](size_t y) {
    uint64_t row = reached[y] | ((reached[y - 1] | reached[y + 1]) & free[y]);
    for (uint64_t before = 0; before != row;) {
      before = row;
      row |= (row << 1 | row >> 1) & free[y];
    }
    const bool grew = row != reached[y];
    reached[y] = row;
    return grew;
  };
  for (bool grew = true; grew;) {
    grew = false;
    for (size_t y = 1; y <= last; ++y) grew |= grow(y);
    for (size_t y = last; y >= 1; --y) grew |= grow(y);
  }
  return (reached[last] >> (last - 1) & 1) != 0;
}

SolvableGrids::SolvableGrids(int side) : side_(side) {
  if (side < 2 || side > kMaxSide) {
    throw UsageError(fmt::format("got a room of side {}, wanted 2 to {}: solvable rooms are counted only up to there",
                                 side, kMaxSide));
  }
  const size_t n = static_cast<size_t>(side) * static_cast<size_t>(side);
  std::vector<Edge> states = {Edge{}};
  for (size_t cell = 0; cell < n; ++cell) {
    Layer layer;
    std::vector<Edge> next_states;
    std::map<uint64_t, int32_t> ids;
    for (const Edge& state : states) {
      std::array<int32_t, 2> next = {kDead, kDead};
      for (size_t obstacle = 0; obstacle < 2; ++obstacle) {
        if (obstacle == 1 && (cell == 0 || cell + 1 == n)) continue;
        Edge edge = state;
        if (!Advance(edge, cell % static_cast<size_t>(side), obstacle == 1, cell == 0)) continue;
        if (cell + 1 == n) {
          if (edge[static_cast<size_t>(side) - 1] == 1) next[obstacle] = 0;
          continue;
        }
        const auto [at, is_new] = ids.try_emplace(KeyOf(edge), static_cast<int32_t>(next_states.size()));
        if (is_new) next_states.push_back(edge);
        next[obstacle] = at->second;
      }
      layer.push_back(next);
    }
    layers_.push_back(std::move(layer));
    states = std::move(next_states);
  }
  std::vector<CellFact> nothing(n, CellFact::kUnknown);
  nothing.front() = nothing.back() = CellFact::kFree;
  counts_ = Completions(nothing);
}

const SolvableGrids& SolvableGrids::Of(int side) {
  static std::mutex mutex;
  static std::map<int, std::unique_ptr<SolvableGrids>> made;
  const std::lock_guard lock(mutex);
  std::unique_ptr<SolvableGrids>& grids = made[side];
  if (grids == nullptr) grids = std::make_unique<SolvableGrids>(side);
  return *grids;
}

std::vector<double> SolvableGrids::Completions(std::span<const CellFact> facts) const {
  OTED_CHECK(facts.size() == layers_.size());
  // Polynomials in the number of obstacles among the unknown cells so far, one per state.
  size_t length = 1;
  std::vector<double> now = {1.0};
  for (size_t cell = 0; cell < layers_.size(); ++cell) {
    const bool unknown = facts[cell] == CellFact::kUnknown && !IsEnd(cell);
    const size_t next_length = length + (unknown ? 1 : 0);
    std::vector<double> next(n_states(cell + 1) * next_length, 0.0);
    for (size_t state = 0; state < layers_[cell].size(); ++state) {
      const double* from = now.data() + state * length;
      for (size_t obstacle = 0; obstacle < 2; ++obstacle) {
        const int32_t to_state = layers_[cell][state][obstacle];
        const bool allowed = unknown || (obstacle == 1) == (facts[cell] == CellFact::kObstacle);
        if (to_state == kDead || !allowed) continue;
        double* to = next.data() + static_cast<size_t>(to_state) * next_length + (unknown ? obstacle : 0);
        for (size_t k = 0; k < length; ++k) to[k] += from[k];
      }
    }
    now = std::move(next);
    length = next_length;
  }
  return now;
}

double SolvableGrids::Acceptance(double density) const { return std::exp(LogMixture(counts_, density)); }

double SolvableGrids::MeanRealisedDensity(double density) const {
  double sum = 0, weighted = 0;
  const size_t n = counts_.size() - 1;
  for (size_t k = 0; k <= n; ++k) {
    const double p = counts_[k] * Power(density, k) * Power(1 - density, n - k);
    sum += p;
    weighted += p * static_cast<double>(k);
  }
  return weighted / sum / static_cast<double>(n);
}

void SolvableGrids::Sample(double density, Rng& rng, std::span<uint8_t> obstacles) const {
  OTED_CHECK(obstacles.size() == layers_.size() && density >= 0 && density < 1);
  // The probability of a path from each state on, from the last cell to the first; then the cells one by one, each
  // given that there will be a path.
  std::vector<std::vector<double>> ahead(layers_.size() + 1);
  ahead.back() = {1.0};
  const auto value = [&](size_t cell, int32_t state) {
    return state == kDead ? 0.0 : ahead[cell][static_cast<size_t>(state)];
  };
  for (size_t cell = layers_.size(); cell-- > 0;) {
    ahead[cell].resize(layers_[cell].size());
    for (size_t state = 0; state < layers_[cell].size(); ++state) {
      const auto& [if_free, if_obstacle] = layers_[cell][state];
      ahead[cell][state] = IsEnd(cell)
                               ? value(cell + 1, if_free)
                               : (1 - density) * value(cell + 1, if_free) + density * value(cell + 1, if_obstacle);
    }
  }
  int32_t state = 0;
  for (size_t cell = 0; cell < layers_.size(); ++cell) {
    const auto& [if_free, if_obstacle] = layers_[cell][static_cast<size_t>(state)];
    bool obstacle = false;
    if (!IsEnd(cell)) {
      const double u = rng.Uniform();
      obstacle = u * ahead[cell][static_cast<size_t>(state)] < density * value(cell + 1, if_obstacle);
    }
    obstacles[cell] = obstacle;
    state = obstacle ? if_obstacle : if_free;
    OTED_CHECK(state != kDead);
  }
}

double LogMixture(std::span<const double> counts, double z) {
  const size_t n = counts.size() - 1;
  double largest = -std::numeric_limits<double>::infinity();
  const double log_z = z > 0 ? std::log(z) : 0, log_rest = z < 1 ? std::log1p(-z) : 0;
  std::vector<double> terms;
  terms.reserve(n + 1);
  for (size_t k = 0; k <= n; ++k) {
    if (counts[k] <= 0 || (k > 0 && z <= 0) || (k < n && z >= 1)) continue;
    const double term = std::log(counts[k]) + static_cast<double>(k) * log_z + static_cast<double>(n - k) * log_rest;
    terms.push_back(term);
    largest = std::max(largest, term);
  }
  if (terms.empty()) return largest;
  double sum = 0;
  for (const double term : terms) sum += std::exp(term - largest);
  return largest + std::log(sum);
}

}  // namespace oted::minigrid
