#pragma once
/// Multi-layer perceptrons on one flat parameter vector, forward and backward by hand: at the sizes of this field
/// (2 x 256) autograd costs as much as the arithmetic. Tests hold them against libtorch's autograd.

#include <span>
#include <vector>

#include "oted/base/array2.h"
#include "oted/base/rng.h"
#include "oted/nn/kernels.h"

namespace oted {

/// x (in) -> [linear, rectifier] per hidden layer -> linear (out).
class Mlp {
 public:
  struct Layer {
    int in = 0, out = 0;
    size_t weight = 0;  ///< offset of the (in, out) row-major weight in parameters()
    size_t bias = 0;    ///< offset of the (out) bias
  };

  Mlp() = default;
  Mlp(int in, const std::vector<int>& hidden, int out);
  /// Uniform in +-1/sqrt(fan_in) for weights and biases: PyTorch's default for linear layers.
  void Initialize(Rng& rng);

  int in() const { return layers_.front().in; }
  int out() const { return layers_.back().out; }
  std::vector<int> hidden() const;
  const std::vector<Layer>& layers() const { return layers_; }
  AlignedVector<float>& parameters() { return parameters_; }
  const AlignedVector<float>& parameters() const { return parameters_; }
  size_t n_parameters() const { return parameters_.size(); }

 private:
  std::vector<Layer> layers_;
  AlignedVector<float> parameters_;
};

/// Columns [begin, end) of a network's input.
struct InputColumns {
  int begin = 0, end = 0;
};

/// Where a backward pass writes d loss / d ...
struct MlpGradients {
  float* parameters = nullptr;  ///< (n_parameters), overwritten; null when not wanted
  float* x = nullptr;           ///< (batch, columns.end - columns.begin), overwritten; null when not wanted
  InputColumns columns = {};    ///< of x
};

/// The activations of one network on one batch, kept from Forward for one Backward, which writes its gradients over
/// them: what an update touches should fit the processor's cache. Reuses its memory from call to call.
class MlpPass {
 public:
  /// @param x (batch, in). @return (batch, out), owned by this object and valid until its next Forward.
  const float* Forward(const Mlp& mlp, const float* x, int batch);

  /// Back-propagates dy = d loss / d output of the last Forward, on its leading `batch` rows. Once per Forward.
  /// @param x   the input of that Forward; not read without `out.parameters`
  /// @param dy  (batch, out)
  void Backward(const Mlp& mlp, const float* x, const float* dy, int batch, const MlpGradients& out);

  /// d loss / d input alone, on some rows of the last Forward: row i of dy and dx belongs to its row rows[i]. In place
  /// of Backward.
  /// @param rows  ascending
  /// @param dy  (rows.size(), out)
  /// @param dx  (rows.size(), columns.end - columns.begin), overwritten
  void BackwardRows(const Mlp& mlp, std::span<const int> rows, const float* dy, float* dx, InputColumns columns);

 private:
  /// @param rows  as BackwardRows'; null: all of the batch
  void Propagate(const Mlp& mlp, const float* x, const float* dy, int batch, const int* rows, const MlpGradients& out);

  std::vector<AlignedVector<float>> activations_;  // per layer: (batch, out)
  bool fresh_ = false;                             // no Backward has written over them yet
};

/// Adam's moments of one parameter vector.
class Adam {
 public:
  struct Options {
    float learning_rate = 3e-4f;
    float beta1 = 0.9f;
    float beta2 = 0.999f;
    float epsilon = 1e-8f;
    float weight_decay = 0.0f;  ///< added to the gradient (L2), as in Adam, not AdamW
  };
  Adam() = default;
  Adam(size_t n_parameters, const Options& options) : options_(options), m_(n_parameters), v_(n_parameters) {}
  void Step(std::span<float> parameters, std::span<const float> gradient);
  /// The same, after which `target` moves towards the parameters: target += tau (parameters - target).
  void Step(std::span<float> parameters, std::span<const float> gradient, std::span<float> target, float tau);

  void set_learning_rate(float learning_rate) { options_.learning_rate = learning_rate; }
  AlignedVector<float>& m() { return m_; }
  AlignedVector<float>& v() { return v_; }
  int64_t& n_steps() { return n_steps_; }

 private:
  kernels::AdamArguments NextStep();

  Options options_;
  AlignedVector<float> m_, v_;
  int64_t n_steps_ = 0;
};

}  // namespace oted
