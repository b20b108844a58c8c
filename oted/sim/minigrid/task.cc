#include "oted/sim/minigrid/task.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr int kMinSize = 4;
constexpr int kMaxSize = 32;
constexpr const char* kObstaclesPrefix = "MiniGrid-Obstacles-";

const NamedValues<GridObservation> kObservationNames = {{GridObservation::kView, "view"},
                                                        {GridObservation::kWhole, "grid"}};
const NamedValues<GridCollision> kCollisionNames = {{GridCollision::kBlock, "block"},
                                                    {GridCollision::kTerminate, "terminate"}};
const NamedValues<std::optional<GridCollision>> kCollisionOrTaskNames = {
    {std::nullopt, "task"}, {GridCollision::kBlock, "block"}, {GridCollision::kTerminate, "terminate"}};
const NamedValues<std::optional<bool>> kSeeThroughNames = {{std::nullopt, "task"}, {true, "true"}, {false, "false"}};
const NamedValues<GridObstacle> kObstacleNames = {
    {GridObstacle::kWall, "wall"}, {GridObstacle::kLava, "lava"}, {GridObstacle::kBall, "ball"}};
const NamedValues<GridPlacement> kPlacementNames = {{GridPlacement::kBernoulli, "bernoulli"},
                                                    {GridPlacement::kCount, "count"}};

MinigridTask Obstacles(int size) {
  MinigridTask task;
  task.name = fmt::format("{}{}x{}", kObstaclesPrefix, size, size);
  task.size = size;
  task.n_actions = 3;  // there is nothing to pick up or to open
  return task;
}

MinigridTask Empty(int size, bool random_start) {
  MinigridTask task;
  task.name = fmt::format("MiniGrid-Empty-{}{}x{}-v0", random_start ? "Random-" : "", size, size);
  task.layout = MinigridLayout::kEmpty;
  task.size = size;
  task.random_start = random_start;
  task.see_through_walls = true;
  return task;
}

MinigridTask Dynamic(int size, bool random_start, int n_balls) {
  MinigridTask task = Empty(size, random_start);
  task.name = fmt::format("MiniGrid-Dynamic-Obstacles-{}{}x{}-v0", random_start ? "Random-" : "", size, size);
  task.layout = MinigridLayout::kDynamicObstacles;
  task.n_items = n_balls;
  task.n_actions = 3;
  task.obstacle = GridObstacle::kBall;
  task.collision = GridCollision::kTerminate;
  return task;
}

MinigridTask Crossing(GridObstacle obstacle, int size, int n_crossings) {
  MinigridTask task;
  task.name = fmt::format("MiniGrid-{}CrossingS{}N{}-v0", obstacle == GridObstacle::kLava ? "Lava" : "Simple", size,
                          n_crossings);
  task.layout = MinigridLayout::kCrossing;
  task.size = size;
  task.n_items = n_crossings;
  task.obstacle = obstacle;
  return task;
}

MinigridTask FourRooms() {
  MinigridTask task;
  task.name = "MiniGrid-FourRooms-v0";
  task.layout = MinigridLayout::kFourRooms;
  task.size = 19;
  return task;
}

const std::vector<MinigridTask>& Tasks() {
  static const std::vector<MinigridTask> tasks = {Obstacles(10),
                                                  Empty(5, false),
                                                  Empty(5, true),
                                                  Empty(6, false),
                                                  Empty(6, true),
                                                  Empty(8, false),
                                                  Empty(16, false),
                                                  Crossing(GridObstacle::kWall, 9, 1),
                                                  Crossing(GridObstacle::kWall, 9, 2),
                                                  Crossing(GridObstacle::kWall, 9, 3),
                                                  Crossing(GridObstacle::kWall, 11, 5),
                                                  Crossing(GridObstacle::kLava, 9, 1),
                                                  Crossing(GridObstacle::kLava, 9, 2),
                                                  Crossing(GridObstacle::kLava, 9, 3),
                                                  Crossing(GridObstacle::kLava, 11, 5),
                                                  Dynamic(5, false, 2),
                                                  Dynamic(5, true, 2),
                                                  Dynamic(6, false, 3),
                                                  Dynamic(6, true, 3),
                                                  Dynamic(8, false, 4),
                                                  Dynamic(16, false, 8),
                                                  FourRooms()};
  return tasks;
}

// N of "MiniGrid-Obstacles-NxN", 0 when it is no such name.
int ObstaclesSize(const std::string& name) {
  const std::string prefix = kObstaclesPrefix;
  if (!name.starts_with(prefix)) return 0;
  int size = 0;
  const char* const begin = name.data() + prefix.size();
  const auto [end, error] = std::from_chars(begin, name.data() + name.size(), size);
  return error == std::errc{} && name.substr(prefix.size()) == fmt::format("{}x{}", size, size) ? size : 0;
}

}  // namespace

