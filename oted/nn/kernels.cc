#include "oted/nn/kernels.h"

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "oted/nn/vectorised.h"

namespace oted::kernels {
namespace {

// v where h > 0, else 0. A comparison would become a branch and keep the loop from vectorising; a bit mask does not.
inline float KeepWherePositive(float v, float h) {
  return std::bit_cast<float>(std::bit_cast<int32_t>(v) & -static_cast<int32_t>(h > 0.0f));
}

}  // namespace

#if defined(__SSE__)
FlushDenormals::FlushDenormals() : former_mode_(_mm_getcsr()) {
  constexpr unsigned int kFlushToZero = 0x8000, kDenormalsAreZero = 0x0040;
  _mm_setcsr(former_mode_ | kFlushToZero | kDenormalsAreZero);
}
FlushDenormals::~FlushDenormals() { _mm_setcsr(former_mode_); }
#else
FlushDenormals::FlushDenormals() = default;
FlushDenormals::~FlushDenormals() = default;
#endif

OTED_VECTORISED void MaskByRelu(float* __restrict dy, const float* __restrict h, int rows, int cols) {
  const size_t n = static_cast<size_t>(rows) * static_cast<size_t>(cols);
  for (size_t i = 0; i < n; ++i) dy[i] = KeepWherePositive(dy[i], h[i]);
}

OTED_VECTORISED void SumColumns(const float* __restrict x, float* __restrict sums, int rows, int cols) {
  std::memset(sums, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, x += cols) {
    for (int j = 0; j < cols; ++j) sums[j] += x[j];
  }
}

OTED_VECTORISED void RowProducts(const float* __restrict x, const float* __restrict w, float bias, float* __restrict y,
                                 int rows, int cols) {
  // As many sums at once as a vector register has lanes: a single one would be added to in order, one at a time.
  constexpr int kLanes = 16;
  const int whole = cols - cols % kLanes;
  for (int i = 0; i < rows; ++i, x += cols) {
    float sums[kLanes] = {};
    for (int j = 0; j < whole; j += kLanes) {
      for (int lane = 0; lane < kLanes; ++lane) sums[lane] += x[j + lane] * w[j + lane];
    }
    for (int j = whole; j < cols; ++j) sums[j - whole] += x[j] * w[j];
    for (int half = kLanes / 2; half > 0; half /= 2) {
      for (int lane = 0; lane < half; ++lane) sums[lane] += sums[lane + half];
    }
    y[i] = sums[0] + bias;
  }
}

OTED_VECTORISED void RowProductsInputGradient(const float* __restrict dy, const float* __restrict w, float* x,
                                              const int* __restrict x_rows, int rows, int cols) {
  float* dx = x;
  for (int i = 0; i < rows; ++i, dx += cols) {
    // At or below row i, whose former content is no longer needed.
    const float* from = x + static_cast<ptrdiff_t>(x_rows != nullptr ? x_rows[i] : i) * cols;
    const float factor = dy[i];
#pragma GCC ivdep
    for (int j = 0; j < cols; ++j) dx[j] = KeepWherePositive(factor * w[j], from[j]);
  }
}

OTED_VECTORISED void RowProductsGradients(const float* __restrict dy, const float* __restrict w, float* __restrict x,
                                          float* __restrict dw, float* __restrict column_sums, int rows, int cols) {
  std::memset(dw, 0, static_cast<size_t>(cols) * sizeof(float));
  std::memset(column_sums, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, x += cols) {
    const float factor = dy[i];
    for (int j = 0; j < cols; ++j) {
      const float v = KeepWherePositive(factor * w[j], x[j]);
      dw[j] += factor * x[j];
      column_sums[j] += v;
      x[j] = v;
    }
  }
}

OTED_VECTORISED void ColumnMoments(const float* __restrict x, float* __restrict mean, float* __restrict variance,
                                   int rows, int cols) {
  SumColumns(x, mean, rows, cols);
  const float share = 1.0f / static_cast<float>(rows);
  for (int j = 0; j < cols; ++j) mean[j] *= share;
  std::memset(variance, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, x += cols) {
    for (int j = 0; j < cols; ++j) variance[j] += (x[j] - mean[j]) * (x[j] - mean[j]);
  }
  for (int j = 0; j < cols; ++j) variance[j] *= share;
}

OTED_VECTORISED void ScaleRows(const float* __restrict w, const float* __restrict scale, const float* __restrict offset,
                               float* __restrict scaled, float* __restrict bias, int rows, int cols) {
  for (int i = 0; i < rows; ++i, w += cols, scaled += cols) {
    const float factor = scale[i], share = offset[i];
    for (int j = 0; j < cols; ++j) {
      scaled[j] = factor * w[j];
      bias[j] += share * w[j];
    }
  }
}

OTED_VECTORISED void UnfoldRow(const float* __restrict w, const float* __restrict d_bias, float scale, float offset,
                               float* __restrict dw, float* __restrict d_scale, float* __restrict d_offset, int cols) {
  constexpr int kLanes = 16;
  float scales[kLanes] = {}, offsets[kLanes] = {};
  const int whole = cols - cols % kLanes;
  for (int j = 0; j < whole; j += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      scales[lane] += dw[j + lane] * w[j + lane];
      offsets[lane] += d_bias[j + lane] * w[j + lane];
      dw[j + lane] = scale * dw[j + lane] + offset * d_bias[j + lane];
    }
  }
  for (int j = whole; j < cols; ++j) {
    scales[j - whole] += dw[j] * w[j];
    offsets[j - whole] += d_bias[j] * w[j];
    dw[j] = scale * dw[j] + offset * d_bias[j];
  }
  for (int half = kLanes / 2; half > 0; half /= 2) {
    for (int lane = 0; lane < half; ++lane) {
      scales[lane] += scales[lane + half];
      offsets[lane] += offsets[lane + half];
    }
  }
  *d_scale = scales[0];
  *d_offset = offsets[0];
}

