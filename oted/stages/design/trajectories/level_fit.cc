#include "oted/stages/design/trajectories/level_fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "oted/base/picked.h"
#include "oted/matching/designer.h"
#include "oted/stages/design/replay/kept_derivatives.h"
#include "oted/stages/design/replay/noise_estimate.h"
#include "oted/stages/design/replay/start_fit.h"
#include "oted/stages/design/trajectories/box_step.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kParameterStep = 1e-4;  // of forward differences, in x
constexpr double kLongestStep = 1.0;     // of each coordinate of x
constexpr int kAttempts = 5;
constexpr int kFewestIterations = 3;                    // the starts need them where x does not
constexpr double kSettled = 0.25;                       // of the uncertainty of x
constexpr int kRedraws = 1, kOtherStartIterations = 4;  // of other starts
constexpr double kFewestExplained = 0.3;                // of the windows, to do without the others

}  // namespace

VectorXd LowestX(const ParameterSpace& space) {
  VectorXd lowest = VectorXd::Constant(space.size(), -kMaxX);
  for (int i = 0; i < space.size(); ++i) {
    if (space[i].low == 0 && !space[i].logarithmic) lowest[i] = -kFarthestX;
  }
  return lowest;
}

Level Joined(const Level& level) {
  Level joined;
  for (size_t w = 0; w + 1 < level.windows.size(); ++w) {
    const LogWindow &a = level.windows[w], &b = level.windows[w + 1];
    if (level.stretch[w] != level.stretch[w + 1] || a.begin + a.n_steps != b.begin) continue;
    joined.windows.push_back({a.begin, a.n_steps + b.n_steps, a.episode_begin});
    joined.starts.push_back(level.starts[w]);
    joined.stretch.push_back(level.stretch[w]);
    ++w;
  }
  return joined;
}

LevelFit::LevelFit(WindowReplayer& replayer, const ParameterSpace& space, const Prior& prior, const VectorXd& scale,
                   Level level, VectorXd x)
    : replayer_(replayer),
      space_(space),
      prior_(prior),
      scale_(scale),
      level_(std::move(level)),
      x_(std::move(x)),
      damping_of_start_(level_.windows.size(), 1e-2),
      linear_(level_.windows.size()),
      kept_(level_.windows.size(), 0),
      fresh_(level_.windows.size(), 0),
      residuals_(level_.windows.size()) {}

