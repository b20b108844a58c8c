#include "oted/nn/kernels_math.h"

#include <cmath>
#include <numbers>

#include "oted/nn/kernels.h"
#include "oted/nn/vectorised.h"

namespace oted::kernels {

OTED_VECTORISED void Exp(const float* x, float* y, size_t n) {
#pragma GCC ivdep
  for (size_t i = 0; i < n; ++i) y[i] = std::exp(x[i]);
}

OTED_VECTORISED void Log(const float* x, float* y, size_t n) {
#pragma GCC ivdep
  for (size_t i = 0; i < n; ++i) y[i] = std::log(x[i]);
}

OTED_VECTORISED void Tanh(const float* x, float* y, size_t n) {
#pragma GCC ivdep
  for (size_t i = 0; i < n; ++i) y[i] = std::tanh(x[i]);
}

OTED_VECTORISED void NormalsFromUniforms(const float* __restrict u, float* __restrict normals, size_t n) {
  constexpr float kTurn = 2.0f * std::numbers::pi_v<float>;
  float* sines = normals + n;
  // Loops apart: of a sine and a cosine together the compiler makes a call that has no vector version.
  for (size_t i = 0; i < n; ++i) sines[i] = std::sin(kTurn * u[n + i]);
  for (size_t i = 0; i < n; ++i) {
    const float radius = std::sqrt(-2.0f * std::log(u[i]));
    sines[i] *= radius;
    normals[i] = radius * std::cos(kTurn * u[n + i]);
  }
}

namespace {

inline void AdamElement(float& parameter, float gradient, float& m, float& v, const AdamArguments& a) {
  const float g = gradient + a.weight_decay * parameter;
  const float mi = m + (1.0f - a.beta1) * (g - m);
  const float vi = a.beta2 * v + (1.0f - a.beta2) * g * g;
  m = mi;
  v = vi;
  parameter -= a.step_size * mi / (std::sqrt(vi) * a.inverse_sqrt_correction + a.epsilon);
}

}  // namespace

OTED_VECTORISED void Adam(float* __restrict parameters, const float* __restrict gradient, float* __restrict m,
                          float* __restrict v, size_t n, const AdamArguments& arguments) {
  const AdamArguments a = arguments;
  for (size_t i = 0; i < n; ++i) AdamElement(parameters[i], gradient[i], m[i], v[i], a);
}

OTED_VECTORISED void AdamPolyak(float* __restrict parameters, const float* __restrict gradient, float* __restrict m,
                                float* __restrict v, float* __restrict target, float tau, size_t n,
                                const AdamArguments& arguments) {
  const AdamArguments a = arguments;
  for (size_t i = 0; i < n; ++i) {
    AdamElement(parameters[i], gradient[i], m[i], v[i], a);
    target[i] += tau * (parameters[i] - target[i]);
  }
}

}  // namespace oted::kernels
