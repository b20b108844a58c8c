#include "oted/stages/design/trajectory_matching.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/matching/designer.h"
#include "oted/stages/design/noise_estimate.h"

namespace oted {
namespace {

using Eigen::LDLT;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPriorPrecision = 1.0 / (Designer::kPriorStd * Designer::kPriorStd);
constexpr double kParameterStep = 1e-4;    // of forward differences, in x
constexpr double kStartStep = 1e-5;        // of forward differences, in standard deviations of the channel
constexpr double kNoiseGuess = 0.01;       // of a channel's standard deviation, before anything is known
constexpr double kHeaviness = 0.5;         // degrees of freedom of rho, per number of a window
constexpr double kTolerableGrowth = 1.25;  // of the noise estimate from the first level to a longer one
constexpr int kFirstWindow = 2;
constexpr int kStartIterations = 5, kLevelIterations = 5;
// The noise estimate and the starts settle at the first level: stiff contacts let them move by small steps only.
constexpr int kFirstLevelIterations = 9;
constexpr int kLanes = 256;

struct Level {
  std::vector<LogWindow> windows;
  std::vector<VectorXd> starts;
  std::vector<int> stretch;  // which stretch of the log each window is part of
};

/// Everything that one level of windows needs to be fitted.
class LevelFit {
 public:
  LevelFit(WindowReplayer& replayer, const ParameterSpace& space, const VectorXd& scale, Level level, VectorXd x)
      : replayer_(replayer),
        space_(space),
        scale_(scale),
        level_(std::move(level)),
        x_(std::move(x)),
        damping_of_start_(level_.windows.size(), 1e-2) {}

  const VectorXd& x() const { return x_; }
  const Level& level() const { return level_; }
  const VectorXd& noise_variance() const { return variance_; }

  /// One Gauss-Newton step on x and all starts.
  void Step() {
    Linearize();
    const std::vector<NormalEquations> equations = Equations();
    const double cost = Cost(residuals_, x_);
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      // Where no step of x helps, the starts move alone.
      const bool starts_alone = attempt == kAttempts - 1;
      std::vector<LDLT<MatrixXd>> factors(equations.size());
      MatrixXd hessian = MatrixXd::Identity(x_.size(), x_.size()) * kPriorPrecision;
      VectorXd gradient = -kPriorPrecision * x_;
      for (size_t w = 0; w < equations.size(); ++w) {
        const NormalEquations& e = equations[w];
        if (!e.valid) continue;
        MatrixXd damped = e.start_start;
        damped.diagonal() *= 1 + damping_of_start_[w];
        factors[w].compute(damped);
        hessian += e.x_x - e.start_x.transpose() * factors[w].solve(e.start_x);
        gradient += e.x - e.start_x.transpose() * factors[w].solve(e.start);
      }
      hessian.diagonal() *= 1 + damping_;
      VectorXd step = hessian.ldlt().solve(gradient);
      if (starts_alone || !step.allFinite()) step.setZero();
      step /= std::max(1.0, step.cwiseAbs().maxCoeff());
      const VectorXd x = (x_ + step).cwiseMax(-kMaxX).cwiseMin(kMaxX);
      std::vector<VectorXd> starts = level_.starts;
      for (size_t w = 0; w < equations.size(); ++w) {
        if (equations[w].valid) starts[w] += factors[w].solve(equations[w].start - equations[w].start_x * (x - x_));
      }
      // Each window keeps the better of its two starts: one whose contact flips does not hold up the others.
      std::vector<VectorXd> moved = replayer_.Residuals(level_.windows, starts, ToZ(x));
      const std::vector<VectorXd> stayed = replayer_.Residuals(level_.windows, level_.starts, ToZ(x));
      std::vector<char> better(moved.size());
      for (size_t w = 0; w < moved.size(); ++w) {
        better[w] = WindowCost(moved[w]) < WindowCost(stayed[w]);
        if (!better[w]) moved[w] = stayed[w];
      }
      if (!starts_alone && !(Cost(moved, x) < cost)) {
        damping_ *= 8;
        continue;
      }
      x_ = x;
      for (size_t w = 0; w < moved.size(); ++w) {
        if (better[w]) level_.starts[w] = starts[w];
        damping_of_start_[w] =
            better[w] ? std::max(1e-6, damping_of_start_[w] * 0.2) : std::min(1e4, damping_of_start_[w] * 6);
      }
      damping_ = std::max(1e-7, damping_ * 0.2);
      return;
    }
  }