bool LevelFit::Step() {
  Linearize(Without(kept_), Tangents());
  std::vector<NormalEquations> equations = Equations(linear_);
  WindowLikelihood likelihood = Likelihood();
  double cost = Cost(residuals_, x_);
  bool was_near = false;  // the first step from fresh derivatives was a small one
  for (int attempt = 0; attempt < kAttempts;) {
    // Where no step of x helps, the starts move alone.
    const bool starts_alone = attempt == kAttempts - 1;
    std::vector<NormalEquations::Factor> factors(equations.size());
    MatrixXd hessian = readings_per_error_ * prior_.precision;
    VectorXd gradient = -hessian * (x_ - prior_.mean);
    for (size_t w = 0; w < equations.size(); ++w) {
      const NormalEquations& e = equations[w];
      if (!e.valid) continue;
      MatrixXd damped = e.start_start;
      damped.diagonal() *= 1 + damping_of_start_[w];
      factors[w].compute(damped);
      hessian += e.Information(factors[w]);
      gradient += e.Score(factors[w]);
    }
    const VectorXd uncertainty = (readings_per_error_ * hessian.inverse().diagonal()).cwiseSqrt();
    hessian.diagonal() *= 1 + damping_;
    VectorXd change = VectorXd::Zero(x_.size());
    if (!starts_alone) {
      change = StepWithin(hessian, gradient, (LowestX(space_).array() - x_.array()).cwiseMax(-kLongestStep),
                          (kMaxX - x_.array()).cwiseMin(kLongestStep));
    }
    const VectorXd x = x_ + change;
    // What nears nothing may go on doing so: it moves no replay any more.
    const auto is_nothing = x_.array().max(x.array()) < -kMaxX;
    const bool is_small =
        !starts_alone && (is_nothing || change.cwiseAbs().array() < kSettled * uncertainty.array()).all();
    if (attempt == 0) was_near = is_small;
    std::vector<VectorXd> starts = level_.starts;
    for (size_t w = 0; w < equations.size(); ++w) {
      if (!equations[w].valid || starts_are_held_) continue;
      starts[w] += factors[w].solve(equations[w].start - equations[w].start_x * change);
    }
    std::vector<VectorXd> moved = replayer_.Residuals(level_.windows, starts, ToZ(space_, x));
    const std::vector<char> better = TakeBetterStarts(moved, x, likelihood);
    if (!starts_alone && !(Cost(moved, x) < cost)) {
      const std::vector<size_t> old = Without(fresh_);
      if (old.empty()) {
        damping_ *= 8;
        attempt = was_near ? kAttempts - 1 : attempt + 1;  // shorter steps than a small one tell nothing
      } else {
        Linearize(old, Tangents());
        equations = Equations(linear_);
        likelihood = Likelihood();
        cost = Cost(residuals_, x_);
      }
      continue;
    }
    const bool all_fresh = Without(fresh_).empty();
    for (size_t w = 0; w < moved.size(); ++w) {
      VectorXd of_start;
      if (better[w]) of_start = starts[w] - level_.starts[w];
      // Derivatives that made a start worse may do better when they are taken anew.
      kept_[w] = !starts_are_held_ && (better[w] || fresh_[w]) &&
                 ForetoldBy(linear_[w], of_start, change, moved[w], likelihood.precision());
      fresh_[w] = fresh_[w] && !better[w] && starts_alone;
      if (better[w]) level_.starts[w] = starts[w];
      residuals_[w] = linear_[w].residual = moved[w];
      linear_[w].valid = linear_[w].valid && moved[w].size() > 0;
      damping_of_start_[w] =
          better[w] ? std::max(1e-6, damping_of_start_[w] * 0.2) : std::min(1e4, damping_of_start_[w] * 6);
    }
    x_ = x;
    damping_ = std::max(1e-7, damping_ * 0.2);
    // Where derivatives of earlier starts say that x has arrived, those of the present ones are asked.
    if (is_small && !all_fresh) kept_.assign(kept_.size(), 0);
    // The cost is rough at the scale of a step that it refuses: where that was a small one, x has arrived as well.
    return (is_small || was_near) && all_fresh;
  }
  return false;
}

std::vector<char> LevelFit::TakeBetterStarts(std::vector<VectorXd>& moved, const VectorXd& x,
                                             const WindowLikelihood& likelihood) const {
  std::vector<char> better(moved.size(), 0);
  if (starts_are_held_) return better;
  std::vector<size_t> unsure;
  for (size_t w = 0; w < moved.size(); ++w) {
    const WindowReplayer::Linearization& linear = linear_[w];
    better[w] = linear.valid && residuals_[w].size() > 0 &&
                likelihood.Cost(moved[w]) < likelihood.Cost(residuals_[w] - linear.d_parameters * (x - x_));
    if (!better[w]) unsure.push_back(w);
  }
  std::vector<VectorXd> stayed =
      replayer_.Residuals(Picked(level_.windows, unsure), Picked(level_.starts, unsure), ToZ(space_, x));
  for (size_t k = 0; k < unsure.size(); ++k) {
    const size_t w = unsure[k];
    better[w] = likelihood.Cost(moved[w]) < likelihood.Cost(stayed[k]);
    if (!better[w]) moved[w] = std::move(stayed[k]);
  }
  return better;
}

void LevelFit::Descend(int n_iterations, const std::function<void(const VectorXd&)>& tell) {
  for (int i = 0; i < n_iterations; ++i) {
    const bool settled = Step();
    tell(x_);
    if (settled && i + 1 >= kFewestIterations) return;
  }
}

