// The end of a LevelFit: the last step and its covariance, and what the windows say of parameters that are not
// searched.

#include <algorithm>
#include <cmath>
#include <utility>

#include "oted/base/picked.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Secants, in standard deviations of a coordinate given the others.
constexpr double kSecantOfX = 0.5, kSecantOfStart = 1.0;
constexpr double kLongestSecantOfX = 0.02;       // in x: half a hundredth of the range
constexpr double kLongestSecantOfStart = 0.5;    // in standard deviations of the channel's noise
constexpr double kLongestSecantOfUnread = 0.05;  // in standard deviations of the coordinate over the logs
constexpr double kHardlyTold = 0.3;              // in x: a direction with such a standard deviation
constexpr double kLongestLastStep = 3.0;         // in standard deviations of x; further, the quadratic model is a guess
constexpr int kMostLastSteps = 3;                // where that cuts it short
constexpr int kSettlingIterations = 6;           // of starts
constexpr double kUnchanged = 1e-6;              // of squared residuals over their variances: a window that stays
constexpr double kSameMinimum = 0.5;             // nats that two fits of a start may differ by

}  // namespace

LevelFit::Differences LevelFit::Secants() const {
  Differences steps = Tangents();
  const std::vector<NormalEquations> equations = Equations(linear_);
  VectorXd longest = kLongestSecantOfUnread * replayer_.readings().state_scale;
  for (int c = 0; c < variance_.size(); ++c) {
    if (replayer_.readings().IsHeld(c, 0)) longest[c] = kLongestSecantOfStart * std::sqrt(variance_[c]);
  }
  MatrixXd hessian = prior_.precision;
  for (size_t w = 0; w < equations.size(); ++w) {
    const NormalEquations& e = equations[w];
    if (!e.valid) continue;
    hessian += e.Information(e.start_start.ldlt());
    const VectorXd std = e.start_start.diagonal().cwiseSqrt().cwiseInverse();
    steps.starts[w] = (kSecantOfStart * std).cwiseMin(longest).cwiseMax(steps.starts[w]);
  }
  // Of each alone: two parameters that trade off are uncertain over lengths on which their effects bend.
  const VectorXd std = hessian.diagonal().cwiseSqrt().cwiseInverse();
  steps.x = (kSecantOfX * std).cwiseMin(kLongestSecantOfX).cwiseMax(steps.x);
  return steps;
}

std::vector<StretchEvidence> LevelFit::Evidence(const std::vector<WindowReplayer::Linearization>& linear,
                                                Eigen::Index n_parameters) const {
  const std::vector<NormalEquations> equations = Equations(linear);
  std::vector<StretchEvidence> stretches;
  for (size_t w = 0; w < equations.size(); ++w) {
    // Neighbouring windows err together: they count as one.
    if (w == 0 || level_.stretch[w] != level_.stretch[w - 1]) {
      stretches.push_back({.information = MatrixXd::Zero(n_parameters, n_parameters),
                           .score = VectorXd::Zero(n_parameters),
                           .row = level_.windows[w].begin});
    }
    const NormalEquations& e = equations[w];
    if (!e.valid) continue;
    const NormalEquations::Factor factor(e.start_start);
    stretches.back().information += e.Information(factor);
    stretches.back().score += e.Score(factor);
  }
  return stretches;
}

MatrixXd LevelFit::Finish() {
  for (int step = 1;; ++step) {
    const LastStep last = TakeLastStep();
    if (last.arrived || step == kMostLastSteps) return last.covariance;
  }
}

MatrixXd LevelFit::CovarianceOfParts() {
  Linearize(Secants());
  std::vector<StretchEvidence> evidence = Evidence(linear_, x_.size());
  for (StretchEvidence& stretch : evidence) {
    stretch.information /= readings_per_error_;
    stretch.score /= readings_per_error_;
  }
  const StretchEstimate estimate = EstimateFromParts(evidence, x_, prior_);
  return estimate.covariance + estimate.step * estimate.step.transpose();  // about x, not about the estimate
}

MatrixXd LevelFit::CovarianceOfNoise(const VectorXd& largest_noise) const {
  const VectorXd& found = sensor_variance_.size() > 0 ? sensor_variance_ : variance_;
  const VectorXd noise = found.cwiseMin(largest_noise.cwiseAbs2());
  if (sensor_variance_.size() == 0 && noise == found) {
    return EstimateFromStretches(Evidence(linear_, x_.size()), x_, prior_).inverse_information;
  }
  // The weights are those of the simulator's errors as well. What is asked is how far sensors alone move the x that
  // they lead to.
  const VectorXd precision = Likelihood().precision();
  const Eigen::Index n_unread = replayer_.readings().n_unread();
  VectorXd variance(precision.size());
  variance << noise.replicate(n_steps() + 1, 1), precision.tail(n_unread).cwiseInverse();
  const std::vector<NormalEquations> equations = Equations(linear_);
  MatrixXd information = readings_per_error_ * prior_.precision;
  MatrixXd of_noise = MatrixXd::Zero(x_.size(), x_.size());
  for (size_t w = 0; w < equations.size(); ++w) {
    const NormalEquations& e = equations[w];
    if (!e.valid) continue;
    const NormalEquations::Factor factor(e.start_start);
    information += e.Information(factor);
    // x by each number of the window, its start following.
    const MatrixXd followed = linear_[w].d_parameters - linear_[w].d_start * factor.solve(e.start_x);
    const VectorXd weighted = (weights_[w] * precision).cwiseAbs2().cwiseProduct(variance);
    of_noise += followed.transpose() * weighted.asDiagonal() * followed;
  }
  const MatrixXd inverse = information.inverse();
  return inverse * of_noise * inverse;
}

