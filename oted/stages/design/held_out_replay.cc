#include "oted/stages/design/held_out_replay.h"

#include <algorithm>
#include <cmath>

#include "oted/stages/design/replay_fit.h"
#include "oted/stages/design/start_fit.h"

namespace oted {
namespace {

using Eigen::VectorXd;

constexpr int kSteps = 10;           // long enough for small differences to add up, too short for contact to be chaotic
constexpr int kRows = 960;           // logged transitions, at most
constexpr int kStartIterations = 6;  // from the reading itself
constexpr double kStartStep = 1e-5;  // of forward differences, in standard deviations of the channel

}  // namespace

HeldOutErrors ReplayHeldOut(const SimulatorFactory& factory, const Dataset& held_out,
                            const std::vector<std::vector<double>>& z, const FitEvidence& fit, RngKey key,
                            int n_threads) {
  const SimulatorSpec& spec = factory.spec();
  WindowReplayer replayer(factory.Make(WindowReplayer::LinearizationLanes(0, spec.obs_dim()), n_threads), held_out);
  HeldOutErrors errors;
  for (const Episode& episode : held_out.Episodes()) {
    errors.n_steps = std::max(errors.n_steps, std::min(kSteps, episode.size()));
  }
  Rng rng = key.MakeRng();
  std::vector<LogWindow> windows = DrawStretches(held_out, errors.n_steps, kRows, rng);
  std::erase_if(windows, [&](const LogWindow& window) { return !replayer.CanStart(window); });
  const std::vector<VectorXd> readings = LoggedStarts(replayer, windows);
  const Eigen::Map<const VectorXd> noise(fit.short_noise_std.data(), spec.obs_dim());
  const WindowLikelihood likelihood(noise.cwiseAbs2(), errors.n_steps);
  const VectorXd start_step = kStartStep * ChannelScales(held_out);
  errors.n_windows = static_cast<int>(windows.size());
  const double freedom = static_cast<double>(spec.obs_dim()) * errors.n_steps;  // beyond the start that was fitted
  for (const std::vector<double>& parameters : z) {
    const FittedStarts fitted =
        FitStarts(replayer, windows, readings, parameters, likelihood, start_step, kStartIterations);
    std::vector<double> of_windows;
    for (const VectorXd& residual : fitted.residuals) {
      double error = kBrokenDownError;
      if (residual.size() > 0) {
        error = std::sqrt(residual.cwiseAbs2().cwiseProduct(likelihood.precision()).sum() / freedom);
      }
      of_windows.push_back(std::isfinite(error) ? std::min(error, kBrokenDownError) : kBrokenDownError);
    }
    errors.of.push_back(std::move(of_windows));
  }
  return errors;
}

}  // namespace oted