LevelFit LevelFit::LeavingOut(const std::vector<char>& flags) const {
  const std::vector<size_t> which = Without(flags);
  Level rest{Picked(level_.windows, which), Picked(level_.starts, which), Picked(level_.stretch, which)};
  LevelFit fit(replayer_, space_, prior_, scale_, std::move(rest), x_);
  fit.starts_are_held_ = starts_are_held_;
  fit.explained_alone_ = explained_alone_;
  fit.sensor_variance_ = sensor_variance_;
  fit.variance_ = variance_;
  for (size_t k = 0; k < which.size(); ++k) {
    const size_t w = which[k];
    fit.damping_of_start_[k] = damping_of_start_[w];
    fit.linear_[k] = linear_[w];
    fit.kept_[k] = linear_[w].valid ? 1 : 0;
    fit.fresh_[k] = fresh_[w];
    fit.residuals_[k] = residuals_[w];
  }
  fit.EstimateNoise();
  return fit;
}

LevelFit LevelFit::Sampled(int n_rows) const {
  const size_t every = std::max<size_t>(1, static_cast<size_t>(this->n_rows() / std::max(1, n_rows)));
  std::vector<char> left_out(level_.windows.size(), 1);
  for (size_t w = 0; w < left_out.size(); w += every) left_out[w] = 0;
  return LeavingOut(left_out);
}

LevelFit LevelFit::WorstExplained(int n_rows, bool explained_alone) const {
  const WindowLikelihood likelihood = Likelihood();
  std::vector<size_t> worst_first(residuals_.size());
  std::iota(worst_first.begin(), worst_first.end(), size_t{0});
  std::ranges::stable_sort(worst_first, std::ranges::greater(),
                           [&](size_t w) { return likelihood.Cost(residuals_[w]); });
  const auto n = std::min(worst_first.size(), static_cast<size_t>((n_rows + n_steps() - 1) / n_steps()));
  std::vector<char> left_out(residuals_.size(), 1);
  for (size_t k = 0; k < n; ++k) left_out[worst_first[k]] = 0;
  LevelFit worst = LeavingOut(left_out);
  worst.variance_ = variance_;  // what they leave is no noise
  worst.explained_alone_ = explained_alone;
  return worst;
}

std::optional<VectorXd> LevelFit::PredictedStart(size_t w) const {
  if (w == 0 || level_.stretch[w - 1] != level_.stretch[w] || residuals_[w - 1].size() == 0) return std::nullopt;
  const LogWindow &before = level_.windows[w - 1], &window = level_.windows[w];
  if (before.begin + before.n_steps != window.begin) return std::nullopt;
  VectorXd start = replayer_.Guess(window);
  const VectorXd seen =
      replayer_.Logged(window, 0) - residuals_[w - 1].segment(n_steps() * variance_.size(), variance_.size());
  for (int c = 0; c < seen.size(); ++c) {
    if (replayer_.readings().IsHeld(c, 0)) start[c] = seen[c];
  }
  return start;
}

bool LevelFit::TryOtherStarts(Rng& rng) {
  const WindowLikelihood likelihood = Likelihood();
  const std::vector<double> z = ToZ(space_, x_);
  bool found = false;
  for (int attempt = 0; attempt <= kRedraws; ++attempt) {
    std::vector<size_t> which;
    std::vector<LogWindow> windows;
    std::vector<VectorXd> starts;
    for (size_t w = 0; w < level_.windows.size(); ++w) {
      if (likelihood.Explains(residuals_[w])) continue;
      std::optional<VectorXd> start = PredictedStart(w);
      if (attempt > 0) {
        start = replayer_.Guess(level_.windows[w]);
        for (int c = 0; c < variance_.size(); ++c) (*start)[c] += std::sqrt(variance_[c]) * rng.Normal();
      }
      if (!start) continue;
      which.push_back(w);
      windows.push_back(level_.windows[w]);
      starts.push_back(*start);
    }
    const FittedStarts fitted =
        FitStarts(replayer_, std::move(starts), {windows, z, likelihood, StartSteps(), kOtherStartIterations});
    for (size_t k = 0; k < which.size(); ++k) {
      const size_t w = which[k];
      if (!(likelihood.Cost(fitted.residuals[k]) < likelihood.Cost(residuals_[w]))) continue;
      level_.starts[w] = fitted.starts[k];
      residuals_[w] = fitted.residuals[k];
      damping_of_start_[w] = 1e-2;
      kept_[w] = fresh_[w] = 0;
      found = true;
    }
  }
  return found;
}

