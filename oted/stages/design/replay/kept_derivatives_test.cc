#include "oted/stages/design/replay/kept_derivatives.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/sim/wrapped_simulator.h"
#include "oted/stages/design/replay/start_fit.h"

namespace oted::kept_derivatives_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of r(s, x) = 3 - 2 s - s^2 - x at s, x = 0.
WindowReplayer::Linearization AtZero() {
  return {.valid = true,
          .residual = VectorXd::Constant(1, 3),
          .d_start = MatrixXd::Constant(1, 1, 2),
          .d_parameters = MatrixXd::Constant(1, 1, 1)};
}
VectorXd Residual(double s, double x) { return VectorXd::Constant(1, 3 - 2 * s - s * s - x); }
VectorXd Of(double value) { return VectorXd::Constant(1, value); }

TEST(ForetoldBy, ShortStepsAreAndStepsThatBendByAFifthAreNot) {
  // The step is foretold as 2 s + x; s^2 is missed.
  EXPECT_TRUE(ForetoldBy(AtZero(), Of(0.39), Of(0), Residual(0.39, 0), Of(1e4)));
  EXPECT_FALSE(ForetoldBy(AtZero(), Of(0.41), Of(0), Residual(0.41, 0), Of(1e4)));
  EXPECT_TRUE(ForetoldBy(AtZero(), Of(0.41), Of(5), Residual(0.41, 5), Of(1e4))) << "beside all that moved";
  EXPECT_TRUE(ForetoldBy(AtZero(), {}, Of(5), Residual(0, 5), Of(1e4))) << "the start held";
}

TEST(ForetoldBy, WhatNoReadingShowsNeedNotBe) {
  EXPECT_TRUE(ForetoldBy(AtZero(), Of(0.9), Of(0), Residual(0.9, 0), Of(0.01))) << "0.81 of ten standard deviations";
  EXPECT_FALSE(ForetoldBy(AtZero(), Of(0.9), Of(0), Residual(0.9, 0), Of(0.02)));
}

TEST(ForetoldBy, AReplayThatBrokeDownIsNot) {
  EXPECT_FALSE(ForetoldBy(AtZero(), Of(0.1), Of(0), VectorXd(), Of(1)));
  WindowReplayer::Linearization invalid = AtZero();
  invalid.valid = false;
  EXPECT_FALSE(ForetoldBy(invalid, Of(0), Of(0), Of(3), Of(1)));
}

/// Counts the lanes that are stepped.
class Counting : public PointMass {
 public:
  Counting(int n_lanes, int& count) : PointMass(PointMassOptions{}, n_lanes, 1), count_(count) {}
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    count_ += static_cast<int>(lanes.size());
    PointMass::Step(lanes, actions);
  }

 private:
  int& count_;
};

TEST(FitStarts, AWindowOfALinearPlantIsLinearizedOnce) {
  const std::vector<double> truth = {1.5, 0.6, 0.5};
  const Dataset logs = PointMassLogs(truth, 1);
  int n_stepped = 0;
  WindowReplayer replayer(std::make_unique<Counting>(16, n_stepped), logs);
  const int n_steps = 6, n_iterations = 4, state_dim = 2;
  const std::vector<LogWindow> windows = {{0, n_steps, 0}};
  const WindowLikelihood likelihood(ReadingModel::Plain(2), VectorXd::Constant(2, 1e-6), n_steps);
  // Far off: every step still gains.
  const std::vector<VectorXd> starts = {replayer.Logged(windows[0], 0) + VectorXd::Constant(2, 3)};
  FitStarts(replayer, starts, {windows, truth, likelihood, VectorXd::Constant(2, 1e-4), n_iterations});
  // The first replay, those of the steps, and one for each derivative and their origin.
  EXPECT_LE(n_stepped, n_steps * (1 + n_iterations + 1 + state_dim));
}

}  // namespace oted::kept_derivatives_test
