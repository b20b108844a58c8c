#pragma once
/// How far a fit of many steps has come.

#include <Eigen/Dense>
#include <algorithm>

#include "oted/base/log.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

/// Counts steps and tells of them. What it is given must outlive it.
class FitSteps {
 public:
  FitSteps(const FitProgress& progress, const RunContext& context) : progress_(progress), context_(context) {}

  /// So many steps are left, at most: the bar leaps ahead where fewer are needed than could have been.
  void Expect(int n) { n_total_ = n_total_ == 0 ? n : std::min(n_total_, n_done_ + n); }

  /// Another step is done. @throws Interrupted when a stop was requested
  void Tell(const Eigen::VectorXd& x) {
    ++n_done_;
    n_total_ = std::max(n_total_, n_done_ + 1);
    progress_(n_done_, n_total_, x);
    context_.ThrowIfStopped();
  }

  /// The last step is done.
  void Finish(const Eigen::VectorXd& x) { progress_(n_done_ + 1, n_done_ + 1, x); }

 private:
  const FitProgress& progress_;
  const RunContext& context_;
  int n_done_ = 0, n_total_ = 0;
};

}  // namespace oted
