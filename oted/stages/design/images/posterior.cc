#include "oted/stages/design/images/posterior.h"

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kSweeps = 10, kModeRounds = 4, kDraws = 2000;
constexpr int kLeastEffective = 100;  // draws that a round's moments must rest on
constexpr double kWidening = 1.5;     // of the proposal's covariance: weights of its tails stay bounded
constexpr int kMostCombinations = 20'000;

/// exp(w - max w), divided by their sum.
std::vector<double> Normalised(std::vector<double> log_weights) {
  const double highest = *std::ranges::max_element(log_weights);
  double sum = 0;
  for (double& w : log_weights) sum += w = std::exp(w - highest);
  for (double& w : log_weights) w /= sum;
  return log_weights;
}

double Effective(const std::vector<double>& weights) {
  double squares = 0;
  for (const double w : weights) squares += w * w;
  return 1 / squares;
}

/// The weights, flattened by a power just below 1 until enough of them count.
std::vector<double> Tempered(const std::vector<double>& log_weights) {
  std::vector<double> weights = Normalised(log_weights);
  for (double power = 0.5; Effective(weights) < kLeastEffective && power > 1e-6; power /= 2) {
    std::vector<double> flatter = log_weights;
    for (double& w : flatter) w *= power;
    weights = Normalised(flatter);
  }
  return weights;
}

/// A Gaussian over x.
struct Moments {
  VectorXd mean;
  MatrixXd covariance;
};

/// The moments of (prior x likelihood)^power, from draws of a wider Gaussian than the last one.
Moments Refined(const Moments& last, const Prior& prior, double widening, double power,
                const LogLikelihoods& likelihoods, RngKey key) {
  const int d = static_cast<int>(last.mean.size());
  Rng rng = key.MakeRng();
  const Eigen::LLT<MatrixXd> factor(widening * last.covariance);
  MatrixXd x(kDraws, d);
  Array2<double> u(kDraws, d);
  std::vector<double> log_weights;
  for (int k = 0; k < kDraws; ++k) {
    VectorXd normal(d);
    for (double& value : normal) value = rng.Normal();
    x.row(k) = last.mean + factor.matrixL() * normal;
    for (int i = 0; i < d; ++i) u(k, i) = LogitToUnit(x(k, i));
    log_weights.push_back(0.5 * normal.squaredNorm() - power * prior.HalfSquare(x.row(k)));
  }
  const std::vector<double> values = likelihoods(u);
  for (int k = 0; k < kDraws; ++k) log_weights[static_cast<size_t>(k)] += power * values[static_cast<size_t>(k)];
  const std::vector<double> weights = Tempered(log_weights);
  Moments moments{VectorXd::Zero(d), 1e-12 * MatrixXd::Identity(d, d)};
  for (int k = 0; k < kDraws; ++k) moments.mean += weights[static_cast<size_t>(k)] * x.row(k).transpose();
  for (int k = 0; k < kDraws; ++k) {
    const VectorXd off = x.row(k).transpose() - moments.mean;
    moments.covariance += weights[static_cast<size_t>(k)] * off * off.transpose();
  }
  return moments;
}

Designer GaussianPosterior(const Designer& designer, const LogLikelihoods& likelihoods, RngKey key) {
  const Prior& prior = designer.prior();
  Moments q{prior.mean, prior.Covariance()};
  for (int round = 0; round < kSweeps; ++round) {
    q = Refined(q, prior, round == 0 ? 1.0 : kWidening, 1.0, likelihoods, key.Index(static_cast<uint64_t>(round)));
  }
  // The higher the power, the nearer the mean to the mode.
  Moments mode = q;
  for (int round = 0; round < kModeRounds; ++round) {
    mode = Refined(mode, prior, kWidening, std::pow(4.0, round + 1), likelihoods,
                   key.Stage("mode").Index(static_cast<uint64_t>(round)));
  }
  Designer posterior(designer.space(), mode.mean, q.covariance);
  posterior.SetPrior(prior);
  return posterior;
}

Designer GridPosterior(Designer grid, const LogLikelihoods& likelihoods, RngKey key) {
  const int d = grid.size();
  const auto n_values = [&](int i) { return grid.grid()->values(i).size(); };
  double n_combinations = 1;
  for (int i = 0; i < d; ++i) n_combinations *= static_cast<double>(n_values(i));
  Rng rng = key.MakeRng();
  std::vector<std::vector<size_t>> indices;
  Array2<double> u;
  for (int k = 0; k < std::min<double>(n_combinations, kMostCombinations); ++k) {
    std::vector<size_t> index;
    std::vector<double> z;
    size_t rest = static_cast<size_t>(k);
    for (int i = 0; i < d; ++i) {
      index.push_back(n_combinations > kMostCombinations ? rng.Below(n_values(i)) : rest % n_values(i));
      rest /= n_values(i);
      z.push_back(grid.grid()->values(i)[index.back()]);
    }
    indices.push_back(std::move(index));
    u.AppendRow(grid.space().ToUnit(z));
  }
  std::vector<double> log_weights = likelihoods(u);
  if (!grid.prior().uniform) {
    for (size_t k = 0; k < log_weights.size(); ++k) {
      for (size_t i = 0; i < indices[k].size(); ++i) log_weights[k] += std::log(grid.grid()->prior()[i][indices[k][i]]);
    }
  }
  const std::vector<double> weights = Normalised(log_weights);
  std::vector<double> state;
  for (int i = 0; i < d; ++i) {
    const double floor = GridDistribution::kFloor / static_cast<double>(n_values(i));
    std::vector<double> marginal(n_values(i));
    for (size_t k = 0; k < weights.size(); ++k) marginal[indices[k][static_cast<size_t>(i)]] += weights[k];
    double sum = 0;
    for (double& p : marginal) sum += p = std::max(p, floor);
    for (const double p : marginal) state.push_back(p / sum);
  }
  grid.SetState(state);
  return grid;
}

}  // namespace

Designer Posterior(const Designer& prior, const LogLikelihoods& likelihoods, RngKey key) {
  return prior.grid() == nullptr ? GaussianPosterior(prior, likelihoods, key) : GridPosterior(prior, likelihoods, key);
}

}  // namespace oted