  /// Negative log likelihood at the present x, starts and noise; comparable between fits of the same windows.
  double FinalCost() {
    Linearize();
    double cost = Cost(residuals_, x_);
    for (const VectorXd& r : residuals_) cost += r.size() > 0 ? 0.5 * LogVariances() * n_steps() : 0;
    return cost;
  }

  /// H^-1 M H^-1, after FinalCost.
  MatrixXd Covariance() const {
    const std::vector<NormalEquations> equations = Equations();
    MatrixXd hessian = MatrixXd::Identity(x_.size(), x_.size()) * kPriorPrecision;
    MatrixXd of_scores = hessian;
    VectorXd score = VectorXd::Zero(x_.size());
    for (size_t w = 0; w < equations.size(); ++w) {
      const NormalEquations& e = equations[w];
      if (e.valid) {
        const LDLT<MatrixXd> factor(e.start_start);
        hessian += e.x_x - e.start_x.transpose() * factor.solve(e.start_x);
        score += e.x - e.start_x.transpose() * factor.solve(e.start);
      }
      // Neighbouring windows err together: their scores are summed before they are squared.
      if (w + 1 == equations.size() || level_.stretch[w + 1] != level_.stretch[w]) {
        of_scores += score * score.transpose();
        score.setZero();
      }
    }
    const MatrixXd inverse = hessian.inverse();
    return inverse * of_scores * inverse;
  }

  double ShareExplained() const {
    double explained = 0;
    for (const double weight : weights_) explained += weight > 0.3;
    return explained / static_cast<double>(weights_.size());
  }

  /// Windows of twice the length, each from two neighbours; it starts where the first of them does.
  Level Joined() const {
    Level joined;
    for (size_t w = 0; w + 1 < level_.windows.size(); ++w) {
      const LogWindow &a = level_.windows[w], &b = level_.windows[w + 1];
      if (level_.stretch[w] != level_.stretch[w + 1] || a.begin + a.n_steps != b.begin) continue;
      joined.windows.push_back({a.begin, a.n_steps + b.n_steps, a.episode_begin});
      joined.starts.push_back(level_.starts[w]);
      joined.stretch.push_back(level_.stretch[w]);
      ++w;
    }
    return joined;
  }

 private:
  static constexpr int kAttempts = 5;

  /// The quadratic model of one window's cost, weighted.
  struct NormalEquations {
    bool valid = false;
    MatrixXd start_start, start_x, x_x;
    VectorXd start, x;
  };

  int n_steps() const { return level_.windows.front().n_steps; }
  std::vector<double> ToZ(const VectorXd& x) const { return oted::ToZ(space_, x); }
  double LogVariances() const { return variance_.array().log().sum(); }

  double SquaredError(const VectorXd& residual) const {
    double error = 0;
    for (int t = 0; t <= n_steps(); ++t) {
      error += (residual.segment(t * variance_.size(), variance_.size()).array().square() / variance_.array()).sum();
    }
    return error;
  }

  /// rho. A window that broke down counts as a very bad one.
  double WindowCost(const VectorXd& residual) const {
    const double n = static_cast<double>(variance_.size()) * n_steps(), nu = kHeaviness * n;
    const double error = residual.size() == 0 ? 1e8 : SquaredError(residual);
    return 0.5 * (nu + n) * std::log1p(error / nu);
  }

  double Cost(const std::vector<VectorXd>& residuals, const VectorXd& x) const {
    double cost = 0.5 * kPriorPrecision * x.squaredNorm();
    for (const VectorXd& residual : residuals) cost += WindowCost(residual);
    return cost;
  }

  void Linearize() {
    std::vector<std::vector<double>> perturbed;
    for (int i = 0; i < x_.size(); ++i) {
      VectorXd moved = x_;
      moved[i] += kParameterStep;
      perturbed.push_back(ToZ(moved));
    }
    linear_ =
        replayer_.Linearize(level_.windows, level_.starts, ToZ(x_), perturbed, kParameterStep, kStartStep * scale_);
    residuals_.assign(linear_.size(), {});
    for (size_t w = 0; w < linear_.size(); ++w) {
      if (linear_[w].valid) residuals_[w] = linear_[w].residual;
    }
    EstimateNoise();
  }

