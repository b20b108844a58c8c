#include "oted/sim/minigrid/generate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/sim/minigrid/solvable_grids.h"

namespace oted::minigrid {
namespace {

int Between(Rng& rng, int low, int end) { return low + static_cast<int>(rng.Below(static_cast<uint64_t>(end - low))); }

// A uniformly random empty cell without the agent.
Position EmptyCell(const State& state, Rng& rng) {
  const Grid& grid = state.grid;
  for (;;) {
    const Position at{Between(rng, 0, grid.width()), Between(rng, 0, grid.height())};
    if (grid.at(at.x, at.y).is_empty() && at != Position{state.x, state.y}) return at;
  }
}

void PlaceAgent(State& state, Rng& rng) {
  state.x = state.y = -1;
  const Position at = EmptyCell(state, rng);
  state.x = at.x;
  state.y = at.y;
  state.direction = Between(rng, 0, 4);
}

void AddBall(State& state, Position at) {
  state.grid.at(at.x, at.y) = kBall;
  state.balls.push_back(at);
}

void GenerateCrossing(const MinigridTask& task, Rng& rng, State& state) {
  Grid& grid = state.grid;
  const int size = task.size;
  const Cell river = task.obstacle == GridObstacle::kLava ? kLava : kWall;
  // Rivers at even positions, vertical ones first.
  const int n_each = (size - 3) / 2;
  std::vector<int> vertical, horizontal;
  const std::vector<int> order = RandomPermutation(2 * n_each, rng);
  for (size_t i = 0; i < static_cast<size_t>(task.n_items); ++i) {
    (order[i] < n_each ? vertical : horizontal).push_back(2 + 2 * (order[i] % n_each));
  }
  std::sort(vertical.begin(), vertical.end());
  std::sort(horizontal.begin(), horizontal.end());
  for (const int y : horizontal) {
    for (int x = 1; x < size - 1; ++x) grid.at(x, y) = river;
  }
  for (const int x : vertical) {
    for (int y = 1; y < size - 1; ++y) grid.at(x, y) = river;
  }
  // A monotone path of rooms from corner to corner: one opening in each river that it crosses.
  const size_t n_vertical = vertical.size();
  const std::vector<int> path = RandomPermutation(task.n_items, rng);
  vertical.insert(vertical.begin(), 0);
  vertical.push_back(size - 1);
  horizontal.insert(horizontal.begin(), 0);
  horizontal.push_back(size - 1);
  size_t column = 0, row = 0;
  for (const int step : path) {
    if (static_cast<size_t>(step) < n_vertical) {
      grid.at(vertical[column + 1], Between(rng, horizontal[row] + 1, horizontal[row + 1])) = Cell();
      ++column;
    } else {
      grid.at(Between(rng, vertical[column] + 1, vertical[column + 1]), horizontal[row + 1]) = Cell();
      ++row;
    }
  }
}

void GenerateFourRooms(Rng& rng, State& state) {
  Grid& grid = state.grid;
  const int half = grid.width() / 2;
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 2; ++column) {
      const int left = column * half, top = row * half;
      if (column == 0) {
        grid.VerticalWall(left + half, top, half);
        grid.at(left + half, Between(rng, top + 1, top + half)) = Cell();
      }
      if (row == 0) {
        grid.HorizontalWall(left, top + half, half);
        grid.at(Between(rng, left + 1, left + half), top + half) = Cell();
      }
    }
  }
  PlaceAgent(state, rng);
  const Position goal = EmptyCell(state, rng);
  grid.at(goal.x, goal.y) = kGoal;
}

// One draw of the room, solvable or not. Start and goal are its first and its last cell.
void DrawRoom(const MinigridTask& task, double density, Rng& rng, std::vector<uint8_t>& obstacles) {
  const size_t n_free = obstacles.size() - 2;
  if (task.placement == GridPlacement::kBernoulli) {
    for (size_t i = 1; i <= n_free; ++i) obstacles[i] = rng.Uniform() < density;
    return;
  }
  // The count of cells that remain, in order: each is taken with probability (wanted / remaining).
  auto wanted = static_cast<uint64_t>(std::lround(density * static_cast<double>(n_free)));
  for (size_t i = 1; i <= n_free; ++i) {
    obstacles[i] = rng.Below(n_free - i + 1) < wanted;
    wanted -= obstacles[i];
  }
}

void GenerateObstacles(const MinigridTask& task, double density, Rng& rng, State& state) {
  constexpr int kDrawsBeforeExact = 1000;
  const int side = task.size - 2;
  const bool has_exact = task.placement == GridPlacement::kBernoulli && side <= SolvableGrids::kMaxSide;
  std::vector<uint8_t> obstacles(static_cast<size_t>(side * side), 0);
  DrawRoom(task, density, rng, obstacles);
  for (int draw = 1; task.solvable && !IsSolvable(side, obstacles); ++draw) {
    if (has_exact && draw >= kDrawsBeforeExact) {
      SolvableGrids::Of(side).Sample(density, rng, obstacles);
      break;
    }
    if (draw >= kMaxDraws) {
      throw UsageError(fmt::format(
          "task '{}': {} grids of density {} and none with a path from start to goal; lower the upper bound of the "
          "density, or set solvable = false",
          task.name, draw, density));
    }
    DrawRoom(task, density, rng, obstacles);
  }
  const Cell obstacle = task.obstacle == GridObstacle::kLava ? kLava : kWall;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      if (obstacles[static_cast<size_t>(y * side + x)] == 0) continue;
      if (task.moves_balls()) {
        AddBall(state, {x + 1, y + 1});
      } else {
        state.grid.at(x + 1, y + 1) = obstacle;
      }
    }
  }
}

}  // namespace

void Generate(const MinigridTask& task, double density, Rng& rng, State& state) {
  OTED_CHECK(state.grid.width() == task.size && state.grid.height() == task.size);
  Grid& grid = state.grid;
  grid.MakeRoom();
  state.x = state.y = 1;
  state.direction = 0;
  state.carrying = Cell();
  state.step_count = 0;
  state.balls.clear();
  if (task.layout == MinigridLayout::kFourRooms) {
    GenerateFourRooms(rng, state);
    return;
  }
  grid.at(task.size - 2, task.size - 2) = kGoal;
  if (task.random_start) PlaceAgent(state, rng);
  switch (task.layout) {
    case MinigridLayout::kObstacles:
      GenerateObstacles(task, density, rng, state);
      break;
    case MinigridLayout::kCrossing:
      GenerateCrossing(task, rng, state);
      break;
    case MinigridLayout::kDynamicObstacles:
      for (int i = 0; i < task.n_items; ++i) AddBall(state, EmptyCell(state, rng));
      break;
    case MinigridLayout::kEmpty:
    case MinigridLayout::kFourRooms:
      break;
  }
}

double RealisedDensity(const State& state) {
  const int side = state.grid.width() - 2;
  int obstacles = 0;
  for (int y = 1; y <= side; ++y) {
    for (int x = 1; x <= side; ++x) {
      const Kind kind = state.grid.at(x, y).kind();
      obstacles += kind == Kind::kWall || kind == Kind::kLava || kind == Kind::kBall;
    }
  }
  return static_cast<double>(obstacles) / (side * side - 2);
}

}  // namespace oted::minigrid
