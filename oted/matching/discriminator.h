#pragma once
/// The discriminator g of the paper (Eq. 2): tells transitions of the dataset D from the simulator's.

#include <filesystem>
#include <span>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/rng.h"
#include "oted/data/npz.h"
#include "oted/matching/experience.h"
#include "oted/nn/feature_net.h"

namespace oted {

struct DiscriminatorConfig {
  std::vector<int> hidden = {256, 256};
  std::vector<int> filters = {16};  ///< of each 3x3 convolution where the features hold an image, means over its places
  double learning_rate = 3e-4;
  double weight_decay = 1e-4;
  int steps = 60;   ///< gradient steps per iteration
  int batch = 256;  ///< samples of each kind per gradient step
  /// [design.discriminator]
  FieldList Fields();
};

/// g(x) = sigmoid(f(x)) on features x of Experience: (s, a) or (s, a, s' - s), normalised, or with convolutions where s
/// is an image.
class Discriminator {
 public:
  Discriminator() = default;
  /// The normaliser is fitted on the dataset's features.
  /// @param shape  what the features are (FeatureShape); by default: quantities
  Discriminator(const Array2<double>& dataset_features, const DiscriminatorConfig& config, Rng& rng,
                const InputShape& shape = {});

  /// One step on Eq. 2: E_sim[-log(1 - g)] + E_D[-log g], on mini-batches drawn by the caller: rows of raw features.
  struct StepResult {
    double loss = 0;      ///< Eq. 2 before the step: 2 log 2 when g is blind
    double accuracy = 0;  ///< share of rows on the right side of g = 1/2, mean over both kinds: 1/2 when g is blind
  };
  StepResult Step(const Array2<double>& dataset_rows, const Array2<double>& simulator_rows);

  /// f(x) = log g(x) - log(1 - g(x)) of each row.
  std::vector<double> Logits(const Array2<double>& features);

  void Save(NpzArrays& arrays) const;
  void Restore(const NpzArrays& arrays, const std::string& where);

 private:
  FeatureNet net_;
  Adam adam_;
  FeaturePass pass_;
  AlignedVector<float> dout_, gradient_;
};

/// The reward of Algorithm 1, line 2: -log(1 - g), from g's logit. log 2 at a perfect match with an optimal g.
double MinusLogOneMinusG(double logit);

}  // namespace oted
