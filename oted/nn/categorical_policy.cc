#include "oted/nn/categorical_policy.h"

#include <algorithm>

#include "oted/base/error.h"
#include "oted/data/npz.h"
#include "oted/nn/categorical.h"

namespace oted {
namespace {

constexpr const char* kCategoricalPrefix = "categorical";

class CategoricalActor : public PolicyActor {
 public:
  CategoricalActor(const CategoricalPolicy& policy, double noise) : policy_(&policy), noise_(noise) {}

  void Act(std::span<const double> observations, int n, ActionStreams streams, std::span<double> actions) override {
    const size_t obs_dim = static_cast<size_t>(policy_->obs_dim()), width = static_cast<size_t>(policy_->n_actions());
    OTED_CHECK(observations.size() == static_cast<size_t>(n) * obs_dim && actions.size() == static_cast<size_t>(n));
    if (n == 0) return;
    pass_.Reserve(policy_->net(), n);
    for (int i = 0; i < n; ++i) {
      pass_.Encode(policy_->net(), observations.subspan(static_cast<size_t>(i) * obs_dim, obs_dim), i);
    }
    const float* out = pass_.Forward(policy_->net());
    std::vector<float> logits(width);
    for (size_t i = 0; i < static_cast<size_t>(n); ++i) {
      std::copy_n(out + i * width, width, logits.begin());
      if (noise_ <= 0) {
        actions[i] = MostProbable(logits);
        continue;
      }
      for (float& logit : logits) logit /= static_cast<float>(noise_);
      actions[i] = SampleCategorical(logits, streams.of(static_cast<int>(i)));
    }
  }

 private:
  const CategoricalPolicy* policy_;
  double noise_;
  FeaturePass pass_;
};

}  // namespace

std::unique_ptr<PolicyActor> CategoricalPolicy::MakeActor(ActionNoise noise, double noise_scale) const {
  return std::make_unique<CategoricalActor>(*this, noise == ActionNoise::kMean ? 0.0 : noise_scale);
}

void CategoricalPolicy::Save(const std::filesystem::path& path) const {
  NpzArrays arrays;
  net_.Save(kCategoricalPrefix, arrays);
  WriteNpz(arrays, path);
}

CategoricalPolicy CategoricalPolicy::Load(const std::filesystem::path& path) { return FromArrays(ReadNpz(path), path); }

CategoricalPolicy CategoricalPolicy::FromArrays(const NpzArrays& arrays, const std::filesystem::path& path) {
  CategoricalPolicy policy;
  policy.net_ = FeatureNet::FromArrays(kCategoricalPrefix, arrays, path.string());
  return policy;
}

}  // namespace oted
