#pragma once
/// Element-wise passes of the networks, fused so that each touches memory once. Compiled for AVX-512, AVX2 and the
/// baseline, chosen when the program starts.

#include <cstddef>

namespace oted::kernels {

/// While it lives, this thread's arithmetic turns denormal numbers into zero: Adam's moments of idle weights decay into
/// them, and they are a hundred times slower. The former mode returns with its end, as the physics needs it.
class FlushDenormals {
 public:
  FlushDenormals();
  ~FlushDenormals();
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned int former_mode_ = 0;
};

/// dy[i, j] = 0 where h[i, j] <= 0, the derivative of the rectifier.
void MaskByRelu(float* dy, const float* h, int rows, int cols);
/// sums[j] = sum_i x[i, j].
void SumColumns(const float* x, float* sums, int rows, int cols);

/// y[i] = sum_j x[i, j] w[j] + bias: a linear layer of one output.
void RowProducts(const float* x, const float* w, float bias, float* y, int rows, int cols);
/// Back through that layer where its input x is that of a rectifier: dx[i, j] = dy[i] w[j] where x[r, j] > 0, else 0,
/// with r = x_rows[i] (ascending), or i where `x_rows` is null. dx takes the place of x.
void RowProductsInputGradient(const float* dy, const float* w, float* x, const int* x_rows, int rows, int cols);
/// The same for r = i, and dw[j] = sum_i dy[i] x[i, j], column_sums[j] = sum_i dx[i, j].
void RowProductsGradients(const float* dy, const float* w, float* x, float* dw, float* column_sums, int rows, int cols);

/// What batch normalisation folded into a linear layer needs (batch_norm_mlp.h).
/// mean[j] and variance[j] = sum_i (x[i, j] - mean[j])^2 / rows of x's columns.
void ColumnMoments(const float* x, float* mean, float* variance, int rows, int cols);
/// scaled[i, j] = scale[i] w[i, j] and bias[j] += sum_i offset[i] w[i, j]: a normalisation's affine map, folded.
void ScaleRows(const float* w, const float* scale, const float* offset, float* scaled, float* bias, int rows, int cols);
/// Back through that, for one row: d_scale = sum_j dw[j] w[j], d_offset = sum_j d_bias[j] w[j], and then
/// dw[j] = scale dw[j] + offset d_bias[j].
void UnfoldRow(const float* w, const float* d_bias, float scale, float offset, float* dw, float* d_scale,
               float* d_offset, int cols);
/// sums[j] = sum_i dy[i] x[i, j].
void WeightedColumnSums(const float* dy, const float* x, float* sums, int rows, int cols);
/// Back through statistics and rectifier: h[i, j] = dh[i, j] + constant[j] + slope[j] h[i, j] where h[i, j] > 0, else
/// 0. column_sums[j] = sum_i of the new h[i, j].
void NormalisedGradient(const float* dh, const float* slope, const float* constant, float* h, float* column_sums,
                        int rows, int cols);
/// The same for dh[i, j] = dy[i] w[j].
void NormalisedRowProductsGradient(const float* dy, const float* w, const float* slope, const float* constant, float* h,
                                   float* column_sums, int rows, int cols);

/// Layer normalisation of each row of h: y[i, j] = gamma[j] x[i, j] + beta[j] with x[i, j] = (h[i, j] - mean[i])
/// inverse[i] and inverse[i] = 1 / sqrt(variance[i] + epsilon).
struct RowNormalisation {
  const float *gamma, *beta;  ///< (cols)
  float epsilon;
};
void NormaliseRows(const float* h, const RowNormalisation& normalisation, float* y, float* mean, float* inverse,
                   int rows, int cols);
/// Back through that and the rectifier whose output h is: dy becomes the gradient at the rectifier's input. dgamma,
/// dbeta and column_sums (of the new dy), each (cols), are overwritten.
struct RowNormalisationGradients {
  float *dgamma, *dbeta, *column_sums;
};
void NormalisedRowsGradient(float* dy, const float* h, const float* gamma, const float* mean, const float* inverse,
                            const RowNormalisationGradients& gradients, int rows, int cols);

/// One Adam step (Kingma and Ba 2015) on n parameters; `step_size` and `inverse_sqrt_correction` carry the bias
/// corrections: p -= step_size * m / (sqrt(v) * inverse_sqrt_correction + epsilon).
struct AdamArguments {
  float beta1, beta2, step_size, inverse_sqrt_correction, epsilon, weight_decay;
};
void Adam(float* parameters, const float* gradient, float* m, float* v, size_t n, const AdamArguments& arguments);
/// The same, and then target += tau (parameters - target).
void AdamPolyak(float* parameters, const float* gradient, float* m, float* v, float* target, float tau, size_t n,
                const AdamArguments& arguments);

}  // namespace oted::kernels
