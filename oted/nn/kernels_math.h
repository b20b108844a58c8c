#pragma once
/// Compiled with -ffast-math (CMakeLists.txt): loops over exp, log, tanh, sin, cos become calls of the C library's
/// vector versions, good to 4 units in the last place, and divisions and square roots become the processor's estimates
/// with a step of Newton's method. NaN stays NaN; of infinities nothing is promised.

#include <cstddef>

namespace oted::kernels {

/// y[i] = exp(x[i]), log(x[i]), tanh(x[i]) to a few units in the last place, or 1e-7 where tanh is near zero.
/// y may be x.
void Exp(const float* x, float* y, size_t n);
void Log(const float* x, float* y, size_t n);
void Tanh(const float* x, float* y, size_t n);
/// 2n standard normals of 2n uniforms (Box and Muller 1958), the first n in (0, 1], the others in [0, 1).
void NormalsFromUniforms(const float* uniforms, float* normals, size_t n);

}  // namespace oted::kernels
