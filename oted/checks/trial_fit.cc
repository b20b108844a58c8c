#include "oted/checks/trial_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/matching/prior.h"
#include "oted/stages/design/effects.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/short_windows.h"

namespace oted {
namespace {

constexpr double kTrialWindow_s = 0.1;
constexpr int kFewestSteps = 8, kMostSteps = 64;  // of a window
constexpr int kRows = 320;

}  // namespace

std::optional<TrialFit> FitBriefly(const SimulatorFactory& factory, const Dataset& logs, RngKey key,
                                   const RunContext& context, std::string_view stage) {
  const SimulatorSpec& spec = factory.spec();
  if (!spec.can_replay()) return std::nullopt;
  TrajectoriesConfig config{.rows = kRows, .starts = 1, .coarse = 16};
  if (spec.control_period_s > 0) {
    config.window =
        std::clamp(static_cast<int>(std::lround(kTrialWindow_s / spec.control_period_s)), kFewestSteps, kMostSteps);
  }
  const Prior prior = ForTrajectories(Prior::Uniform(factory.parameters().size()), factory.parameters());
  const FitProgress tell = [&](int done, int total, const Eigen::VectorXd&) {
    context.log->Progress(stage, "", done, total, "");
  };
  const ReplayProblem problem{.factory = factory,
                              .dataset = logs,
                              .prior = prior,
                              .key = key,
                              .progress = tell,
                              .context = context,
                              .judged = false};
  FitSteps steps(tell, context);
  FitEvidence evidence;
  try {
    ShortWindows windows(problem, config, 0, steps, evidence);
    windows.Fit();
    steps.Finish(windows.fit().x());
    Array2<double> information(prior.size(), prior.size(), 0.0);
    for (const StretchEvidence& stretch : windows.fit().EvidenceIn(windows.replayer(), {}, {}, {})) {
      for (int i = 0; i < prior.size(); ++i) {
        for (int k = 0; k < prior.size(); ++k) information(i, k) += stretch.information(i, k);
      }
    }
    return TrialFit{ToZ(factory.parameters(), windows.fit().x()), CosinesOf(information)};
  } catch (const DataError&) {
    return std::nullopt;  // no window can be started
  }
}

}  // namespace oted
