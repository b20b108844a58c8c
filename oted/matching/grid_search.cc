#include "oted/matching/grid_search.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/bisection.h"
#include "oted/matching/gaussian_search.h"

namespace oted {

GridSearch::GridSearch(ParameterSpace space, double step)
    : space_(std::move(space)), step_(step), prior_(Prior::Uniform(space_.size())), grid_(space_, step) {}

void GridSearch::SetProbabilities(int i, std::vector<double> probabilities) {
  grid_.SetProbabilities(i, std::move(probabilities));
}

void GridSearch::SetPrior(const Prior& prior) {
  prior_ = prior;
  if (prior_.uniform) {
    grid_.SetPrior({});
    return;
  }
  if (prior_.values.empty()) {
    // The Gaussian's mass over the step around each value, and over all beyond at either end; never none at all.
    constexpr double kLeast = 1e-6;
    const GaussianSearch gaussian(space_, prior.mean, prior.Covariance());
    for (int i = 0; i < grid_.size(); ++i) {
      const std::vector<double>& at = grid_.values(i);
      std::vector<double> masses;
      double below = 0;
      for (size_t k = 0; k < at.size(); ++k) {
        const double up_to = k + 1 == at.size() ? 1.0 : gaussian.Cumulative(i, 0.5 * (at[k] + at[k + 1]));
        masses.push_back(std::max(up_to - below, kLeast));
        below = up_to;
      }
      prior_.values.push_back(std::move(masses));
    }
  }
  grid_.SetPrior(prior_.values);
}

std::vector<double> GridSearch::PriorStd() const {
  GridDistribution p = grid_;
  p.SetState(p.PriorState());
  return p.Std();
}

SearchSample GridSearch::Draw(Rng& rng) const {
  const std::vector<double> x = grid_.Draw(rng);
  return {x, grid_.ValuesAt(x)};
}

std::vector<SearchSample> GridSearch::DrawBatch(int n, Rng& rng) const {
  std::vector<SearchSample> draws;
  for (const std::vector<double>& x : grid_.DrawEvenly(n, rng)) draws.push_back({x, grid_.ValuesAt(x)});
  return draws;
}

std::vector<SearchInterval> GridSearch::CentralInterval(double mass) const {
  std::vector<SearchInterval> intervals;
  for (int i = 0; i < grid_.size(); ++i) {
    const auto quantile = [&](double p) {
      return Bisect(space_[i].low, space_[i].high, 60, [&](double z) { return grid_.Cumulative(i, z) < p; });
    };
    intervals.push_back({quantile(0.5 - 0.5 * mass), quantile(0.5 + 0.5 * mass)});
  }
  return intervals;
}

void GridSearch::Ascend(const std::vector<SearchSample>& draws, std::span<const double> advantages,
                        const AscentSteps& steps) {
  std::vector<std::vector<double>> indices;
  for (const SearchSample& draw : draws) indices.push_back(draw.x);
  grid_.Ascend(indices, advantages, steps.lambda, steps.mean);
}

void GridSearch::AddToJson(nlohmann::json& q) const {
  q["kind"] = "categorical";
  q["grid_step"] = step_;
  for (int i = 0; i < grid_.size(); ++i) {
    q["values"].push_back(grid_.values(i));
    q["probabilities"].push_back(grid_.probabilities(i));
  }
  q["prior"] = {{"kind", "uniform"}};
  if (!prior_.uniform) q["prior"] = {{"kind", "categorical"}, {"probabilities", grid_.prior()}};
}

}  // namespace oted
