#include "oted/stages/design/replay/windows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::windows_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

struct Replayed {
  Dataset logs = PointMassLogs(kTruth, 3);
  PointMassFactory factory{{}};
  WindowReplayer replayer{factory.Make(12, 1), logs};
  // The second episode's fifth row, and one in the first.
  std::vector<LogWindow> windows = {{logs.Episodes()[1].begin + 5, 4, logs.Episodes()[1].begin}, {2, 4, 0}};
  std::vector<VectorXd> starts = {replayer.Logged(windows[0], 0), replayer.Logged(windows[1], 0)};
};

TEST(WindowReplayer, TheTrueParametersLeaveNoResidual) {
  Replayed r;
  for (const VectorXd& residual : r.replayer.Residuals(r.windows, r.starts, kTruth)) {
    ASSERT_EQ(residual.size(), 5 * 2);
    EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(WindowReplayer, ResidualsAreThoseOfTheEquationOfMotion) {
  Replayed r;
  const std::vector<double> z = {0.7, 0.9, 0};
  const VectorXd residual = r.replayer.Residuals(r.windows, r.starts, z)[0];
  double x = r.starts[0][0], v = r.starts[0][1];
  for (int t = 1; t <= 4; ++t) {
    const int row = r.windows[0].begin + t - 1;
    v = (1 - z[1]) * v + z[0] * r.logs.actions(row, 0);
    x += 0.1 * v;
    EXPECT_NEAR(residual[2 * t], r.logs.next_observations(row, 0) - x, 1e-12);
    EXPECT_NEAR(residual[2 * t + 1], r.logs.next_observations(row, 1) - v, 1e-12);
  }
}

TEST(WindowReplayer, DerivativesAreThoseOfTheEquationOfMotion) {
  Replayed r;
  const double step = 1e-6;
  std::vector<std::vector<double>> moved(3, kTruth);
  for (size_t i = 0; i < 3; ++i) moved[i][i] += step;
  const auto linear = r.replayer.Linearize(r.windows, r.starts, kTruth, moved, VectorXd::Constant(3, step),
                                           std::vector<VectorXd>(r.windows.size(), VectorXd::Constant(2, 1e-6)))[0];
  ASSERT_TRUE(linear.valid);
  // After one step: v' = (1 - damping) v + gain a, x' = x + 0.1 v'.
  const double v = r.starts[0][1], a = r.logs.actions(r.windows[0].begin, 0);
  EXPECT_NEAR(linear.d_parameters(3, 0), a, 1e-6) << "dv'/dgain";
  EXPECT_NEAR(linear.d_parameters(2, 0), 0.1 * a, 1e-6) << "dx'/dgain";
  EXPECT_NEAR(linear.d_parameters(3, 1), -v, 1e-6) << "dv'/ddamping";
  EXPECT_EQ(linear.d_parameters.col(2).cwiseAbs().maxCoeff(), 0) << "idle moves nothing";
  EXPECT_NEAR(linear.d_start(3, 1), 0.4, 1e-6) << "dv'/dv";
  EXPECT_NEAR(linear.d_start(2, 1), 0.04, 1e-6) << "dx'/dv";
  EXPECT_NEAR(linear.d_start(2, 0), 1, 1e-6) << "dx'/dx";
  EXPECT_TRUE(linear.d_start.topRows(2).isIdentity(1e-6)) << "the start itself";
}

TEST(WindowReplayer, AnyNumberOfSimulatorsGivesTheSameBytes) {
  const Dataset logs = PointMassLogs(kTruth, 3);
  const PointMassFactory factory({.diverge_beyond = 0.6});  // some replays break
  std::vector<LogWindow> windows;
  std::vector<VectorXd> starts;
  const auto with = [&](int n) {
    WindowReplayer::Simulators simulators;
    for (int i = 0; i < n; ++i) simulators.push_back(factory.Make(7, 1));
    WindowReplayer replayer(std::move(simulators), logs, ReadingModel::Of(factory.spec(), logs, {}));
    if (windows.empty()) {
      for (int begin = 0; begin + 4 <= logs.Episodes()[0].end; ++begin) windows.push_back({begin, 4, 0});
      for (const LogWindow& window : windows) starts.push_back(replayer.Guess(window));
    }
    std::vector<std::vector<double>> moved(3, kTruth);
    for (size_t i = 0; i < 3; ++i) moved[i][i] += 1e-3;
    const auto linear = replayer.Linearize(windows, starts, kTruth, moved, VectorXd::Constant(3, 1e-3),
                                           std::vector<VectorXd>(windows.size(), VectorXd::Constant(2, 1e-4)));
    return std::pair(replayer.Residuals(windows, starts, {0.7, 0.9, 0}), linear);
  };
  const auto [residuals, linear] = with(1);
  const auto [of_three, linear_of_three] = with(3);
  ASSERT_GT(windows.size(), 10u);
  EXPECT_EQ(residuals, of_three);
  int n_valid = 0;
  for (size_t w = 0; w < windows.size(); ++w) {
    ASSERT_EQ(linear[w].valid, linear_of_three[w].valid);
    n_valid += linear[w].valid;
    if (!linear[w].valid) continue;
    EXPECT_EQ(linear[w].residual, linear_of_three[w].residual);
    EXPECT_EQ(linear[w].d_parameters, linear_of_three[w].d_parameters);
    EXPECT_EQ(linear[w].d_start, linear_of_three[w].d_start);
  }
  EXPECT_GT(n_valid, 0);
  EXPECT_LT(n_valid, static_cast<int>(windows.size())) << "some break";
}

TEST(WindowReplayer, AStartThatCannotBeSetOrAReplayThatBreaksIsEmpty) {
  const Dataset logs = PointMassLogs(kTruth, 3);
  const PointMassFactory clipped({.velocity_clip = 0.5}), fragile({.diverge_beyond = 0.2});
  const LogWindow window{1, 4, 0};
  WindowReplayer replayer(clipped.Make(12, 1), logs), breaking(fragile.Make(12, 1), logs);
  EXPECT_EQ(replayer.Residuals({window}, {VectorXd::Constant(2, 0.9)}, kTruth)[0].size(), 0);
  EXPECT_EQ(breaking.Residuals({window}, {VectorXd::Constant(2, 0.9)}, kTruth)[0].size(), 0);
}

}  // namespace oted::windows_test
