#include "oted/matching/grid_distribution.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr double kMostValues = 10'000;

size_t At(int i) { return static_cast<size_t>(i); }

}  // namespace

GridDistribution::GridDistribution(const ParameterSpace& space, double step) {
  for (const ParameterSpec& spec : space.specs()) {
    // A bound that is a multiple but for rounding belongs to the grid.
    const double first = std::ceil(spec.low / step - 1e-9), last = std::floor(spec.high / step + 1e-9);
    if (last - first < 1 || last - first > kMostValues) {
      throw UsageError(fmt::format(
          "design.grid_step = {:g} leaves {} values of parameter '{}' in [{:g}, {:g}], wanted 2 to {}; change the step",
          step, std::max(0.0, last - first + 1), spec.name, spec.low, spec.high, kMostValues));
    }
    std::vector<double> values;
    for (double k = first; k <= last; ++k) values.push_back(std::clamp(k * step, spec.low, spec.high));
    const size_t n = values.size();
    values_.push_back(std::move(values));
    probabilities_.emplace_back(n, 1.0 / static_cast<double>(n));
    prior_.emplace_back(n, 1.0 / static_cast<double>(n));
    low_.push_back(spec.low);
    high_.push_back(spec.high);
    step_.push_back(step);
  }
}

void GridDistribution::SetProbabilities(int i, std::vector<double> probabilities) {
  OTED_CHECK(probabilities.size() == values(i).size());
  const double sum = std::accumulate(probabilities.begin(), probabilities.end(), 0.0);
  for (double& p : probabilities) {
    OTED_CHECK(p > 0 && std::isfinite(p));
    p /= sum;
  }
  probabilities_[At(i)] = std::move(probabilities);
}

void GridDistribution::SetPrior(std::vector<std::vector<double>> probabilities) {
  if (probabilities.empty()) {
    for (const auto& v : values_) probabilities.emplace_back(v.size(), 1.0 / static_cast<double>(v.size()));
  }
  OTED_CHECK(probabilities.size() == values_.size());
  for (size_t i = 0; i < probabilities.size(); ++i) {
    OTED_CHECK(probabilities[i].size() == values_[i].size());
    const double sum = std::accumulate(probabilities[i].begin(), probabilities[i].end(), 0.0);
    for (double& p : probabilities[i]) {
      OTED_CHECK(p > 0 && std::isfinite(p));
      p /= sum;
    }
  }
  prior_ = std::move(probabilities);
}

std::vector<double> GridDistribution::PriorState() const {
  std::vector<double> state;
  for (const auto& p : prior_) state.insert(state.end(), p.begin(), p.end());
  return state;
}

std::vector<double> GridDistribution::State() const {
  std::vector<double> state;
  for (const auto& p : probabilities_) state.insert(state.end(), p.begin(), p.end());
  return state;
}

void GridDistribution::SetState(std::span<const double> state) {
  size_t at = 0;
  for (int i = 0; i < size(); ++i) {
    const size_t n = values(i).size();
    OTED_CHECK(at + n <= state.size());
    const auto begin = state.begin() + static_cast<ptrdiff_t>(at);
    probabilities_[At(i)].assign(begin, begin + static_cast<ptrdiff_t>(n));
    at += n;
  }
  OTED_CHECK(at == state.size());
}

std::vector<double> GridDistribution::Draw(Rng& rng) const { return DrawEvenly(1, rng).front(); }

std::vector<std::vector<double>> GridDistribution::DrawEvenly(int n, Rng& rng) const {
  std::vector<std::vector<double>> draws(At(n), std::vector<double>(values_.size(), 0.0));
  for (int i = 0; i < size(); ++i) {
    const std::vector<double>& p = probabilities(i);
    // The order says which values of two parameters meet.
    const std::vector<int> order = RandomPermutation(n, rng);
    const double offset = rng.Uniform();
    size_t value = 0;
    double below = p[0];
    for (int k = 0; k < n; ++k) {
      const double u = (k + offset) / n;
      while (u >= below && value + 1 < p.size()) below += p[++value];
      draws[At(order[At(k)])][At(i)] = static_cast<double>(value);
    }
  }
  return draws;
}