void LevelFit::CountExplainedAlone() { explained_alone_ = ShareExplained() > kFewestExplained; }

double LevelFit::FinalCost() {
  EstimateNoise();
  const double of_window = Likelihood().LogScale();
  // One prior for all: how readings err differs from fit to fit.
  double cost = prior_.HalfSquare(x_) + CostOfWindows(residuals_);
  for (const VectorXd& r : residuals_) cost += r.size() > 0 ? of_window : 0;
  return cost;
}

double LevelFit::ShareExplained() const {
  const WindowLikelihood likelihood = Likelihood();
  double explained = 0;
  for (const VectorXd& residual : residuals_) explained += likelihood.Explains(residual);
  return explained / static_cast<double>(residuals_.size());
}

double LevelFit::ShareWithin(const VectorXd& tolerance) const {
  const VectorXd most = tolerance.replicate(n_steps() + 1, 1);
  double within = 0;
  for (const VectorXd& residual : residuals_) {
    within += residual.size() > 0 && (residual.head(most.size()).cwiseAbs().array() <= most.array()).all();
  }
  return within / static_cast<double>(residuals_.size());
}

double LevelFit::CostOfWindows(const std::vector<VectorXd>& residuals) const {
  double cost = 0;
  const WindowLikelihood likelihood = Likelihood();
  for (const VectorXd& residual : residuals) {
    const double of_window = likelihood.Cost(residual);
    cost += explained_alone_ ? std::min(of_window, likelihood.CostOfWorstExplained()) : of_window;
  }
  return cost;
}

LevelFit::Differences LevelFit::Tangents() const {
  const size_t n_moved = starts_are_held_ ? 0 : level_.windows.size();
  return {VectorXd::Constant(x_.size(), kParameterStep), std::vector<VectorXd>(n_moved, StartSteps())};
}

VectorXd LevelFit::StartSteps() const {
  VectorXd steps = replayer_.readings().StartStep();
  steps.head(scale_.size()) = kStartStep * scale_;
  return steps;
}

std::vector<std::vector<double>> LevelFit::Perturbed(const VectorXd& steps) const {
  std::vector<std::vector<double>> perturbed;
  for (int i = 0; i < x_.size(); ++i) {
    VectorXd moved = x_;
    moved[i] += steps[i];
    perturbed.push_back(ToZ(space_, moved));
  }
  return perturbed;
}

void LevelFit::Linearize(const Differences& steps) {
  Linearize(Without(std::vector<char>(level_.windows.size(), 0)), steps);
}

void LevelFit::Linearize(const std::vector<size_t>& which, const Differences& steps) {
  std::vector<WindowReplayer::Linearization> linear = replayer_.Linearize(
      Picked(level_.windows, which), Picked(level_.starts, which), ToZ(space_, x_), Perturbed(steps.x), steps.x,
      steps.starts.empty() ? std::vector<VectorXd>{} : Picked(steps.starts, which));
  for (size_t k = 0; k < which.size(); ++k) {
    const size_t w = which[k];
    linear_[w] = std::move(linear[k]);
    residuals_[w] = linear_[w].valid ? linear_[w].residual : VectorXd();
    kept_[w] = fresh_[w] = 1;
  }
  EstimateNoise();
}

