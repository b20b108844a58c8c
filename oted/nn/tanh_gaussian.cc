#include "oted/nn/tanh_gaussian.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/data/npz.h"

namespace oted {
namespace {

/// Whether a file's arrays describe a policy; decided before anything is allocated by their word.
bool IsSound(const std::vector<double>& hidden, const Normalizer& normalizer, const std::vector<double>& low,
             const std::vector<double>& high, const std::vector<double>& parameters) {
  const auto finite = [](double v) { return std::isfinite(v); };
  for (const auto* values : {&normalizer.mean, &normalizer.scale, &low, &high, &parameters}) {
    if (values->empty() || !std::all_of(values->begin(), values->end(), finite)) return false;
  }
  if (normalizer.scale.size() != normalizer.mean.size() || high.size() != low.size()) return false;
  for (const double scale : normalizer.scale) {
    if (scale <= 0) return false;
  }
  for (size_t j = 0; j < low.size(); ++j) {
    if (low[j] >= high[j]) return false;
  }
  double in = static_cast<double>(normalizer.mean.size()), n_parameters = 0;
  std::vector<double> widths = hidden;
  widths.push_back(2.0 * static_cast<double>(low.size()));
  for (const double width : widths) {
    if (!(width >= 1 && width == std::floor(width))) return false;
    n_parameters += (in + 1) * width;
    in = width;
  }
  return n_parameters == static_cast<double>(parameters.size());
}

}  // namespace

TanhGaussianPolicy::TanhGaussianPolicy(Normalizer normalizer, const std::vector<int>& hidden,
                                       std::vector<double> action_low, std::vector<double> action_high)
    : normalizer_(std::move(normalizer)),
      net_(static_cast<int>(normalizer_.mean.size()), hidden, 2 * static_cast<int>(action_low.size())),
      low_(std::move(action_low)),
      high_(std::move(action_high)) {}

void TanhGaussianPolicy::NormalizeObservations(std::span<const double> observations, std::span<float> out) const {
  const size_t width = normalizer_.mean.size();
  OTED_CHECK(observations.size() == out.size() && observations.size() % width == 0);
  for (size_t i = 0; i < observations.size(); i += width) {
    normalizer_.Apply(observations.subspan(i, width), out.subspan(i, width));
  }
}

double TanhGaussianPolicy::SquashAction(double u, int dim) const {
  const double low = low_[static_cast<size_t>(dim)], high = high_[static_cast<size_t>(dim)];
  return 0.5 * (low + high) + 0.5 * (high - low) * std::tanh(u);
}

double TanhGaussianPolicy::UnsquashAction(double a, int dim) const {
  const double low = low_[static_cast<size_t>(dim)], high = high_[static_cast<size_t>(dim)];
  constexpr double kInside = 1.0 - 1e-5;  // |u| <= 6.1: a clipped action is likely, not infinitely surprising
  const double squashed = std::clamp((2.0 * a - low - high) / (high - low), -kInside, kInside);
  return std::atanh(squashed);
}

void TanhGaussianPolicy::Save(const std::filesystem::path& path) const {
  NpzArrays arrays;
  const auto& p = net_.parameters();
  arrays["parameters"] = NpyArray(std::vector<float>(p.begin(), p.end()));
  const std::vector<int> hidden = net_.hidden();
  arrays["hidden"] = NpyArray(std::vector<int64_t>(hidden.begin(), hidden.end()));
  arrays["observation_mean"] = NpyArray(normalizer_.mean);
  arrays["observation_scale"] = NpyArray(normalizer_.scale);
  arrays["action_low"] = NpyArray(low_);
  arrays["action_high"] = NpyArray(high_);
  WriteNpz(arrays, path);
}

TanhGaussianPolicy TanhGaussianPolicy::Load(const std::filesystem::path& path) {
  return FromArrays(ReadNpz(path), path);
}

TanhGaussianPolicy TanhGaussianPolicy::FromArrays(const NpzArrays& arrays, const std::filesystem::path& path) {
  const auto get = [&](const char* name) {
    const auto found = arrays.find(name);
    if (found == arrays.end()) {
      throw DataError("'" + path.string() + "' is not a policy of this program: it has no array '" + name +
                      "'; name a policy.npz from a run directory");
    }
    return found->second.ToDouble();
  };
  const std::vector<double> hidden = get("hidden"), parameters = get("parameters");
  const Normalizer normalizer{get("observation_mean"), get("observation_scale")};
  const std::vector<double> low = get("action_low"), high = get("action_high");
  if (!IsSound(hidden, normalizer, low, high, parameters)) {
    throw DataError("the arrays of policy '" + path.string() +
                    "' do not fit together or hold values that are no numbers; the file is damaged, make it again");
  }
  TanhGaussianPolicy policy(normalizer, std::vector<int>(hidden.begin(), hidden.end()), low, high);
  std::transform(parameters.begin(), parameters.end(), policy.net_.parameters().begin(),
                 [](double v) { return static_cast<float>(v); });
  return policy;
}

std::unique_ptr<PolicyActor> TanhGaussianPolicy::MakeActor(ActionNoise noise, double noise_scale) const {
  return std::make_unique<PolicyRunner>(*this, noise, noise_scale);
}

void PolicyRunner::Act(std::span<const double> observations, int n, ActionStreams streams, std::span<double> actions) {
  const int act_dim = policy_->act_dim();
  OTED_CHECK(actions.size() == static_cast<size_t>(n) * static_cast<size_t>(act_dim));
  input_.resize(observations.size());
  policy_->NormalizeObservations(observations, {input_.data(), input_.size()});
  const float* out = pass_.Forward(policy_->net(), input_.data(), n);
  for (int i = 0; i < n; ++i, out += 2 * act_dim) {
    for (int j = 0; j < act_dim; ++j) {
      double u = out[j];
      if (noise_ == ActionNoise::kSampled) {
        const double log_std = std::clamp(out[act_dim + j], kLogStdMin, kLogStdMax);
        u += noise_scale_ * std::exp(log_std) * streams.of(i).Normal();
      }
      actions[static_cast<size_t>(i * act_dim + j)] = policy_->SquashAction(u, j);
    }
  }
}

}  // namespace oted
