#include "oted/sim/minigrid/solvable_grids.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::minigrid {
namespace {

// Of a room of side 4 every one of the 2^14 grids: the truth by enumeration, with a flood fill of its own.
constexpr int kSide = 4;

bool Floods(const std::vector<uint8_t>& obstacles, int side) {
  std::vector<int> stack = {0};
  std::vector<bool> seen(obstacles.size(), false);
  seen[0] = true;
  while (!stack.empty()) {
    const int at = stack.back();
    stack.pop_back();
    const auto visit = [&](int x, int y) {
      if (x < 0 || y < 0 || x >= side || y >= side) return;
      const size_t to = static_cast<size_t>(y * side + x);
      if (seen[to] || obstacles[to] != 0) return;
      seen[to] = true;
      stack.push_back(y * side + x);
    };
    const int x = at % side, y = at / side;
    visit(x + 1, y);
    visit(x - 1, y);
    visit(x, y + 1);
    visit(x, y - 1);
  }
  return seen.back();
}

std::vector<uint8_t> RoomOf(unsigned bits) {
  std::vector<uint8_t> room(kSide * kSide, 0);
  for (size_t i = 0; i < 14; ++i) room[i + 1] = bits >> i & 1;
  return room;
}

TEST(IsSolvable, IsAFloodFill) {
  int n_solvable = 0;
  for (unsigned bits = 0; bits < 1u << 14; ++bits) {
    const std::vector<uint8_t> room = RoomOf(bits);
    ASSERT_EQ(IsSolvable(kSide, room), Floods(room, kSide)) << bits;
    n_solvable += IsSolvable(kSide, room);
  }
  EXPECT_GT(n_solvable, 100);
  // A path that winds all over a large room, which needs many sweeps; and the same with one more obstacle.
  std::vector<uint8_t> snake(32 * 32, 0);
  for (size_t y = 1; y < 31; y += 2) {
    for (size_t x = 0; x < 32; ++x) snake[y * 32 + x] = x != (y % 4 == 1 ? 31u : 0u);
  }
  EXPECT_TRUE(IsSolvable(32, snake));
  snake[17 * 32 + 31] = 1;
  EXPECT_FALSE(IsSolvable(32, snake));
}

TEST(SolvableGrids, CountsAreThoseOfTheEnumeration) {
  std::vector<double> counts(15, 0.0);
  for (unsigned bits = 0; bits < 1u << 14; ++bits) {
    if (Floods(RoomOf(bits), kSide)) ++counts[static_cast<size_t>(std::popcount(bits))];
  }
  const SolvableGrids grids(kSide);
  EXPECT_EQ(grids.counts(), counts);
  // The acceptance and the realised density, from the enumeration's counts.
  const double z = 0.35;
  double accepted = 0, obstacles = 0;
  for (int k = 0; k <= 14; ++k) {
    const double p = counts[static_cast<size_t>(k)] * std::pow(z, k) * std::pow(1 - z, 14 - k);
    accepted += p;
    obstacles += p * k;
  }
  EXPECT_NEAR(grids.Acceptance(z), accepted, 1e-14);
  EXPECT_NEAR(grids.MeanRealisedDensity(z), obstacles / accepted / 14, 1e-14);
  EXPECT_EQ(grids.Acceptance(0), 1);
}

TEST(SolvableGrids, CompletionsAreThoseOfTheEnumeration) {
  const SolvableGrids grids(kSide);
  Rng rng(1);
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::vector<CellFact> facts(16, CellFact::kUnknown);
    for (size_t i = 1; i < 15; ++i) facts[i] = static_cast<CellFact>(rng.Below(3));
    facts.front() = facts.back() = CellFact::kFree;
    const size_t n_unknown = static_cast<size_t>(std::ranges::count(facts, CellFact::kUnknown));
    std::vector<double> counts(n_unknown + 1, 0.0);
    for (unsigned bits = 0; bits < 1u << 14; ++bits) {
      const std::vector<uint8_t> room = RoomOf(bits);
      size_t k = 0;
      bool fits = true;
      for (size_t i = 1; i < 15; ++i) {
        if (facts[i] == CellFact::kUnknown) {
          k += room[i];
        } else {
          fits = fits && room[i] == static_cast<uint8_t>(facts[i]);
        }
      }
      if (fits && Floods(room, kSide)) ++counts[k];
    }
    EXPECT_EQ(grids.Completions(facts), counts);
  }
}

TEST(SolvableGrids, TheRoomOfATenByTenGridHasTheAcceptanceOfRepeatedDraws) {
  const SolvableGrids& grids = SolvableGrids::Of(8);
  EXPECT_EQ(grids.n_free(), 62);
  // Every grid with one obstacle is solvable; with 50 there are too few free cells for a path of 15.
  EXPECT_EQ(grids.counts()[0], 1);
  EXPECT_EQ(grids.counts()[1], 62);
  EXPECT_GT(grids.counts()[49], 0);
  EXPECT_EQ(grids.counts()[50], 0);
  Rng rng(2);
  const int n = 20000;
  for (const double z : {0.2, 0.4}) {
    int accepted = 0;
    for (int i = 0; i < n; ++i) {
      std::vector<uint8_t> room(64, 0);
      for (size_t cell = 1; cell < 63; ++cell) room[cell] = rng.Uniform() < z;
      accepted += IsSolvable(8, room);
    }
    const double p = grids.Acceptance(z);
    EXPECT_NEAR(static_cast<double>(accepted) / n, p, 4 * std::sqrt(p * (1 - p) / n)) << z;
  }
}

TEST(SolvableGrids, DrawsHaveTheDistributionOfRejection) {
  // Side 3: 2^7 grids; the frequency of each against its exact probability.
  const SolvableGrids grids(3);
  const double z = 0.6;
  std::vector<int> drawn(128, 0);
  Rng rng(3);
  const int n = 40000;
  std::vector<uint8_t> room(9);
  for (int i = 0; i < n; ++i) {
    grids.Sample(z, rng, room);
    size_t bits = 0;
    for (size_t k = 0; k < 7; ++k) bits |= static_cast<size_t>(room[k + 1]) << k;
    ++drawn[bits];
  }
  double chi_squared = 0;
  int n_solvable = 0;
  for (size_t bits = 0; bits < 128; ++bits) {
    for (size_t k = 0; k < 7; ++k) room[k + 1] = bits >> k & 1;
    if (!Floods(room, 3)) {
      EXPECT_EQ(drawn[bits], 0);
      continue;
    }
    ++n_solvable;
    const int k = std::popcount(bits);
    const double expected = n * std::pow(z, k) * std::pow(1 - z, 7 - k) / grids.Acceptance(z);
    chi_squared += (drawn[bits] - expected) * (drawn[bits] - expected) / expected;
  }
  // Mean n - 1, standard deviation sqrt(2 (n - 1)).
  EXPECT_LT(chi_squared, n_solvable + 4 * std::sqrt(2.0 * n_solvable));
}

TEST(SolvableGrids, TooLargeARoomIsAnError) {
  EXPECT_EQ(MessageOf<UsageError>([] { SolvableGrids(11); }),
            "got a room of side 11, wanted 2 to 10: solvable rooms are counted only up to there");
}

}  // namespace
}  // namespace oted::minigrid