OTED_VECTORISED void WeightedColumnSums(const float* __restrict dy, const float* __restrict x, float* __restrict sums,
                                        int rows, int cols) {
  std::memset(sums, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, x += cols) {
    for (int j = 0; j < cols; ++j) sums[j] += dy[i] * x[j];
  }
}

OTED_VECTORISED void NormalisedGradient(const float* __restrict dh, const float* __restrict slope,
                                        const float* __restrict constant, float* __restrict h,
                                        float* __restrict column_sums, int rows, int cols) {
  std::memset(column_sums, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, h += cols, dh += cols) {
    for (int j = 0; j < cols; ++j) {
      const float v = KeepWherePositive(dh[j] + constant[j] + slope[j] * h[j], h[j]);
      column_sums[j] += v;
      h[j] = v;
    }
  }
}

OTED_VECTORISED void NormalisedRowProductsGradient(const float* __restrict dy, const float* __restrict w,
                                                   const float* __restrict slope, const float* __restrict constant,
                                                   float* __restrict h, float* __restrict column_sums, int rows,
                                                   int cols) {
  std::memset(column_sums, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, h += cols) {
    const float factor = dy[i];
    for (int j = 0; j < cols; ++j) {
      const float v = KeepWherePositive(factor * w[j] + constant[j] + slope[j] * h[j], h[j]);
      column_sums[j] += v;
      h[j] = v;
    }
  }
}

namespace {

// As many sums at once as a vector register has lanes.
constexpr int kSums = 16;

inline float SumOf(float (&sums)[kSums]) {
  for (int half = kSums / 2; half > 0; half /= 2) {
    for (int lane = 0; lane < half; ++lane) sums[lane] += sums[lane + half];
  }
  return sums[0];
}

}  // namespace

OTED_VECTORISED void NormaliseRows(const float* __restrict h, const RowNormalisation& normalisation,
                                   float* __restrict y, float* __restrict mean, float* __restrict inverse, int rows,
                                   int cols) {
  const float *gamma = normalisation.gamma, *beta = normalisation.beta, share = 1.0f / static_cast<float>(cols);
  const int whole = cols - cols % kSums;
  for (int i = 0; i < rows; ++i, h += cols, y += cols) {
    float sums[kSums] = {}, squares[kSums] = {};
    for (int j = 0; j < whole; j += kSums) {
      for (int lane = 0; lane < kSums; ++lane) sums[lane] += h[j + lane];
    }
    for (int j = whole; j < cols; ++j) sums[j - whole] += h[j];
    const float centre = SumOf(sums) * share;
    for (int j = 0; j < whole; j += kSums) {
      for (int lane = 0; lane < kSums; ++lane) squares[lane] += (h[j + lane] - centre) * (h[j + lane] - centre);
    }
    for (int j = whole; j < cols; ++j) squares[j - whole] += (h[j] - centre) * (h[j] - centre);
    const float factor = 1.0f / std::sqrt(SumOf(squares) * share + normalisation.epsilon);
    for (int j = 0; j < cols; ++j) y[j] = gamma[j] * (h[j] - centre) * factor + beta[j];
    mean[i] = centre;
    inverse[i] = factor;
  }
}

OTED_VECTORISED void NormalisedRowsGradient(float* __restrict dy, const float* __restrict h,
                                            const float* __restrict gamma, const float* __restrict mean,
                                            const float* __restrict inverse, const RowNormalisationGradients& gradients,
                                            int rows, int cols) {
  float *__restrict dgamma = gradients.dgamma, *__restrict dbeta = gradients.dbeta,
        *__restrict column_sums = gradients.column_sums;
  for (float* sums : {dgamma, dbeta, column_sums}) std::memset(sums, 0, static_cast<size_t>(cols) * sizeof(float));
  const float share = 1.0f / static_cast<float>(cols);
  const int whole = cols - cols % kSums;
  for (int i = 0; i < rows; ++i, dy += cols, h += cols) {
    const float centre = mean[i], factor = inverse[i];
    float sums[kSums] = {}, products[kSums] = {};
    const auto add = [&](int j, int lane) {
      const float x = (h[j] - centre) * factor, dx = dy[j] * gamma[j];
      sums[lane] += dx;
      products[lane] += dx * x;
      dgamma[j] += dy[j] * x;
      dbeta[j] += dy[j];
    };
    for (int j = 0; j < whole; j += kSums) {
      for (int lane = 0; lane < kSums; ++lane) add(j + lane, lane);
    }
    for (int j = whole; j < cols; ++j) add(j, j - whole);
    const float mean_dx = SumOf(sums) * share, mean_product = SumOf(products) * share;
    for (int j = 0; j < cols; ++j) {
      const float x = (h[j] - centre) * factor;
      const float v = KeepWherePositive(factor * (dy[j] * gamma[j] - mean_dx - x * mean_product), h[j]);
      column_sums[j] += v;
      dy[j] = v;
    }
  }
}

}  // namespace oted::kernels