  /// The channels' variances, and from them the windows' weights.
  void EstimateNoise() {
    const VectorXd smallest = (kSmallestNoise * scale_.cwiseMax(1.0)).cwiseAbs2();
    std::vector<FittedWindow> fitted(linear_.size());
    for (size_t w = 0; w < linear_.size(); ++w) {
      if (linear_[w].valid) fitted[w] = {linear_[w].residual, linear_[w].d_start};
    }
    if (variance_.size() == 0) variance_ = (kNoiseGuess * scale_).cwiseAbs2();
    variance_ = NoiseVariance(fitted, variance_, smallest);
    const double numbers = static_cast<double>(scale_.size()) * n_steps();
    weights_.assign(residuals_.size(), 0.0);
    for (size_t w = 0; w < residuals_.size(); ++w) {
      if (residuals_[w].size() == 0) continue;
      weights_[w] = (kHeaviness + 1) / (kHeaviness + SquaredError(residuals_[w]) / numbers);
    }
  }

  std::vector<NormalEquations> Equations() const {
    VectorXd precision((n_steps() + 1) * variance_.size());
    for (int t = 0; t <= n_steps(); ++t)
      precision.segment(t * variance_.size(), variance_.size()) = variance_.cwiseInverse();
    std::vector<NormalEquations> equations(linear_.size());
    for (size_t w = 0; w < linear_.size(); ++w) {
      const WindowReplayer::Linearization& l = linear_[w];
      if (!l.valid) continue;
      const VectorXd p = weights_[w] * precision;
      NormalEquations& e = equations[w];
      e.valid = true;
      const MatrixXd weighted_start = p.asDiagonal() * l.d_start;
      e.start_start = l.d_start.transpose() * weighted_start;
      e.start_x = weighted_start.transpose() * l.d_parameters;
      e.x_x = l.d_parameters.transpose() * (p.asDiagonal() * l.d_parameters);
      e.start = weighted_start.transpose() * l.residual;
      e.x = l.d_parameters.transpose() * p.cwiseProduct(l.residual);
    }
    return equations;
  }

  WindowReplayer& replayer_;
  const ParameterSpace& space_;
  const VectorXd& scale_;
  Level level_;
  VectorXd x_;
  std::vector<double> damping_of_start_;
  double damping_ = 1e-2;
  std::vector<WindowReplayer::Linearization> linear_;
  std::vector<VectorXd> residuals_;
  VectorXd variance_;            // of each channel's noise
  std::vector<double> weights_;  // of each window
};

/// Stretches of the log of `length` rows in a random order, until they hold `n_rows`; cut into the first level's
/// windows.
Level FirstLevel(WindowReplayer& replayer, const Dataset& dataset, int length, int n_rows, Rng& rng) {
  Level level;
  int n_stretches = 0;
  for (const LogWindow& stretch : DrawStretches(dataset, length, n_rows, rng)) {
    for (int i = stretch.begin; i + kFirstWindow <= stretch.begin + length; i += kFirstWindow) {
      const LogWindow window{i, kFirstWindow, stretch.episode_begin};
      if (!replayer.CanStart(window)) continue;
      level.windows.push_back(window);
      level.starts.push_back(replayer.Logged(window, 0));
      level.stretch.push_back(n_stretches);
    }
    ++n_stretches;
  }
  return level;
}

/// How well z explains one-step replays from the logged states: the log of each channel's error, the worst fifth of the
/// windows left out.
double CoarseCost(WindowReplayer& replayer, const Level& level, const VectorXd& scale, const std::vector<double>& z) {
  const std::vector<VectorXd> residuals = replayer.Residuals(level.windows, level.starts, z);
  double cost = 0;
  for (int c = 0; c < scale.size(); ++c) {
    std::vector<double> errors;
    for (const VectorXd& residual : residuals) {
      double error = 1e6;
      if (residual.size() > 0) {
        error = 0;
        for (int t = 1; t <= kFirstWindow; ++t) error += std::pow(residual[t * scale.size() + c] / scale[c], 2);
      }
      errors.push_back(error);
    }
    std::sort(errors.begin(), errors.end());
    errors.resize(std::max<size_t>(1, errors.size() * 4 / 5));
    cost += std::log(std::accumulate(errors.begin(), errors.end(), 1e-14) / static_cast<double>(errors.size()));
  }
  return cost;
}

/// The first `n` windows of a level.
Level Leading(const Level& level, size_t n) {
  Level part = level;
  part.windows.resize(std::min(n, level.windows.size()));
  part.starts.resize(part.windows.size());
  part.stretch.resize(part.windows.size());
  return part;
}

}  // namespace

