#include "oted/sim/minigrid/density_likelihood.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "oted/base/testing.h"
#include "oted/sim/minigrid/expert.h"

namespace oted::density_likelihood_test {

using minigrid::CellFact;
using minigrid::Kind;
using testing::HasSubstr;

MinigridTask Task(int size = 10, GridPlacement placement = GridPlacement::kBernoulli, bool solvable = true) {
  MinigridTask task = FindMinigridTask("MiniGrid-Obstacles-10x10");
  task.size = size;
  task.placement = placement;
  task.solvable = solvable;
  return task;
}

MinigridSimulatorFactory Factory(const MinigridTask& task) {
  return {task,
          {{.name = "density", .field = "env/density", .low = 0, .high = 0.8, .scale = ParameterScale::kAbsolute}}};
}

TEST(SeenCells, AreTheTrueOnesAndThoseThatTheViewsShowed) {
  for (const GridObstacle obstacle : {GridObstacle::kWall, GridObstacle::kLava, GridObstacle::kBall}) {
    for (const GridObservation observation : {GridObservation::kView, GridObservation::kWhole}) {
      for (const bool see_through : {false, true}) {
        MinigridTask task = Task();
        task.obstacle = obstacle;
        task.observation = observation;
        task.see_through_walls = see_through;
        const MinigridSimulatorFactory factory = Factory(task);
        // Mistakes step on lava and run into walls.
        const Dataset data = CollectMinigridDemonstrations(factory, {0.3}, MinigridMedium(0.5), 20, RngKey(1), 1);
        const auto simulator = factory.MakeMinigrid(1, 1);
        int n_known = 0;
        for (size_t i = 0; i < 20; ++i) {
          simulator->SetParameters(0, std::vector{0.3});
          Rng rng = RngKey(1).Index(i).Stage("start").MakeRng();
          simulator->Reset(0, rng);
          const std::vector<CellFact> facts = SeenCells(task, data, data.Episodes()[i]);
          for (int y = 1; y <= 8; ++y) {
            for (int x = 1; x <= 8; ++x) {
              const CellFact fact = facts[static_cast<size_t>((y - 1) * 8 + x - 1)];
              if (fact == CellFact::kUnknown) continue;
              const minigrid::Cell cell = simulator->state(0).grid.at(x, y);
              ASSERT_EQ(fact == CellFact::kFree, cell.is_empty() || cell == minigrid::kGoal) << x << ' ' << y;
              ++n_known;
            }
          }
        }
        const bool all = task.observation == GridObservation::kWhole;
        // Seven columns by the agent's row and three more of the first view are all that counts with balls.
        const bool first_view = task.obstacle == GridObstacle::kBall && !all;
        EXPECT_GE(n_known, all ? 20 * 64 : 20 * 25);
        EXPECT_LE(n_known, first_view ? 20 * (7 * 4 + 1) : 20 * 64);
      }
    }
  }
}

TEST(SeenCells, EpisodesOfAnotherTaskAreErrors) {
  const MinigridTask task = Task();
  Dataset data = CollectMinigridDemonstrations(Factory(task), {0.3}, MinigridExpert(), 1, RngKey(1), 1);
  const auto message = [&] { return MessageOf<DataError>([&] { SeenCells(task, data, data.Episodes()[0]); }); };
  data.actions(3, 0) = 2 - data.actions(3, 0);
  EXPECT_THAT(message(), HasSubstr("from their start"));
  MinigridTask whole = task;
  whole.observation = GridObservation::kWhole;
  EXPECT_THROW(SeenCells(whole, data, data.Episodes()[0]), DataError);
}

// The truth: every one of the 2^14 rooms of side 4, with its probability.
double EnumeratedLogLikelihood(const MinigridTask& task, const std::vector<CellFact>& facts, double z) {
  const auto wanted = static_cast<int>(std::lround(z * 14));
  double together = 0, possible = 0;
  for (unsigned bits = 0; bits < 1u << 14; ++bits) {
    std::vector<uint8_t> room(16, 0);
    bool agrees = true;
    for (size_t i = 1; i < 15; ++i) {
      room[i] = bits >> (i - 1) & 1;
      agrees = agrees && (facts[i] == CellFact::kUnknown || facts[i] == static_cast<CellFact>(room[i]));
    }
    if (task.solvable && !minigrid::IsSolvable(4, room)) continue;
    const int k = std::popcount(bits);
    const double p = task.placement == GridPlacement::kCount ? k == wanted : std::pow(z, k) * std::pow(1 - z, 14 - k);
    possible += p;
    together += agrees ? p : 0;
  }
  return std::log(together / possible);
}

TEST(DensityLikelihood, IsThatOfAnEnumerationOfAllRooms) {
  Rng rng(1);
  for (const GridPlacement placement : {GridPlacement::kBernoulli, GridPlacement::kCount}) {
    for (const bool solvable : {true, false}) {
      const MinigridTask task = Task(6, placement, solvable);
      DensityLikelihood likelihood(task);
      std::vector<std::vector<CellFact>> all;
      while (all.size() < 4) {
        std::vector<CellFact> facts(16, CellFact::kFree);
        for (size_t i = 1; i < 15; ++i) {
          facts[i] = rng.Uniform() < 0.5   ? CellFact::kUnknown
                     : rng.Uniform() < 0.3 ? CellFact::kObstacle
                                           : CellFact::kFree;
        }
        if (!std::isfinite(EnumeratedLogLikelihood(task, facts, 5 / 14.0))) continue;
        likelihood.Add(facts);
        all.push_back(facts);
      }
      for (const double z : {3 / 14.0, 5 / 14.0, 6 / 14.0}) {
        double wanted = 0;
        for (const auto& facts : all) wanted += EnumeratedLogLikelihood(task, facts, z);
        if (std::isinf(wanted)) {
          EXPECT_EQ(likelihood.LogLikelihood(z), wanted);
        } else {
          EXPECT_NEAR(likelihood.LogLikelihood(z), wanted, 1e-10);
        }
      }
    }
  }
}

struct Recovery {
  double mean = 0, rmse = 0, claimed = 0, nearest = 0;  // claimed: root mean square of the standard errors
};

// Estimates from `n_repeats` fresh datasets of `n_episodes` episodes.
Recovery Recover(const MinigridTask& task, double z, int n_episodes, int n_repeats, double mistakes = 0.3) {
  const MinigridSimulatorFactory factory = Factory(task);
  Recovery r;
  for (int i = 0; i < n_repeats; ++i) {
    DensityLikelihood likelihood(task);
    likelihood.Add(CollectMinigridDemonstrations(factory, {z}, MinigridMedium(mistakes), n_episodes,
                                                 RngKey(7).Index(static_cast<uint64_t>(i)), 1));
    const DensityEstimate estimate = likelihood.Maximum(0, 0.8);
    const double on_grid = likelihood.MaximumOnGrid(0, 0.8).density;
    EXPECT_NEAR(on_grid, std::round(on_grid * 20) / 20, 1e-12);
    r.mean += estimate.density / n_repeats;
    r.rmse += (estimate.density - z) * (estimate.density - z) / n_repeats;
    r.claimed += estimate.standard_error * estimate.standard_error / n_repeats;
    r.nearest += std::abs(on_grid - z) <= 0.025 + 1e-9 ? 1.0 / n_repeats : 0;
  }
  r.rmse = std::sqrt(r.rmse);
  r.claimed = std::sqrt(r.claimed);
  return r;
}

TEST(DensityLikelihood, RecoversTheDensityAndTheErrorShrinksWithTheRootOfTheNumberOfDemonstrations) {
  for (const double z : {0.10, 0.26, 0.40}) {
    const int n_repeats = 50;
    const Recovery five = Recover(Task(), z, 5, n_repeats), fifty = Recover(Task(), z, 50, n_repeats);
    EXPECT_NEAR(five.mean, z, 4 * five.rmse / std::sqrt(n_repeats)) << z;
    EXPECT_NEAR(fifty.mean, z, 4 * fifty.rmse / std::sqrt(n_repeats)) << z;
    // The error is the one that the likelihood's curvature claims; an estimate of it from 50 is good to 10 %.
    EXPECT_NEAR(five.rmse / five.claimed, 1, 0.3) << z;
    EXPECT_NEAR(fifty.rmse / fifty.claimed, 1, 0.3) << z;
    EXPECT_NEAR(five.rmse / fifty.rmse, std::sqrt(10), 1.1) << z;
    EXPECT_GT(fifty.nearest, 0.9) << z;
    EXPECT_LT(five.nearest, 0.95) << z;
  }
}

TEST(DensityLikelihood, CountsUnseenCellsThroughThePathThatThereMustBe) {
  // Episodes so short that they never show a path: without the unseen cells' part the estimate is too low.
  MinigridTask task = Task();
  task.max_steps = 6;
  const int n_repeats = 40;
  const Recovery with = Recover(task, 0.4, 50, n_repeats);
  EXPECT_NEAR(with.mean, 0.4, 4 * with.rmse / std::sqrt(n_repeats));
  EXPECT_NEAR(with.rmse / with.claimed, 1, 0.4);
  MinigridTask naive = task;
  naive.solvable = false;
  DensityLikelihood ignores(naive), counts(task);
  const Dataset data = CollectMinigridDemonstrations(Factory(task), {0.4}, MinigridMedium(), 500, RngKey(8), 1);
  ignores.Add(data);
  counts.Add(data);
  EXPECT_LT(ignores.Maximum(0, 0.8).density, 0.37);
  EXPECT_NEAR(counts.Maximum(0, 0.8).density, 0.4, 0.015);
  EXPECT_NEAR(ignores.Maximum(0, 0.8).density, static_cast<double>(ignores.n_obstacles_seen()) / ignores.n_seen(),
              1e-5);
}

TEST(DensityLikelihood, WithACountOneWholeGridTellsIt) {
  MinigridTask task = Task(10, GridPlacement::kCount);
  task.observation = GridObservation::kWhole;
  DensityLikelihood likelihood(task);
  likelihood.Add(CollectMinigridDemonstrations(Factory(task), {0.25}, MinigridExpert(), 1, RngKey(9), 1));
  EXPECT_EQ(likelihood.MaximumOnGrid(0, 0.8).density, 0.25);
  EXPECT_NEAR(likelihood.Maximum(0, 0.8).density, 16.0 / 62, 0.5 / 62 + 1e-3);
}

TEST(DensityLikelihood, RequestsThatMakeNoSenseAreErrors) {
  EXPECT_THROW(DensityLikelihood(FindMinigridTask("MiniGrid-FourRooms-v0")), UsageError);
  EXPECT_THROW(DensityLikelihood(FindMinigridTask("MiniGrid-Obstacles-16x16")), UsageError);
  DensityLikelihood likelihood(Task(6));
  EXPECT_THROW(likelihood.MaximumOnGrid(0.51, 0.54), UsageError);
  std::vector<CellFact> walled(16, CellFact::kUnknown);
  walled[1] = walled[4] = CellFact::kObstacle;
  EXPECT_THAT(MessageOf<DataError>([&] { likelihood.Add(walled); }), HasSubstr("no path can lead"));
}

}  // namespace oted::density_likelihood_test
