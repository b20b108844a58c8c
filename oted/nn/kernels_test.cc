#include "oted/nn/kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "oted/base/rng.h"
#include "oted/nn/kernels_math.h"

namespace oted::kernels {
namespace {

std::vector<float> Normals(int n, uint64_t seed) {
  std::vector<float> values(static_cast<size_t>(n));
  Rng(seed).FillNormal(values);
  return values;
}

// Widths around those of vector registers, with and without a remainder.
constexpr int kWidths[] = {1, 3, 8, 16, 17, 67};
constexpr int kRows = 5;

template <class Expected>
void ExpectElements(const std::vector<float>& got, int cols, const Expected& expected) {
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < cols; ++j) ASSERT_EQ(got[static_cast<size_t>(i * cols + j)], expected(i, j)) << i << " " << j;
  }
}

TEST(Kernels, TheRectifiersDerivativeIsZeroAtAndBelowZero) {
  for (const int cols : kWidths) {
    const auto dy0 = Normals(kRows * cols, 3);
    auto h = Normals(kRows * cols, 4);
    for (float& v : h) v = std::max(v, 0.0f);
    h[0] = -1.0f;
    const auto masked = [&](int i, int j) {
      const size_t at = static_cast<size_t>(i * cols + j);
      return h[at] > 0 ? dy0[at] : 0.0f;
    };
    auto dy = dy0;
    MaskByRelu(dy.data(), h.data(), kRows, cols);
    ExpectElements(dy, cols, masked);
  }
}

TEST(Kernels, ColumnSumsEqualPlainLoops) {
  for (const int cols : kWidths) {
    const auto x = Normals(kRows * cols, 5);
    std::vector<float> sums(static_cast<size_t>(cols), NAN);
    SumColumns(x.data(), sums.data(), kRows, cols);
    for (int j = 0; j < cols; ++j) {
      double sum = 0;
      for (int i = 0; i < kRows; ++i) sum += x[static_cast<size_t>(i * cols + j)];
      EXPECT_NEAR(sums[static_cast<size_t>(j)], sum, 1e-6);
    }
  }
}

TEST(Kernels, RowProductsEqualPlainLoops) {
  for (const int cols : kWidths) {
    const auto x = Normals(kRows * cols, 5), w = Normals(cols, 6);
    std::vector<float> y(kRows, NAN);
    RowProducts(x.data(), w.data(), 0.5f, y.data(), kRows, cols);
    for (int i = 0; i < kRows; ++i) {
      double sum = 0.5;
      for (int j = 0; j < cols; ++j) {
        sum += static_cast<double>(x[static_cast<size_t>(i * cols + j)]) * w[static_cast<size_t>(j)];
      }
      EXPECT_NEAR(y[static_cast<size_t>(i)], sum, 1e-5);
    }
  }
}

TEST(Kernels, RowProductsGradientsEqualPlainLoops) {
  for (const int cols : kWidths) {
    const auto dy = Normals(kRows, 7), w = Normals(cols, 8);
    auto x0 = Normals(kRows * cols, 9);
    for (float& v : x0) v = std::max(v, 0.0f);
    const std::vector<int> some = {1, 2, 4};
    const auto dx = [&](int i, int row, int j) {
      return x0[static_cast<size_t>(row * cols + j)] > 0 ? dy[static_cast<size_t>(i)] * w[static_cast<size_t>(j)] : 0;
    };
    auto x = x0;
    std::vector<float> dw(static_cast<size_t>(cols), NAN), sums = dw;
    RowProductsGradients(dy.data(), w.data(), x.data(), dw.data(), sums.data(), kRows, cols);
    ExpectElements(x, cols, [&](int i, int j) { return dx(i, i, j); });
    for (int j = 0; j < cols; ++j) {
      double gradient = 0, sum = 0;
      for (int i = 0; i < kRows; ++i) {
        gradient += dy[static_cast<size_t>(i)] * x0[static_cast<size_t>(i * cols + j)];
        sum += dx(i, i, j);
      }
      EXPECT_NEAR(dw[static_cast<size_t>(j)], gradient, 1e-5);
      EXPECT_NEAR(sums[static_cast<size_t>(j)], sum, 1e-5);
    }
    x = x0;
    RowProductsInputGradient(dy.data(), w.data(), x.data(), nullptr, kRows, cols);
    ExpectElements(x, cols, [&](int i, int j) { return dx(i, i, j); });
    x = x0;
    RowProductsInputGradient(dy.data(), w.data(), x.data(), some.data(), 3, cols);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < cols; ++j) {
        ASSERT_EQ(x[static_cast<size_t>(i * cols + j)], dx(i, some[static_cast<size_t>(i)], j)) << i << " " << j;
      }
    }
  }
}

