#pragma once
/// What only tests of trajectory matching need.

#include "oted/base/testing.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted {

/// What trajectory matching with few rows makes of the logs of one parameter.
inline ReplayFit BriefFit(const SimulatorFactory& factory, const Dataset& logs) {
  NullSink log;
  const Prior prior = Prior::Uniform(1);
  const RunContext context{.log = &log, .n_threads = 1};
  return MatchTrajectories({factory, logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
                           {.rows = 400, .starts = 2, .coarse = 16});
}

}  // namespace oted
