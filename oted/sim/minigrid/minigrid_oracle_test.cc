// The truth is the Python package minigrid: tests/oracle/minigrid_dump.py records its episodes, and a lane that starts
// in the same state and takes the same actions must show the same images, directions, rewards and ends. Moving balls
// take their moves from the record, since the package's random streams are not ours.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <map>
#include <sstream>

#include "oted/base/testing.h"
#include "oted/data/npz.h"
#include "oted/sim/minigrid/minigrid_simulator.h"

namespace oted::minigrid_oracle_test {

using minigrid::Cell;
using minigrid::Colour;
using minigrid::Kind;

constexpr int kStepsPerCase = 4200;

const std::vector<std::string>& Cases() {
  static const std::vector<std::string> cases = [] {
    const std::vector<std::string> worlds = {
        "MiniGrid-Empty-8x8-v0 max_steps=40",
        "MiniGrid-Empty-Random-6x6-v0",
        "MiniGrid-SimpleCrossingS9N2-v0 max_steps=90",
        "MiniGrid-SimpleCrossingS11N5-v0 observation=grid",
        "MiniGrid-LavaCrossingS9N2-v0",
        "MiniGrid-FourRooms-v0",
        "MiniGrid-Dynamic-Obstacles-8x8-v0",
        "MiniGrid-Dynamic-Obstacles-Random-6x6-v0",
        "MiniGrid-Obstacles-10x10 density=0.25 obstacle=wall collision=block",
        "MiniGrid-Obstacles-10x10 density=0.2 obstacle=lava collision=terminate",
        "MiniGrid-Obstacles-7x7 density=0.2 obstacle=ball collision=block max_steps=50",
        "Objects max_steps=200",
    };
    std::vector<std::string> all;
    for (const std::string& world : worlds) {
      for (const char* see : {"true", "false"}) all.push_back(fmt::format("{} see_through_walls={}", world, see));
    }
    return all;
  }();
  return cases;
}

// The task of a case, whose text the script reads as well.
MinigridTask TaskOf(const std::string& text) {
  std::istringstream words(text);
  std::string name, assignment;
  words >> name;
  MinigridTask task;
  if (name == "Objects") {
    task.name = name;
    task.layout = MinigridLayout::kEmpty;
  } else {
    task = FindMinigridTask(name);
  }
  const FieldList fields = task.Fields();
  while (words >> assignment) {
    const size_t equals = assignment.find('=');
    fields.Find(assignment.substr(0, equals), text).FromText(assignment.substr(equals + 1), text);
  }
  return task;
}

struct Recorded {
  std::vector<double> starts, lengths, numbers, balls, rewards, images, grids;
};

// The package's episodes of all cases, recorded once.
const Recorded& RecordOf(const std::string& text) {
  static const std::map<std::string, Recorded> records = [] {
    const TestFolder folder;
    const std::string out = folder / "episodes.npz";
    std::string command = fmt::format("'{}' '{}/tests/oracle/minigrid_dump.py' '{}' {}", OTED_TEST_PYTHON,
                                      OTED_TEST_SOURCE_DIR, out, kStepsPerCase);
    for (const std::string& each : Cases()) command += fmt::format(" '{}'", each);
    if (std::system(command.c_str()) != 0) throw std::runtime_error(command);
    const NpzArrays arrays = ReadNpz(out);
    std::map<std::string, Recorded> all;
    for (const std::string& each : Cases()) {
      const auto array = [&](const char* name) { return arrays.at(each + "/" + name).ToDouble(); };
      all[each] = {array("starts"),  array("lengths"), array("numbers"), array("balls"),
                   array("rewards"), array("images"),  array("grids")};
    }
    return all;
  }();
  return records.at(text);
}

minigrid::State StartOf(std::span<const double> cells, int size, std::span<const double> numbers,
                        std::span<const double> balls) {
  minigrid::State state;
  state.grid = minigrid::Grid(size, size);
  for (int x = 0; x < size; ++x) {
    for (int y = 0; y < size; ++y) {
      const auto number = [&](int k) { return static_cast<int>(cells[static_cast<size_t>((x * size + y) * 6 + k)]); };
      Cell cell(static_cast<Kind>(number(0)), static_cast<Colour>(number(1)), number(2));
      if (number(3) != 0) {
        cell = Cell::BoxAround(cell.colour(), Cell(static_cast<Kind>(number(3)), static_cast<Colour>(number(4))));
      }
      state.grid.at(x, y) = cell;
    }
  }
  state.direction = static_cast<int>(numbers[3]);
  state.x = static_cast<int>(numbers[4]);
  state.y = static_cast<int>(numbers[5]);
  for (size_t i = 0; i < static_cast<size_t>(numbers[6]); ++i) {
    state.balls.push_back({static_cast<int>(balls[2 * i]), static_cast<int>(balls[2 * i + 1])});
  }
  return state;
}

struct Differences {
  int observations = 0, rewards = 0, ends = 0;
  int n_steps = 0, n_goals = 0, n_penalties = 0, n_terminated = 0, n_truncated = 0, n_hidden = 0;
};

Differences Replay(const std::string& text, const MinigridTask& task) {
  const Recorded& record = RecordOf(text);
  const auto simulator = MinigridSimulatorFactory(task, {}).MakeMinigrid(1, 1);
  const std::vector<double>& images = task.observation == GridObservation::kWhole ? record.grids : record.images;
  const size_t n_rows = record.rewards.size();
  const size_t image_size = images.size() / n_rows, n_balls = record.balls.size() / n_rows;
  const size_t start_size = record.starts.size() / record.lengths.size();
  Differences d;
  size_t row = 0;
  for (size_t episode = 0; episode < record.lengths.size(); ++episode) {
    for (size_t step = 0; step < static_cast<size_t>(record.lengths[episode]); ++step, ++row) {
      const auto numbers = std::span(record.numbers).subspan(row * 7, 7);
      const auto balls = std::span(record.balls).subspan(row * n_balls, n_balls);
      if (step == 0) {
        simulator->SetState(
            0, StartOf(std::span(record.starts).subspan(episode * start_size, start_size), task.size, numbers, balls));
      } else {
        std::vector<minigrid::Position> to;
        for (size_t i = 0; i < static_cast<size_t>(numbers[6]); ++i) {
          to.push_back({static_cast<int>(balls[2 * i]), static_cast<int>(balls[2 * i + 1])});
        }
        simulator->StepWithBalls(0, static_cast<minigrid::Action>(static_cast<int>(numbers[0])), to);
        ++d.n_steps;
      }
      const auto seen = simulator->observation(0);
      const auto wanted = std::span(images).subspan(row * image_size, image_size);
      d.observations +=
          !std::equal(wanted.begin(), wanted.end(), seen.begin(), seen.end() - 1) || seen.back() != numbers[3];
      d.rewards += simulator->reward(0) != record.rewards[row];
      const LaneStatus status = numbers[1] != 0   ? LaneStatus::kTerminated
                                : numbers[2] != 0 ? LaneStatus::kTruncated
                                                  : LaneStatus::kRunning;
      d.ends += simulator->status(0) != status;
      d.n_goals += record.rewards[row] > 0;
      d.n_penalties += record.rewards[row] < 0;
      d.n_terminated += status == LaneStatus::kTerminated;
      d.n_truncated += status == LaneStatus::kTruncated;
      for (size_t i = 0; i < image_size; i += 3) d.n_hidden += wanted[i] == 0;
    }
  }
  EXPECT_EQ(row, n_rows);
  return d;
}

class MinigridOracle : public testing::TestWithParam<std::string> {};

TEST_P(MinigridOracle, ImagesDirectionsRewardsAndEndsAreThePackages) {
  const MinigridTask task = TaskOf(GetParam());
  const Differences d = Replay(GetParam(), task);
  fmt::print("{}: {} steps, {} goals, {} penalties, {} ends, {} time limits\n", GetParam(), d.n_steps, d.n_goals,
             d.n_penalties, d.n_terminated, d.n_truncated);
  EXPECT_EQ(d.observations, 0);
  EXPECT_EQ(d.rewards, 0);
  EXPECT_EQ(d.ends, 0);
  EXPECT_EQ(d.n_steps, kStepsPerCase);
  // The record holds what there is to compare: ends of all kinds, and hidden cells where walls hide.
  EXPECT_GT(d.n_terminated + d.n_truncated, 5);
  EXPECT_EQ(d.n_penalties > 0, task.collision == GridCollision::kTerminate);
  EXPECT_EQ(d.n_hidden > 0, !task.see_through_walls && task.observation == GridObservation::kView);
}

TEST(MinigridOracleRecord, ComparesAHundredThousandStepsAndTellsOtherRules) {
  EXPECT_GE(static_cast<int>(Cases().size()) * kStepsPerCase, 100'000);
  MinigridTask task = TaskOf(Cases()[8]);
  task.see_through_walls = !task.see_through_walls;
  EXPECT_GT(Replay(Cases()[8], task).observations, 1000);
  task = TaskOf(Cases()[8]);
  task.collision = GridCollision::kTerminate;
  EXPECT_GT(Replay(Cases()[8], task).rewards, 100);
}

INSTANTIATE_TEST_SUITE_P(EveryCase, MinigridOracle, testing::ValuesIn(Cases()), [](const auto& parameter) {
  std::string name = parameter.param;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
});

}  // namespace oted::minigrid_oracle_test