LevelFit::LastStep LevelFit::TakeLastStep() {
  Linearize(Secants());
  const StretchEstimate estimate = EstimateFromStretches(Evidence(linear_, x_.size()), x_, prior_);
  // What the logs hardly tell stays where the descent came to: over such lengths effects bend, and two parameters that
  // matter as a product would leave it.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(estimate.covariance);
  VectorXd along = axes.eigenvectors().transpose() * estimate.step;
  double length = 1;
  for (int i = 0; i < along.size(); ++i) {
    const double std = std::sqrt(axes.eigenvalues()[i]);
    if (std > kHardlyTold) along[i] = 0;
    length = std::max(length, std::abs(along[i]) / (kLongestLastStep * std));
  }
  x_ = (x_ + axes.eigenvectors() * along / length).cwiseMax(LowestX(space_)).cwiseMin(kMaxX);
  return {.covariance = estimate.covariance, .arrived = length == 1};
}

FittedStarts LevelFit::SettledIn(WindowReplayer& replayer, const std::vector<LogWindow>& windows,
                                 std::vector<VectorXd> starts, const std::vector<double>& z) const {
  const WindowLikelihood likelihood = Likelihood();
  return FitStarts(replayer, std::move(starts),
                   {windows, z, likelihood, StartSteps(), starts_are_held_ ? 0 : kSettlingIterations});
}

double LevelFit::NatsLostAt(const VectorXd& x, const VectorXd& than) const {
  return NatsIn(replayer_, ToZ(space_, x)) - NatsIn(replayer_, ToZ(space_, than));
}

double LevelFit::NatsIn(WindowReplayer& wider, const std::vector<double>& z) const {
  return CostOfWindows(SettledIn(wider, level_.starts, z).residuals) / readings_per_error_;
}

LevelFit::Gained::Gained(const LevelFit& fit, WindowReplayer& wider, const std::vector<double>& z)
    : fit_(fit),
      wider_(wider),
      replayed_(wider.Residuals(fit.level_.windows, fit.level_.starts, z)),
      settled_(fit.SettledIn(wider, fit.level_.starts, z).residuals) {}

double LevelFit::Gained::At(const std::vector<double>& value) const {
  const Level& level = fit_.level_;
  const VectorXd precision = fit_.Likelihood().precision();
  const std::vector<VectorXd> replayed = wider_.Residuals(level.windows, level.starts, value);
  const auto is_same = [&](const VectorXd& a, const VectorXd& b) {
    if (a.size() == 0 || b.size() == 0) return a.size() == b.size();  // the physics broke down
    return precision.dot((a - b).cwiseAbs2()) < kUnchanged;
  };
  // What acts at a distance alone leaves most windows as they are, and their starts.
  std::vector<size_t> changed;
  for (size_t w = 0; w < replayed.size(); ++w) {
    if (!is_same(replayed[w], replayed_[w])) changed.push_back(w);
  }
  std::vector<VectorXd> residuals = settled_;
  std::vector<VectorXd> anew =
      fit_.SettledIn(wider_, Picked(level.windows, changed), Picked(level.starts, changed), value).residuals;
  for (size_t k = 0; k < changed.size(); ++k) residuals[changed[k]] = std::move(anew[k]);
  return (fit_.CostOfWindows(settled_) - fit_.CostOfWindows(residuals)) / fit_.readings_per_error_;
}

double LevelFit::ShareAtOtherMinima(Rng& rng) const {
  const WindowLikelihood likelihood = Likelihood();
  const std::vector<NormalEquations> equations = Equations(linear_);
  const FittedStarts own = Settled(level_.starts, x_);
  std::vector<VectorXd> moved = own.starts;
  for (size_t w = 0; w < moved.size(); ++w) {
    if (!equations[w].valid || !(weights_[w] > 0)) continue;
    VectorXd draw(moved[w].size());
    for (double& number : draw) number = rng.Normal();
    // start_start is weighted; the start is as uncertain as noise makes it.
    const Eigen::LLT<MatrixXd> factor(equations[w].start_start / weights_[w]);
    if (factor.info() == Eigen::Success) moved[w] += factor.matrixU().solve(draw);
  }
  const FittedStarts again = Settled(std::move(moved), x_);
  double elsewhere = 0;
  for (size_t w = 0; w < again.residuals.size(); ++w) {
    elsewhere += std::abs(likelihood.Cost(again.residuals[w]) - likelihood.Cost(own.residuals[w])) > kSameMinimum;
  }
  return elsewhere / static_cast<double>(again.residuals.size());
}

std::vector<StretchEvidence> LevelFit::EvidenceIn(WindowReplayer& wider, const std::vector<double>& nominal,
                                                  const std::vector<double>& moved, const VectorXd& steps) const {
  const Differences secants = Secants();
  std::vector<double> z = ToZ(space_, x_);
  const auto n_x = x_.size();
  std::vector<std::vector<double>> perturbed = Perturbed(secants.x);
  for (std::vector<double>& lane : perturbed) lane.insert(lane.end(), nominal.begin(), nominal.end());
  z.insert(z.end(), nominal.begin(), nominal.end());
  VectorXd all_steps(n_x + steps.size());
  all_steps << secants.x, steps;
  for (size_t k = 0; k < moved.size(); ++k) {
    perturbed.push_back(z);
    perturbed.back()[static_cast<size_t>(n_x) + k] = moved[k];
  }
  return Evidence(wider.Linearize(level_.windows, level_.starts, z, perturbed, all_steps, secants.starts),
                  all_steps.size());
}

}  // namespace oted