std::vector<size_t> LevelFit::Without(const std::vector<char>& flags) {
  std::vector<size_t> which;
  for (size_t w = 0; w < flags.size(); ++w) {
    if (flags[w] == 0) which.push_back(w);
  }
  return which;
}

void LevelFit::EstimateNoise() {
  const VectorXd smallest = (kSmallestNoise * scale_.cwiseMax(1.0)).cwiseAbs2();
  std::vector<FittedWindow> fitted(linear_.size());
  for (size_t w = 0; w < linear_.size(); ++w) {
    if (linear_[w].valid) fitted[w] = {linear_[w].residual, linear_[w].d_start};
  }
  if (variance_.size() == 0) variance_ = (kNoiseGuess * scale_).cwiseAbs2();
  if (sensor_variance_.size() > 0) {
    // In units of what errors have grown to at the window's end, every reading tells of the same variance.
    const Eigen::Index n_readings = (n_steps() + 1) * variance_.size();
    const VectorXd weight =
        Likelihood().precision().head(n_readings).cwiseProduct(variance_.replicate(n_steps() + 1, 1));
    const VectorXd held = replayer_.readings().Held(n_steps()).head(n_readings);
    const VectorXd n_held = Eigen::Map<const MatrixXd>(held.data(), variance_.size(), n_steps() + 1).rowwise().sum();
    VectorXd sum = VectorXd::Zero(variance_.size());
    double n = 0;
    for (const FittedWindow& window : fitted) {
      if (window.residual.size() == 0) continue;
      const VectorXd square = window.residual.head(n_readings).cwiseAbs2().cwiseProduct(weight);
      sum += Eigen::Map<const MatrixXd>(square.data(), variance_.size(), n_steps() + 1).rowwise().sum();
      ++n;
    }
    readings_per_error_ = CorrelationTime(fitted, weight.cwiseProduct(held), variance_.size());
    // A start takes one reading's freedom of each channel.
    variance_ = sum.cwiseQuotient((n * (n_held.array() - 1)).cwiseMax(1.0).matrix()).cwiseMax(smallest);
  } else {
    variance_ = NoiseVariance(replayer_.readings(), fitted, variance_, smallest);
  }
  const WindowLikelihood likelihood = Likelihood();
  weights_.clear();
  for (const VectorXd& residual : residuals_) {
    const bool counts = !explained_alone_ || likelihood.Explains(residual);
    weights_.push_back(counts ? likelihood.Weight(residual) : 0);
  }
}

LevelFit::Spread LevelFit::OfUnread() const {
  const std::vector<int>& unread = replayer_.readings().unread;
  const auto n_unread = static_cast<Eigen::Index>(unread.size());
  Spread spread{VectorXd::Zero(n_unread), VectorXd::Zero(n_unread)};
  VectorXd squares = spread.mean;
  double n = 0;
  const std::vector<NormalEquations> equations = Equations(linear_);
  for (size_t w = 0; w < equations.size(); ++w) {
    if (!equations[w].valid || !(weights_[w] > 0)) continue;
    const VectorXd own = equations[w].start_start.inverse().diagonal() * weights_[w];
    for (Eigen::Index k = 0; k < n_unread; ++k) {
      const double start = level_.starts[w][unread[static_cast<size_t>(k)]];
      spread.mean[k] += start;
      squares[k] += start * start + own[unread[static_cast<size_t>(k)]];
    }
    ++n;
  }
  spread.mean /= std::max(n, 1.0);
  spread.std = (squares / std::max(n, 1.0) - spread.mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  return spread;
}

std::vector<LevelFit::NormalEquations> LevelFit::Equations(
    const std::vector<WindowReplayer::Linearization>& linear) const {
  const WindowLikelihood likelihood = Likelihood();
  std::vector<NormalEquations> equations(linear.size());
  for (size_t w = 0; w < linear.size(); ++w) {
    const WindowReplayer::Linearization& l = linear[w];
    if (!l.valid) continue;
    const VectorXd p = weights_[w] * likelihood.precision();
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

}  // namespace oted