std::vector<double> GridDistribution::ValuesAt(std::span<const double> indices) const {
  std::vector<double> z;
  for (size_t i = 0; i < indices.size(); ++i) z.push_back(values_[i][static_cast<size_t>(indices[i])]);
  return z;
}

std::vector<double> GridDistribution::Mode() const {
  std::vector<double> mode;
  for (int i = 0; i < size(); ++i) {
    const auto& p = probabilities(i);
    mode.push_back(values(i)[static_cast<size_t>(std::max_element(p.begin(), p.end()) - p.begin())]);
  }
  return mode;
}

std::vector<double> GridDistribution::Mean() const {
  std::vector<double> mean;
  for (int i = 0; i < size(); ++i) {
    mean.push_back(std::inner_product(values(i).begin(), values(i).end(), probabilities(i).begin(), 0.0));
  }
  return mean;
}

std::vector<double> GridDistribution::Std() const {
  const std::vector<double> mean = Mean();
  std::vector<double> std;
  for (int i = 0; i < size(); ++i) {
    double variance = 0;
    for (size_t k = 0; k < values(i).size(); ++k) {
      const double deviation = values(i)[k] - mean[At(i)];
      variance += probabilities(i)[k] * deviation * deviation;
    }
    // What lies within a step of the grid cannot be told: the spread of an even distribution over it.
    std.push_back(std::sqrt(variance + step_[At(i)] * step_[At(i)] / 12));
  }
  return std;
}

double GridDistribution::Cumulative(int i, double x) const {
  const double half = 0.5 * step_[At(i)];
  double mass = 0;
  for (size_t k = 0; k < values(i).size(); ++k) {
    const double from = std::max(low_[At(i)], values(i)[k] - half), to = std::min(high_[At(i)], values(i)[k] + half);
    mass += probabilities(i)[k] * std::clamp((x - from) / (to - from), 0.0, 1.0);
  }
  return mass;
}

double GridDistribution::KlToPrior() const {
  double kl = 0;
  for (size_t i = 0; i < probabilities_.size(); ++i) {
    for (size_t k = 0; k < probabilities_[i].size(); ++k) {
      kl += probabilities_[i][k] * std::log(probabilities_[i][k] / prior_[i][k]);
    }
  }
  return kl;
}

void GridDistribution::Ascend(const std::vector<std::vector<double>>& draws, std::span<const double> advantages,
                              double lambda, double step) {
  OTED_CHECK(draws.size() == advantages.size() && !draws.empty());
  for (int i = 0; i < size(); ++i) {
    std::vector<double>& p = probabilities_[At(i)];
    const double n_values = static_cast<double>(p.size());
    std::vector<double> sum(p.size(), 0.0), count(p.size(), 0.0);
    for (size_t k = 0; k < draws.size(); ++k) {
      const size_t value = static_cast<size_t>(draws[k][At(i)]);
      sum[value] += advantages[k];
      count[value] += 1;
    }
    double kl = 0;
    const std::vector<double>& prior = prior_[At(i)];
    for (size_t k = 0; k < p.size(); ++k) kl += p[k] * std::log(p[k] / prior[k]);
    double total = 0;
    for (size_t k = 0; k < p.size(); ++k) {
      const double advantage = count[k] > 0 ? sum[k] / count[k] : 0;
      const double towards_prior = kl - std::log(p[k] / prior[k]);
      p[k] *= std::exp(std::clamp(step * (advantage + lambda * towards_prior), -1.0, 1.0));
      total += p[k];
    }
    for (double& probability : p) probability = (1 - kFloor) * probability / total + kFloor / n_values;
  }
}

}  // namespace oted
