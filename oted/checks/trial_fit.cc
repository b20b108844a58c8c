#include "oted/checks/trial_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/matching/prior.h"
#include "oted/stages/design/trajectories/short_windows.h"

namespace oted {
namespace {

using Eigen::MatrixXd;

constexpr double kTrialWindow_s = 0.1;
constexpr int kFewestSteps = 8, kMostSteps = 64;  // of a window
constexpr int kRows = 320;

/// Of any two columns of J, given J^T J.
Array2<double> CosinesOf(const MatrixXd& information) {
  const auto n = static_cast<int>(information.rows());
  Array2<double> cosines(n, n, 0.0);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n; ++k) {
      const double length = std::sqrt(information(i, i) * information(k, k));
      cosines(i, k) = i == k ? 1.0 : length > 0 ? information(i, k) / length : 0.0;
    }
  }
  return cosines;
}

}  // namespace

std::optional<TrialFit> FitBriefly(const SimulatorFactory& factory, const Dataset& logs, RngKey key,
                                   const RunContext& context) {
  const SimulatorSpec& spec = factory.spec();
  if (!spec.can_replay()) return std::nullopt;
  TrajectoriesConfig config{.rows = kRows, .starts = 1, .coarse = 16};
  if (spec.control_period_s > 0) {
    config.window =
        std::clamp(static_cast<int>(std::lround(kTrialWindow_s / spec.control_period_s)), kFewestSteps, kMostSteps);
  }
  const Prior prior = Prior::Uniform(factory.parameters().size());
  const FitProgress silent = [](int, int, const Eigen::VectorXd&) {};
  const ReplayProblem problem{.factory = factory,
                              .dataset = logs,
                              .prior = prior,
                              .key = key,
                              .progress = silent,
                              .context = context,
                              .judged = false};
  FitSteps steps(silent, context);
  FitEvidence evidence;
  try {
    ShortWindows windows(problem, config, 0, steps, evidence);
    windows.Fit();
    MatrixXd information = MatrixXd::Zero(prior.size(), prior.size());
    for (const StretchEvidence& stretch : windows.fit().EvidenceIn(windows.replayer(), {}, {}, 1)) {
      information += stretch.information;
    }
    return TrialFit{ToZ(factory.parameters(), windows.fit().x()), CosinesOf(information)};
  } catch (const DataError&) {
    return std::nullopt;  // no window can be started
  }
}

}  // namespace oted
