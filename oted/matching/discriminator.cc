#include "oted/matching/discriminator.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/sizes.h"

namespace oted {

FieldList DiscriminatorConfig::Fields() {
  FieldList fields("design.discriminator");
  fields.Add("hidden", &hidden, "widths of g's hidden layers", LayerWidths());
  fields.Add("filters", &filters, "filters of g's 3x3 convolutions; only for images", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size for g", Above(0));
  fields.Add("weight_decay", &weight_decay, "L2 penalty on g", AtLeast(0));
  fields.Add("steps", &steps, "gradient steps on g per iteration", AtLeast(1));
  fields.Add("batch", &batch, "samples of each kind per gradient step", BatchSizes());
  return fields;
}

double MinusLogOneMinusG(double logit) { return std::max(logit, 0.0) + std::log1p(std::exp(-std::abs(logit))); }

namespace {

// A simulator that runs away shows values that no network was trained for: bounded, they still look wrong.
constexpr float kBound = 10.0f;

}  // namespace

Discriminator::Discriminator(const Array2<double>& dataset_features, const DiscriminatorConfig& config, Rng& rng,
                             const InputShape& shape)
    : net_(dataset_features, shape, {config.hidden, config.filters, true}, 1, kBound) {
  net_.Initialize(rng);
  adam_ = Adam(net_.n_parameters(), {.learning_rate = static_cast<float>(config.learning_rate),
                                     .weight_decay = static_cast<float>(config.weight_decay)});
  gradient_.resize(net_.n_parameters());
}

Discriminator::StepResult Discriminator::Step(const Array2<double>& dataset_rows,
                                              const Array2<double>& simulator_rows) {
  const int n_data = dataset_rows.rows(), n_sim = simulator_rows.rows(), n = n_data + n_sim;
  pass_.Reserve(net_, n);
  pass_.Encode(net_, dataset_rows, 0);
  pass_.Encode(net_, simulator_rows, n_data);
  const float* logits = pass_.Forward(net_);
  dout_.resize(static_cast<size_t>(n));
  StepResult result;
  for (int i = 0; i < n; ++i) {
    const bool is_data = i < n_data;
    const double scale = 1.0 / (is_data ? n_data : n_sim);
    const double g = 1.0 / (1.0 + std::exp(-static_cast<double>(logits[i])));
    // -log g = softplus(-f) and -log(1 - g) = softplus(f).
    result.loss += scale * MinusLogOneMinusG(is_data ? -logits[i] : logits[i]);
    if ((logits[i] > 0) == is_data) result.accuracy += 0.5 * scale;
    dout_[static_cast<size_t>(i)] = static_cast<float>(scale * (g - (is_data ? 1.0 : 0.0)));
  }
  pass_.Backward(net_, dout_.data(), gradient_.data());
  adam_.Step({net_.parameters().data(), gradient_.size()}, {gradient_.data(), gradient_.size()});
  return result;
}

std::vector<double> Discriminator::Logits(const Array2<double>& features) {
  if (features.rows() == 0) return {};
  pass_.Reserve(net_, features.rows());
  pass_.Encode(net_, features, 0);
  const float* logits = pass_.Forward(net_);
  return {logits, logits + features.rows()};
}

void Discriminator::Save(NpzArrays& arrays) const {
  const auto save = [&](const char* name, const AlignedVector<float>& values) {
    arrays[name] = NpyArray(std::vector<float>(values.begin(), values.end()));
  };
  Adam adam = adam_;
  save("discriminator/parameters", net_.parameters());
  save("discriminator/m", adam.m());
  save("discriminator/v", adam.v());
  arrays["discriminator/n_steps"] = NpyArray(std::vector<int64_t>{adam.n_steps()});
  net_.encoder().Save("discriminator", arrays);
}

void Discriminator::Restore(const NpzArrays& arrays, const std::string& where) {
  const auto restore = [&](const char* name, auto& values) {
    const auto found = arrays.find(name);
    if (found == arrays.end() || found->second.size() != static_cast<int64_t>(values.size())) {
      throw DataError("'" + where + "' has no fitting array '" + name + "'; remove it to make it again");
    }
    const std::vector<double> stored = found->second.ToDouble();
    using Value = std::decay_t<decltype(values[0])>;
    std::transform(stored.begin(), stored.end(), values.begin(), [](double v) { return static_cast<Value>(v); });
  };
  restore("discriminator/parameters", net_.parameters());
  restore("discriminator/m", adam_.m());
  restore("discriminator/v", adam_.v());
  std::vector<double> n_steps(1);
  restore("discriminator/n_steps", n_steps);
  adam_.n_steps() = static_cast<int64_t>(n_steps[0]);
  net_.RestoreEncoder(Encoder::Load("discriminator", arrays, where), where);
}

}  // namespace oted
