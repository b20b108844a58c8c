#include "oted/stages/design/replay/kept_derivatives.h"

namespace oted {

using Eigen::VectorXd;

namespace {
constexpr double kForetold = 0.2;    // of the way; what steps by old derivatives leave of an error
constexpr double kTooLittle = 0.01;  // squared error over the variances: no start is known so well
}  // namespace

bool ForetoldBy(const WindowReplayer::Linearization& before, const VectorXd& d_start, const VectorXd& d_x,
                const VectorXd& after, const VectorXd& precision) {
  if (!before.valid || after.size() != before.residual.size()) return false;
  VectorXd expected = VectorXd::Zero(after.size());
  if (d_start.size() > 0) expected += before.d_start * d_start;
  if (d_x.size() > 0) expected += before.d_parameters * d_x;
  const VectorXd missed = before.residual - expected - after;
  const double error = missed.cwiseAbs2().dot(precision);
  return error <= kTooLittle || error <= kForetold * kForetold * expected.cwiseAbs2().dot(precision);
}

}  // namespace oted
