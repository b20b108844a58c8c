#include "oted/stages/design/trajectories/box_step.h"

#include <gtest/gtest.h>

#include <limits>

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const VectorXd kOne = VectorXd::Ones(2);

TEST(StepWithin, IsNewtonsStepWhereTheBoxHoldsIt) {
  const MatrixXd hessian = (MatrixXd(2, 2) << 4, 1, 1, 3).finished();
  const VectorXd gradient = (VectorXd(2) << 1, -2).finished();
  EXPECT_TRUE(StepWithin(hessian, gradient, -kOne, kOne).isApprox(hessian.inverse() * gradient, 1e-14));
}

TEST(StepWithin, TheOthersFollowACoordinateAtItsWall) {
  // By hand: alone they want (5, -2). The first stays at 1, and the second then solves 3 s = 4 - 2.
  const MatrixXd hessian = (MatrixXd(2, 2) << 2, 2, 2, 3).finished();
  const VectorXd gradient = (VectorXd(2) << 6, 4).finished();
  const VectorXd step = StepWithin(hessian, gradient, -kOne, kOne);
  EXPECT_DOUBLE_EQ(step[0], 1);
  EXPECT_DOUBLE_EQ(step[1], 2.0 / 3);
}

TEST(StepWithin, ACoordinateThatHardlyCountsHoldsNothingUp) {
  const MatrixXd hessian = (MatrixXd(2, 2) << 1e-9, 0, 0, 1).finished();
  const VectorXd gradient = (VectorXd(2) << 1, 0.5).finished();
  const VectorXd step = StepWithin(hessian, gradient, -kOne, kOne);
  EXPECT_DOUBLE_EQ(step[0], 1);
  EXPECT_DOUBLE_EQ(step[1], 0.5) << "shortened as a whole, the step would leave all but 5e-10 of it";
}

TEST(StepWithin, NowhereToGoIsNoStep) {
  const VectorXd none = VectorXd::Zero(2);
  EXPECT_EQ(StepWithin(MatrixXd::Identity(2, 2), kOne, none, none), none);
  const VectorXd nan = VectorXd::Constant(2, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(StepWithin(MatrixXd::Identity(2, 2), nan, -kOne, kOne), none);
}

}  // namespace
}  // namespace oted
