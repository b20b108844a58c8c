#pragma once
/// The grid worlds by name: what they are made of and which rules they have.

#include <optional>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/sim/minigrid/transition.h"

namespace oted {

/// How a task's grids are drawn.
enum class MinigridLayout {
  kObstacles,         ///< the paper's: a room with obstacles at a density; no environment of Minigrid has one
  kEmpty,             ///< EmptyEnv
  kCrossing,          ///< CrossingEnv: walls (SimpleCrossing) or lava (LavaCrossing) with openings
  kDynamicObstacles,  ///< DynamicObstaclesEnv: balls that move
  kFourRooms,         ///< FourRoomsEnv
};

enum class GridObservation {
  kView,   ///< 7 x 7 x 3 around the agent
  kWhole,  ///< the whole grid, size x size x 3
};
enum class GridCollision { kBlock, kTerminate };
enum class GridObstacle { kWall, kLava, kBall };
enum class GridPlacement {
  kBernoulli,  ///< each free cell with probability density
  kCount,      ///< round(density x free cells) of them
};

/// One task. Start (1, 1) looking right and goal in the opposite corner, unless the layout says otherwise.
struct MinigridTask {
  std::string name;
  MinigridLayout layout = MinigridLayout::kObstacles;
  bool random_start = false;  ///< kEmpty, kDynamicObstacles: the agent starts anywhere, looking anywhere
  int n_items = 0;            ///< kCrossing: crossings; kDynamicObstacles: balls
  int n_actions = minigrid::kActions;

  // The settings that a user may change; the last five are of kObstacles alone.
  int size = 10;      ///< side of the grid with its border
  int max_steps = 0;  ///< time limit in steps; 0: Minigrid's, 4 size^2 (100 in FourRooms)
  bool see_through_walls = false;
  GridObservation observation = GridObservation::kView;
  GridCollision collision = GridCollision::kBlock;
  double density = 0.2;  ///< of the nominal simulator
  GridObstacle obstacle = GridObstacle::kWall;
  GridPlacement placement = GridPlacement::kBernoulli;
  bool solvable = true;  ///< grids without a path from start to goal are drawn again

  /// The settings that this task's layout reads, for [task], --set and the run record.
  FieldList Fields();
  /// @throws UsageError on settings that contradict each other or the layout.
  void Check() const;

  int time_limit() const;
  minigrid::Rules rules() const;
  bool moves_balls() const;
  /// Free cells of kObstacles: all but the border, the start and the goal.
  int n_free_cells() const { return (size - 2) * (size - 2) - 2; }
};

/// What a user may change of a grid world by [grid]. Settings that a task's layout does not read must stay as they are.
struct GridSettings {
  GridObservation observation = GridObservation::kView;
  GridObstacle obstacle = GridObstacle::kWall;
  GridPlacement placement = GridPlacement::kBernoulli;
  bool solvable = true;
  std::optional<GridCollision> collision;  ///< none: as the task has it
  std::optional<bool> see_through_walls;
  int max_steps = 0;
  double density = 0.2;

  FieldList Fields();
  bool operator==(const GridSettings&) const = default;
  /// The task with these settings. @throws UsageError for one that its layout does not read
  MinigridTask ApplyTo(MinigridTask task) const;
};

/// Whether `name` names a task of this folder, known or not: it starts with "MiniGrid-".
bool IsMinigridTask(const std::string& name);

/// The task of that name: one of MinigridTaskNames(), or MiniGrid-Obstacles-NxN with another N in 4, ..., 32.
/// @throws UsageError with the nearest name when there is none.
MinigridTask FindMinigridTask(const std::string& name);

/// MiniGrid-Obstacles-10x10, then Minigrid's registered names.
std::vector<std::string> MinigridTaskNames();

}  // namespace oted