FieldList MinigridTask::Fields() {
  FieldList fields("task");
  const bool obstacles = layout == MinigridLayout::kObstacles;
  if (obstacles) {
    fields.Add("size", &size, "side of the grid with its border [cells]", Between(kMinSize, kMaxSize));
  }
  fields.Add("max_steps", &max_steps, "time limit [steps]; 0: Minigrid's own, 4 size^2 (FourRooms: 100)", AtLeast(0));
  fields.Add("see_through_walls", &see_through_walls, "no cell of the view is hidden behind a wall");
  fields.AddChoice("observation", &observation, "view: 7x7x3 around the agent; grid: the whole grid with the agent",
                   kObservationNames);
  fields.AddChoice("collision", &collision,
                   "block: walls and balls block, lava ends the episode with reward 0; terminate: forward into "
                   "anything but an empty cell or the goal ends it with reward -1",
                   kCollisionNames);
  if (!obstacles) return fields;
  fields.Add("density", &density, "of the nominal simulator: probability of an obstacle in a free cell",
             {.low = 0, .high = 1, .high_open = true});
  fields.AddChoice("obstacle", &obstacle, "wall, lava, or balls that move one cell a step", kObstacleNames);
  fields.AddChoice("placement", &placement,
                   "bernoulli: each free cell with probability density; count: round(density x free cells) of them",
                   kPlacementNames);
  fields.Add("solvable", &solvable, "draw again until start and goal are connected; density is before that");
  return fields;
}

FieldList GridSettings::Fields() {
  FieldList fields("grid");
  fields.AddChoice("observation", &observation, "view: 7x7x3 around the agent; grid: the whole grid with the agent",
                   kObservationNames);
  fields.AddChoice("obstacle", &obstacle, "of MiniGrid-Obstacles: wall, lava, or balls that move one cell a step",
                   kObstacleNames);
  fields.AddChoice("placement", &placement,
                   "of MiniGrid-Obstacles: each free cell with probability density, or round(density x free cells)",
                   kPlacementNames);
  fields.Add("solvable", &solvable,
             "of MiniGrid-Obstacles: draw again until start and goal are connected; density counts before that");
  fields.AddChoice("collision", &collision,
                   "block: walls and balls block, lava ends the episode with reward 0; terminate: forward into "
                   "anything but an empty cell or the goal ends it with reward -1; task: as the task has it",
                   kCollisionOrTaskNames);
  fields.AddChoice("see_through_walls", &see_through_walls, "walls hide no cell of the view; task: as the task has it",
                   kSeeThroughNames);
  fields.Add("max_steps", &max_steps, "time limit [steps]; 0: Minigrid's own, 4 size^2 (FourRooms: 100)", AtLeast(0));
  fields.Add("density", &density, "of the nominal MiniGrid-Obstacles: probability of an obstacle in a free cell",
             {.low = 0, .high = 1, .high_open = true});
  return fields;
}

MinigridTask GridSettings::ApplyTo(MinigridTask task) const {
  if (task.layout != MinigridLayout::kObstacles) {
    GridSettings defaults, given = *this;
    const FieldList own = given.Fields(), plain = defaults.Fields();
    for (const char* name : {"obstacle", "placement", "solvable", "density"}) {
      if (own.Find(name, "grid").ToJson() == plain.Find(name, "grid").ToJson()) continue;
      throw UsageError(fmt::format("grid.{} is of MiniGrid-Obstacles-NxN alone, and the task is '{}'; leave it out",
                                   name, task.name));
    }
  } else {
    task.obstacle = obstacle;
    task.placement = placement;
    task.solvable = solvable;
    task.density = density;
  }
  task.observation = observation;
  task.collision = collision.value_or(task.collision);
  task.see_through_walls = see_through_walls.value_or(task.see_through_walls);
  task.max_steps = max_steps;
  return task;
}

void MinigridTask::Check() const {
  MinigridTask copy = *this;
  const FieldList fields = copy.Fields();
  const std::string where = fmt::format("task '{}'", name);
  for (const Field& field : fields.fields()) {
    const auto* number = std::get_if<int*>(&field.target);
    const auto* real = std::get_if<double*>(&field.target);
    if (number == nullptr && real == nullptr) continue;
    const double value = number != nullptr ? **number : **real;
    if (field.range.Contains(value)) continue;
    throw UsageError(fmt::format("{}: {} does not take {}; it takes a number in {}", where, field.name, value,
                                 field.range.ToString()));
  }
}

int MinigridTask::time_limit() const {
  if (max_steps > 0) return max_steps;
  return layout == MinigridLayout::kFourRooms ? 100 : 4 * size * size;
}

minigrid::Rules MinigridTask::rules() const {
  return {.max_steps = time_limit(),
          .collision_ends = collision == GridCollision::kTerminate,
          .see_through_walls = see_through_walls};
}

bool MinigridTask::moves_balls() const {
  return layout == MinigridLayout::kDynamicObstacles ||
         (layout == MinigridLayout::kObstacles && obstacle == GridObstacle::kBall);
}

bool IsMinigridTask(const std::string& name) { return name.starts_with("MiniGrid-"); }

MinigridTask FindMinigridTask(const std::string& name) {
  for (const MinigridTask& task : Tasks()) {
    if (task.name == name) return task;
  }
  if (const int size = ObstaclesSize(name); size != 0) {
    if (size >= kMinSize && size <= kMaxSize) return Obstacles(size);
    throw UsageError(fmt::format("task '{}': got size {}, wanted {} to {}", name, size, kMinSize, kMaxSize));
  }
  throw UsageError(fmt::format("unknown task '{}'{}; there are {}", name, DidYouMean(name, MinigridTaskNames()),
                               fmt::join(MinigridTaskNames(), ", ")));
}

std::vector<std::string> MinigridTaskNames() {
  std::vector<std::string> names;
  for (const MinigridTask& task : Tasks()) names.push_back(task.name);
  return names;
}

}  // namespace oted
