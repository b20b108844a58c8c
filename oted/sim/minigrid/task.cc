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
  task.obstacle = "ball";
  task.collision = "terminate";
  return task;
}

MinigridTask Crossing(const std::string& obstacle, int size, int n_crossings) {
  MinigridTask task;
  task.name = fmt::format("MiniGrid-{}CrossingS{}N{}-v0", obstacle == "lava" ? "Lava" : "Simple", size, n_crossings);
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
  static const std::vector<MinigridTask> tasks = {Obstacles(10),           Empty(5, false),
                                                  Empty(5, true),          Empty(6, false),
                                                  Empty(6, true),          Empty(8, false),
                                                  Empty(16, false),        Crossing("wall", 9, 1),
                                                  Crossing("wall", 9, 2),  Crossing("wall", 9, 3),
                                                  Crossing("wall", 11, 5), Crossing("lava", 9, 1),
                                                  Crossing("lava", 9, 2),  Crossing("lava", 9, 3),
                                                  Crossing("lava", 11, 5), Dynamic(5, false, 2),
                                                  Dynamic(5, true, 2),     Dynamic(6, false, 3),
                                                  Dynamic(6, true, 3),     Dynamic(8, false, 4),
                                                  Dynamic(16, false, 8),   FourRooms()};
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
                   {"view", "grid"});
  fields.AddChoice("collision", &collision,
                   "block: walls and balls block, lava ends the episode with reward 0; terminate: forward into "
                   "anything but an empty cell or the goal ends it with reward -1",
                   {"block", "terminate"});
  if (!obstacles) return fields;
  fields.Add("density", &density, "of the nominal simulator: probability of an obstacle in a free cell",
             {.low = 0, .high = 1, .high_open = true});
  fields.AddChoice("obstacle", &obstacle, "wall, lava, or balls that move one cell a step", {"wall", "lava", "ball"});
  fields.AddChoice("placement", &placement,
                   "bernoulli: each free cell with probability density; count: round(density x free cells) of them",
                   {"bernoulli", "count"});
  fields.Add("solvable", &solvable, "draw again until start and goal are connected; density is before that");
  return fields;
}

FieldList GridSettings::Fields() {
  FieldList fields("grid");
  fields.AddChoice("observation", &observation, "view: 7x7x3 around the agent; grid: the whole grid with the agent",
                   {"view", "grid"});
  fields.AddChoice("obstacle", &obstacle, "of MiniGrid-Obstacles: wall, lava, or balls that move one cell a step",
                   {"wall", "lava", "ball"});
  fields.AddChoice("placement", &placement,
                   "of MiniGrid-Obstacles: each free cell with probability density, or round(density x free cells)",
                   {"bernoulli", "count"});
  fields.Add("solvable", &solvable,
             "of MiniGrid-Obstacles: draw again until start and goal are connected; density counts before that");
  fields.AddChoice("collision", &collision,
                   "block: walls and balls block, lava ends the episode with reward 0; terminate: forward into "
                   "anything but an empty cell or the goal ends it with reward -1; task: as the task has it",
                   {"task", "block", "terminate"});
  fields.AddChoice("see_through_walls", &see_through_walls, "walls hide no cell of the view; task: as the task has it",
                   {"task", "true", "false"});
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
  if (collision != "task") task.collision = collision;
  if (see_through_walls != "task") task.see_through_walls = see_through_walls == "true";
  task.max_steps = max_steps;
  return task;
}

void MinigridTask::Check() const {
  MinigridTask copy = *this;
  const FieldList fields = copy.Fields();
  const std::string where = fmt::format("task '{}'", name);
  for (const Field& field : fields.fields()) {
    const auto* number = std::get_if<int*>(&field.target);
    const auto* text = std::get_if<std::string*>(&field.target);
    const auto* real = std::get_if<double*>(&field.target);
    const bool fits = number != nullptr ? field.range.Contains(**number)
                      : real != nullptr ? field.range.Contains(**real)
                      : text != nullptr ? std::ranges::count(field.choices, **text) == 1
                                        : true;
    if (fits) continue;
    throw UsageError(fmt::format("{}: {} does not take {}; it takes {}", where, field.name,
                                 text != nullptr     ? fmt::format("'{}'", **text)
                                 : number != nullptr ? fmt::format("{}", **number)
                                                     : fmt::format("{}", **real),
                                 text != nullptr ? fmt::format("{}", fmt::join(field.choices, " or "))
                                                 : "a number in " + field.range.ToString()));
  }
}

int MinigridTask::time_limit() const {
  if (max_steps > 0) return max_steps;
  return layout == MinigridLayout::kFourRooms ? 100 : 4 * size * size;
}

minigrid::Rules MinigridTask::rules() const {
  return {
      .max_steps = time_limit(), .collision_ends = collision == "terminate", .see_through_walls = see_through_walls};
}

bool MinigridTask::moves_balls() const {
  return layout == MinigridLayout::kDynamicObstacles || (layout == MinigridLayout::kObstacles && obstacle == "ball");
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
