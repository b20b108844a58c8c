#include "oted/rl/multi_step.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "oted/base/rng.h"

namespace oted::multi_step_test {

constexpr double kGamma = 0.9;

/// s, a, s', r, discount
using Row = std::array<float, 5>;

/// A chain of states that are numbers: from t to t + 1 by action -t, for a reward that names the step.
double RewardOf(int t) { return 1 + t * t; }

class Chain {
 public:
  Chain(int n_lanes, int n_steps) : rows_(n_lanes, n_steps, kGamma, buffer_) {}
  void Step(int lane, int t, bool terminated = false) {
    const std::vector<double> s = {t + 0.0}, a = {-t + 0.0}, next = {t + 1.0};
    rows_.Add(lane, s, a, RewardOf(t), next, terminated);
  }
  void Cut(int lane) { rows_.Cut(lane); }

  std::vector<Row> Rows() const {
    std::vector<Row> rows(static_cast<size_t>(buffer_.size()));
    for (size_t i = 0; i < rows.size(); ++i)
      std::copy_n(buffer_.rows().begin() + static_cast<long>(5 * i), 5, rows[i].begin());
    return rows;
  }

 private:
  ReplayBuffer buffer_{1, 1, 100};
  MultiStepRows rows_;
};

/// The row that begins at t and ends at `end`, by its definition.
Row RowOf(int t, int end, bool terminated) {
  double reward = 0;
  for (int i = t; i < end; ++i) reward += std::pow(kGamma, i - t) * RewardOf(i);
  return {static_cast<float>(t), static_cast<float>(-t), static_cast<float>(end), static_cast<float>(reward),
          static_cast<float>(terminated ? 0 : std::pow(kGamma, end - t))};
}

void ExpectRows(const std::vector<Row>& rows, const std::vector<Row>& expected) {
  ASSERT_EQ(rows.size(), expected.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t j = 0; j < 5; ++j) EXPECT_FLOAT_EQ(rows[i][j], expected[i][j]) << "row " << i << ", number " << j;
  }
}

TEST(MultiStepRows, WithOneStepARowIsAStep) {
  Chain chain(1, 1);
  for (int t = 0; t < 3; ++t) chain.Step(0, t);
  chain.Step(0, 3, true);
  chain.Cut(0);
  ExpectRows(chain.Rows(), {RowOf(0, 1, false), RowOf(1, 2, false), RowOf(2, 3, false), RowOf(3, 4, true)});
}

TEST(MultiStepRows, ATerminatedEpisodeLeavesEveryStepARowWithoutAValueBeyond) {
  Chain chain(1, 3);
  for (int t = 0; t < 4; ++t) chain.Step(0, t);
  chain.Step(0, 4, true);
  ExpectRows(chain.Rows(),
             {RowOf(0, 3, false), RowOf(1, 4, false), RowOf(2, 5, true), RowOf(3, 5, true), RowOf(4, 5, true)});
  chain.Cut(0);
  EXPECT_EQ(chain.Rows().size(), 5u) << "nothing was open";
}

TEST(MultiStepRows, ACutEpisodeLeavesEveryStepARowThatGoesOnAtItsLastState) {
  Chain chain(1, 3);
  for (int t = 0; t < 4; ++t) chain.Step(0, t);
  chain.Cut(0);
  ExpectRows(chain.Rows(), {RowOf(0, 3, false), RowOf(1, 4, false), RowOf(2, 4, false), RowOf(3, 4, false)});
  for (int t = 10; t < 13; ++t) chain.Step(0, t);
  EXPECT_EQ(chain.Rows().size(), 5u);
  EXPECT_EQ(chain.Rows()[4][0], 10) << "no row reaches over the cut";
}

TEST(MultiStepRows, LanesDoNotMix) {
  Chain both(2, 3), alone(1, 3);
  for (int t = 0; t < 6; ++t) {
    both.Step(0, t);
    both.Step(1, 50 + t);
    alone.Step(0, t);
  }
  both.Cut(0);
  alone.Cut(0);
  std::vector<Row> of_first;
  for (const Row& row : both.Rows()) {
    if (row[0] < 50) of_first.push_back(row);
  }
  ExpectRows(of_first, alone.Rows());
}

}  // namespace oted::multi_step_test
