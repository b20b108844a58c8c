#include "oted/stages/design/replay/held_out_replay.h"

#include <algorithm>
#include <cmath>

#include "oted/matching/as_vector.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/replay/start_fit.h"

namespace oted {
namespace {

using Eigen::VectorXd;

constexpr int kSteps = 10;         // long enough for small differences to add up, too short for contact to be chaotic
constexpr int kOverlap = 5;        // where a window begins is chance, and decides which contacts it holds
constexpr int kMostWindows = 480;  // spread evenly over the logs
constexpr int kReplayedStartIterations = 6;  // from the reading itself
constexpr double kNoticeableError = 0.01;    // of a channel's spread

std::vector<LogWindow> OverlappingWindows(const Dataset& logs, int n_steps, WindowReplayer& replayer) {
  std::vector<LogWindow> all, kept;
  for (const Episode& episode : logs.Episodes()) {
    for (int i = episode.begin; i + n_steps <= episode.end; i += std::max(1, n_steps / kOverlap)) {
      const LogWindow window{i, n_steps, episode.begin};
      if (replayer.CanStart(window)) all.push_back(window);
    }
  }
  const size_t n = std::min<size_t>(all.size(), kMostWindows);
  for (size_t k = 0; k < n; ++k) kept.push_back(all[k * all.size() / n]);
  return kept;
}

}  // namespace

HeldOutErrors ReplayHeldOut(const SimulatorFactory& factory, const Dataset& held_out,
                            const std::vector<std::vector<double>>& z, const FitEvidence& fit, int n_threads) {
  const SimulatorSpec& spec = factory.spec();
  const auto noise = AsVector(fit.short_noise_std);
  // What one method leaves out tells of none: late or computed velocities.
  const ReadingModel model = ReadingModel::Of(spec, held_out, ReadingsLeftOut(spec, held_out, noise));
  WindowReplayer replayer = MakeReplayer(factory, held_out, model, n_threads);
  HeldOutErrors errors;
  for (const Episode& episode : held_out.Episodes()) {
    errors.n_steps = std::max(errors.n_steps, std::min(kSteps, episode.size()));
  }
  const std::vector<LogWindow> windows = OverlappingWindows(held_out, errors.n_steps, replayer);
  const std::vector<VectorXd> readings = LoggedStarts(replayer, windows);
  const auto spread = AsVector(fit.scale);
  const VectorXd unit = noise.cwiseMax(kNoticeableError * spread).replicate(errors.n_steps + 1, 1);
  const WindowLikelihood likelihood(replayer.readings(), noise.cwiseAbs2(), errors.n_steps);
  const VectorXd start_step = replayer.readings().StartStep();
  const VectorXd held = replayer.readings().Held(errors.n_steps).head(unit.size());
  errors.n_windows = static_cast<int>(windows.size());
  errors.overlap = kOverlap;
  const double freedom = std::max(1.0, held.sum() - spec.state_dim());  // beyond the start that was fitted
  for (const std::vector<double>& parameters : z) {
    const FittedStarts fitted =
        FitStarts(replayer, readings, {windows, parameters, likelihood, start_step, kReplayedStartIterations});
    std::vector<double> of_windows;
    for (const VectorXd& residual : fitted.residuals) {
      double error = kBrokenDownError;
      if (residual.size() > 0) {
        error = std::sqrt(residual.head(unit.size()).cwiseProduct(held).cwiseQuotient(unit).squaredNorm() / freedom);
      }
      of_windows.push_back(std::isfinite(error) ? std::min(error, kBrokenDownError) : kBrokenDownError);
    }
    errors.of.push_back(std::move(of_windows));
  }
  return errors;
}

}  // namespace oted
