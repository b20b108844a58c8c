#include "oted/nn/kernels.h"

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

// One version per instruction set; the loader picks. Sanitizers cannot run before the choice is made.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
#define OTED_VECTORISED __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define OTED_VECTORISED
#endif

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

OTED_VECTORISED void AddBiasRelu(float* __restrict y, const float* __restrict bias, int rows, int cols) {
  for (int i = 0; i < rows; ++i, y += cols) {
    for (int j = 0; j < cols; ++j) {
      const float v = y[j] + bias[j];
      y[j] = v > 0.0f ? v : 0.0f;
    }
  }
}

OTED_VECTORISED void AddBias(float* __restrict y, const float* __restrict bias, int rows, int cols) {
  for (int i = 0; i < rows; ++i, y += cols) {
    for (int j = 0; j < cols; ++j) y[j] += bias[j];
  }
}

OTED_VECTORISED void MaskByRelu(float* __restrict dy, const float* __restrict h, int rows, int cols) {
  const size_t n = static_cast<size_t>(rows) * static_cast<size_t>(cols);
  for (size_t i = 0; i < n; ++i) dy[i] = KeepWherePositive(dy[i], h[i]);
}

OTED_VECTORISED void MaskByReluSumColumns(float* __restrict dy, const float* __restrict h,
                                          float* __restrict bias_gradient, int rows, int cols) {
  std::memset(bias_gradient, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, dy += cols, h += cols) {
    for (int j = 0; j < cols; ++j) {
      const float v = KeepWherePositive(dy[j], h[j]);
      dy[j] = v;
      bias_gradient[j] += v;
    }
  }
}

OTED_VECTORISED void SumColumns(const float* __restrict x, float* __restrict sums, int rows, int cols) {
  std::memset(sums, 0, static_cast<size_t>(cols) * sizeof(float));
  for (int i = 0; i < rows; ++i, x += cols) {
    for (int j = 0; j < cols; ++j) sums[j] += x[j];
  }
}

OTED_VECTORISED void Polyak(float* __restrict target, const float* __restrict source, float tau, size_t n) {
  for (size_t i = 0; i < n; ++i) target[i] += tau * (source[i] - target[i]);
}

OTED_VECTORISED void Adam(float* __restrict parameters, const float* __restrict gradient, float* __restrict m,
                          float* __restrict v, size_t n, const AdamArguments& arguments) {
  const AdamArguments a = arguments;
  for (size_t i = 0; i < n; ++i) {
    const float g = gradient[i] + a.weight_decay * parameters[i];
    const float mi = m[i] + (1.0f - a.beta1) * (g - m[i]);
    const float vi = a.beta2 * v[i] + (1.0f - a.beta2) * g * g;
    m[i] = mi;
    v[i] = vi;
    parameters[i] -= a.step_size * mi / (std::sqrt(vi) * a.inverse_sqrt_correction + a.epsilon);
  }
}

}  // namespace oted::kernels
