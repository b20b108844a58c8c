#include "oted/stages/design/replay/start_fit.h"

#include <gtest/gtest.h>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::start_fit_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

TEST(FitStarts, FindsTheWeightedLeastSquaresStartOfALinearPlant) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 4), 0.05, RngKey(3));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 16, 1), logs);
  const std::vector<LogWindow> windows = {{0, 6, 0}, {6, 6, 0}};
  const std::vector<VectorXd> readings = {replayer.Logged(windows[0], 0), replayer.Logged(windows[1], 0)};
  const WindowLikelihood likelihood(ReadingModel::Plain(2), VectorXd::Constant(2, 0.05 * 0.05), 6);
  const VectorXd step = VectorXd::Constant(2, 1e-4);
  const FittedStarts fitted = FitStarts(replayer, readings, {windows, kTruth, likelihood, step, 6});

  // The plant is linear in its start: one solve from anywhere gives the answer.
  const auto linear = replayer.Linearize(windows, readings, kTruth, {}, {}, {step, step});
  for (size_t w = 0; w < windows.size(); ++w) {
    const MatrixXd& d = linear[w].d_start;
    const VectorXd expected = readings[w] + (d.transpose() * d).ldlt().solve(d.transpose() * linear[w].residual);
    EXPECT_LT((fitted.starts[w] - expected).norm(), 1e-6);
    EXPECT_LT((fitted.residuals[w] - replayer.Residuals(windows, {expected, expected}, kTruth)[w]).norm(), 1e-5);
  }
}

TEST(FitStarts, WithoutWindowsThereIsNothingToFit) {
  const Dataset logs = PointMassLogs(kTruth, 1);
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 16, 1), logs);
  const std::vector<LogWindow> none;
  const WindowLikelihood likelihood(ReadingModel::Plain(2), VectorXd::Ones(2), 2);
  EXPECT_TRUE(FitStarts(replayer, {}, {none, kTruth, likelihood, VectorXd::Ones(2), 3}).starts.empty());
}

}  // namespace oted::start_fit_test
