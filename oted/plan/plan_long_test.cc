// Ten thousand units on machines that die: none is lost, none counts twice. Prints what a unit and a look at the plan
// cost; a figure is no claim here (docs/speed.md has them).

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>

#include "oted/base/parallel.h"
#include "oted/base/rng.h"
#include "oted/base/testing.h"
#include "oted/plan/collected.h"
#include "oted/plan/plan_state.h"
#include "oted/plan/testing.h"

namespace oted {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kUnits = 10'000, kMachines = 16;
/// Of a unit's tries: the machine dies before the command writes, in the middle, or after it. A tenth is far above what
/// one would use a cluster for; units are started twice, stopped and crash besides.
constexpr double kDies = 0.1, kTwice = 0.05, kInterrupted = 0.05, kCrashes = 0.01;
const UnitPlace kPlace{"host", "cpu", "avx2"};

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Adds its name to what is there, as a command that goes on with its work: in the end each part stands once.
UnitTry Work(const PlanLine& line, const fs::path& folder, Rng& rng) {
  for (const char* part : {"first", "second"}) {
    if (rng.Uniform() < kDies / 3) throw NodeDies();
    const fs::path file = folder / part;
    if (!fs::exists(file)) WriteFileAtomically(file, line.name);
  }
  if (rng.Uniform() < kInterrupted) return Ends(130);
  if (rng.Uniform() < kCrashes) return Ends(139);
  WriteFileAtomically(folder / "result.jsonl", line.name + "\n");
  if (rng.Uniform() < kDies / 3) throw NodeDies();
  return Ends(0);
}

TEST(PlanSimulation, NoUnitIsLostOrDoneTwiceWhereMachinesDie) {
  const TestFolder folder;
  const Plan plan = CountedPlan(kUnits);
  const WorkRoot look(folder.path(), UnitOwner::Me(), std::chrono::seconds(0));
  std::atomic<int> n_tries{0}, n_deaths{0}, n_processes{0}, n_published{0};
  int n_rounds = 0;
  const Clock::time_point start = Clock::now();
  for (std::vector<int> open = StateOf(plan, look).Open(); !open.empty() && n_rounds < 50;
       open = StateOf(plan, look).Open(), ++n_rounds) {
    const RngKey key = RngKey(1).Stage("machines").Index(n_rounds);
    ParallelFor(static_cast<int>(open.size()), kMachines, [&](int k) {
      Rng rng = key.Index(k).MakeRng();
      const bool twice = rng.Uniform() < kTwice;
      const auto run = [&](const PlanLine& line, const fs::path& at, const std::function<bool()>&) {
        ++n_tries;
        return Work(line, at, rng);
      };
      for (int i = 0; i < 1 + twice; ++i) {
        const WorkRoot root(folder.path(), OwnerElsewhere(++n_processes), std::chrono::seconds(0));
        try {
          const PlanLine& line = plan.lines[static_cast<size_t>(open[static_cast<size_t>(k)])];
          if (MakeUnit(line, root, kPlace, run).outcome == UnitOutcome::kDone) ++n_published;
        } catch (const NodeDies&) {
          ++n_deaths;
        }
      }
    });
  }
  const double seconds = SecondsSince(start);
  const Clock::time_point look_start = Clock::now();
  const PlanState state = StateOf(plan, look);
  const double look_seconds = SecondsSince(look_start);
  EXPECT_TRUE(state.Complete()) << state.Count(UnitState::kFailed) << " failed";
  EXPECT_EQ(n_published, kUnits) << "each is published by one process alone";
  EXPECT_GT(n_deaths, kUnits / 20);
  const Collected collected = Collect(plan, look, false);
  ASSERT_EQ(collected.done.size(), static_cast<size_t>(kUnits));
  for (const CollectedUnit& unit : collected.done) {
    for (const char* part : {"first", "second"}) ASSERT_EQ(ReadFile(unit.folder / part), unit.line.name);
    ASSERT_EQ(ReadFile(unit.folder / "result.jsonl"), unit.line.name + "\n");
  }
  fmt::print("{} units, {} tries, {} deaths, {} rounds; {:.1f} ms a try, status {:.2f} s\n", kUnits, n_tries.load(),
             n_deaths.load(), n_rounds, 1000 * seconds / n_tries, look_seconds);
}

}  // namespace
}  // namespace oted
