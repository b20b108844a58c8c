#include "oted/nn/kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "oted/base/rng.h"

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

TEST(Kernels, BiasAndRectifierEqualPlainLoops) {
  for (const int cols : kWidths) {
    const auto y0 = Normals(kRows * cols, 1), bias = Normals(cols, 2);
    const auto sum = [&](int i, int j) { return y0[static_cast<size_t>(i * cols + j)] + bias[static_cast<size_t>(j)]; };
    auto y = y0;
    AddBias(y.data(), bias.data(), kRows, cols);
    ExpectElements(y, cols, sum);
    y = y0;
    AddBiasRelu(y.data(), bias.data(), kRows, cols);
    ExpectElements(y, cols, [&](int i, int j) { return std::max(sum(i, j), 0.0f); });
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
    dy = dy0;
    std::vector<float> sums(static_cast<size_t>(cols), NAN);
    MaskByReluSumColumns(dy.data(), h.data(), sums.data(), kRows, cols);
    ExpectElements(dy, cols, masked);
    for (int j = 0; j < cols; ++j) {
      double sum = 0;
      for (int i = 0; i < kRows; ++i) sum += masked(i, j);
      EXPECT_NEAR(sums[static_cast<size_t>(j)], sum, 1e-6);
    }
  }
}

TEST(Kernels, ColumnSumsAndPolyakEqualPlainLoops) {
  for (const int cols : kWidths) {
    const auto x = Normals(kRows * cols, 5);
    std::vector<float> sums(static_cast<size_t>(cols), NAN);
    SumColumns(x.data(), sums.data(), kRows, cols);
    for (int j = 0; j < cols; ++j) {
      double sum = 0;
      for (int i = 0; i < kRows; ++i) sum += x[static_cast<size_t>(i * cols + j)];
      EXPECT_NEAR(sums[static_cast<size_t>(j)], sum, 1e-6);
    }
    const auto source = Normals(cols, 6), target0 = Normals(cols, 7);
    auto target = target0;
    Polyak(target.data(), source.data(), 0.25f, target.size());
    for (size_t i = 0; i < target.size(); ++i) EXPECT_NEAR(target[i], 0.75 * target0[i] + 0.25 * source[i], 1e-6);
  }
}

TEST(Kernels, AdamIsItsFormula) {
  const size_t n = 37;
  const auto p0 = Normals(37, 8), g = Normals(37, 9), m0 = Normals(37, 10);
  auto p = p0, m = m0, v = Normals(37, 11);
  for (float& value : v) value = value * value;
  const auto v0 = v;
  Adam(p.data(), g.data(), m.data(), v.data(), n, {0.9f, 0.99f, 1e-2f, 1.5f, 1e-3f, 0.1f});
  for (size_t i = 0; i < n; ++i) {
    const double gradient = g[i] + 0.1 * p0[i];
    const double mi = 0.9 * m0[i] + 0.1 * gradient, vi = 0.99 * v0[i] + 0.01 * gradient * gradient;
    EXPECT_NEAR(m[i], mi, 1e-6);
    EXPECT_NEAR(v[i], vi, 1e-6 * (1 + vi));
    EXPECT_NEAR(p[i], p0[i] - 1e-2 * mi / (1.5 * std::sqrt(vi) + 1e-3), 1e-6);
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
