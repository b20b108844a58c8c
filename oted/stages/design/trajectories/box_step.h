#pragma once
/// A Newton step that ends within a box.

#include <Eigen/Dense>

namespace oted {

/// The minimum of s' hessian s / 2 - gradient' s where low <= s <= high: a coordinate that would leave the box stays at
/// its wall, the farthest first, and the others follow that. So one that the logs hardly tell does not hold them up, as
/// it does where a whole step is shortened. A coordinate that went to its wall does not come back: the step is within
/// the box, and best there but for that.
/// @param hessian  (d, d), positive definite
/// @return 0 where the quadratic has no minimum in numbers
Eigen::VectorXd StepWithin(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient, const Eigen::VectorXd& low,
                           const Eigen::VectorXd& high);

}  // namespace oted