TEST(Kernels, ElementaryFunctionsAreThoseOfDoublePrecisionToAFewUnits) {
  const int n = 1003;
  std::vector<float> x(n), y(n);
  for (int i = 0; i < n; ++i) x[static_cast<size_t>(i)] = -20.0f + 0.04f * static_cast<float>(i);
  Exp(x.data(), y.data(), x.size());
  for (size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(y[i] / std::exp(static_cast<double>(x[i])), 1, 5e-7) << x[i];
  Tanh(x.data(), y.data(), x.size());
  for (size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(y[i], std::tanh(static_cast<double>(x[i])), 3e-7) << x[i];
  for (float& v : x) v = std::exp2(v);
  Log(x.data(), y.data(), x.size());
  for (size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(y[i], std::log(static_cast<double>(x[i])), 3e-6) << x[i];
}

TEST(Kernels, ElementaryFunctionsKeepNan) {
  for (const auto function : {Exp, Log, Tanh}) {
    std::vector<float> x(21, std::numeric_limits<float>::quiet_NaN());
    function(x.data(), x.data(), x.size());
    for (const float v : x) EXPECT_TRUE(std::isnan(v));
  }
}

TEST(Kernels, NormalsFromUniformsAreThoseOfBoxAndMuller) {
  const size_t n = 101;
  std::vector<float> uniforms(2 * n), normals(2 * n);
  Rng rng(3);
  for (float& u : uniforms) u = static_cast<float>(1.0 - rng.Uniform());
  uniforms[0] = 1.0f;      // radius 0
  uniforms[1] = 0x1p-24f;  // the largest radius
  NormalsFromUniforms(uniforms.data(), normals.data(), n);
  for (size_t i = 0; i < n; ++i) {
    const double radius = std::sqrt(-2 * std::log(static_cast<double>(uniforms[i])));
    const double angle = 2 * M_PI * static_cast<double>(uniforms[n + i]);
    EXPECT_NEAR(normals[i], radius * std::cos(angle), 1e-5) << i;
    EXPECT_NEAR(normals[n + i], radius * std::sin(angle), 1e-5) << i;
  }
}

TEST(Kernels, AdamIsItsFormulaAndTheTargetFollows) {
  const size_t n = 37;
  const auto p0 = Normals(37, 8), g = Normals(37, 9), m0 = Normals(37, 10), target0 = Normals(37, 12);
  auto v0 = Normals(37, 11);
  for (float& value : v0) value = value * value;
  const AdamArguments arguments{0.9f, 0.99f, 1e-2f, 1.5f, 1e-3f, 0.1f};
  for (const bool follow : {false, true}) {
    auto p = p0, m = m0, v = v0, target = target0;
    if (follow) {
      AdamPolyak(p.data(), g.data(), m.data(), v.data(), target.data(), 0.25f, n, arguments);
    } else {
      Adam(p.data(), g.data(), m.data(), v.data(), n, arguments);
    }
    for (size_t i = 0; i < n; ++i) {
      const double gradient = g[i] + 0.1 * p0[i];
      const double mi = 0.9 * m0[i] + 0.1 * gradient, vi = 0.99 * v0[i] + 0.01 * gradient * gradient;
      const double pi = p0[i] - 1e-2 * mi / (1.5 * std::sqrt(vi) + 1e-3);
      EXPECT_NEAR(m[i], mi, 1e-6);
      EXPECT_NEAR(v[i], vi, 1e-6 * (1 + vi));
      EXPECT_NEAR(p[i], pi, 1e-6);
      EXPECT_NEAR(target[i], follow ? 0.75 * target0[i] + 0.25 * pi : target0[i], 1e-6);
    }
  }
}

#if defined(__SSE__)
TEST(FlushDenormals, DenormalsAreZeroInsideAndStayThemselvesAfterwards) {
  volatile float smallest_normal = std::numeric_limits<float>::min();
  volatile float half = 0.5f;
  const auto denormal = [&] {
    volatile float product = smallest_normal * half;
    return product > 0.0f;
  };
  ASSERT_TRUE(denormal());
  {
    const FlushDenormals outer;
    EXPECT_FALSE(denormal());
    { const FlushDenormals inner; }
    EXPECT_FALSE(denormal()) << "the inner scope restored more than it had changed";
  }
  EXPECT_TRUE(denormal());
}
#endif

}  // namespace
}  // namespace oted::kernels