TrajectoryFit MatchTrajectories(const SimulatorFactory& factory, const Dataset& dataset,
                                const TrajectoryOptions& options, RngKey key, const FitProgress& progress,
                                const RunContext& context) {
  const ParameterSpace& space = factory.parameters();
  const int n_parameters = space.size(), per_window = 1 + n_parameters + factory.spec().obs_dim();
  WindowReplayer replayer(factory.Make(std::max(1, kLanes / per_window) * per_window, context.n_threads), dataset);
  const VectorXd scale = ChannelScales(dataset);
  int longest = kFirstWindow;
  for (const Episode& episode : dataset.Episodes()) {
    while (longest * 2 <= std::min(options.max_window, episode.size())) longest *= 2;
  }
  Rng rng = key.MakeRng();
  const Level first = FirstLevel(replayer, dataset, longest, options.n_rows, rng);
  if (first.windows.empty()) ThrowNothingStartable(dataset, factory.spec(), kFirstWindow);
  int n_levels = 1;
  for (int length = kFirstWindow; length < longest; length *= 2) ++n_levels;
  const int n_total = options.n_starts * kStartIterations + kFirstLevelIterations + (n_levels - 1) * kLevelIterations;
  int n_done = 0;
  const auto tell = [&](const VectorXd& x) {
    progress(++n_done, n_total, x);
    context.ThrowIfStopped();
  };

  // Where to start: the prior's draws that explain single steps best, and the nominal parameters.
  const Level few = Leading(first, 40), third = Leading(first, std::max<size_t>(40, first.windows.size() / 3));
  std::vector<std::pair<double, VectorXd>> candidates;
  const VectorXd nominal = NominalStart(space);
  for (int k = 0; k < options.n_coarse; ++k) {
    VectorXd x = nominal;
    if (k > 0) {
      for (double& coordinate : x) coordinate = Designer::kPriorStd * rng.Normal();
    }
    candidates.emplace_back(CoarseCost(replayer, few, scale, ToZ(space, x)), x);
    context.ThrowIfStopped();
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  VectorXd x = candidates.front().second;
  double best = std::numeric_limits<double>::infinity();
  for (int s = 0; s < std::min(options.n_starts, options.n_coarse); ++s) {
    LevelFit fit(replayer, space, scale, third, candidates[static_cast<size_t>(s)].second);
    for (int i = 0; i < kStartIterations; ++i) {
      fit.Step();
      tell(fit.x());
    }
    const double cost = fit.FinalCost();
    if (cost < best) x = fit.x();
    best = std::min(best, cost);
  }

  // Longer and longer windows, while they are explained as well as the short ones.
  TrajectoryFit result;
  VectorXd first_noise;
  Level level = first;
  while (!level.windows.empty()) {
    LevelFit fit(replayer, space, scale, level, x);
    const int n_iterations = first_noise.size() == 0 ? kFirstLevelIterations : kLevelIterations;
    for (int i = 0; i < n_iterations; ++i) {
      fit.Step();
      tell(fit.x());
    }
    fit.FinalCost();
    const VectorXd noise = fit.noise_variance().cwiseSqrt();
    if (first_noise.size() == 0) first_noise = noise;
    const double growth = std::exp((noise.array() / first_noise.array()).log().mean());
    if (growth > kTolerableGrowth) break;
    x = fit.x();
    result = {{x, fit.Covariance(), {noise.begin(), noise.end()}}, level.windows.front().n_steps, fit.ShareExplained()};
    level = fit.Joined();
  }
  progress(n_total, n_total, x);
  return result;
}

}  // namespace oted
