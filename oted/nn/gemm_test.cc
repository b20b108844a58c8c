#include "oted/nn/gemm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "oted/base/array2.h"
#include "oted/base/rng.h"

namespace oted::gemm_test {

AlignedVector<float> Normals(int n, uint64_t seed) {
  AlignedVector<float> values(static_cast<size_t>(n));
  Rng(seed).FillNormal({values.data(), values.size()});
  return values;
}

struct Sizes {
  int m, n, k;
};

std::string Name(GemmKernel kernel) {
  return kernel == GemmKernel::kAvx512 ? "avx512" : kernel == GemmKernel::kAvx2 ? "avx2" : "portable";
}

/// Each kernel that this processor can run.
class EachGemm : public testing::TestWithParam<GemmKernel> {
 protected:
  void Multiply(Op op_a, Op op_b, const Sizes& s, const AlignedVector<float>& a, int lda, const AlignedVector<float>& b,
                int ldb, float beta, AlignedVector<float>& c, int ldc, const GemmEpilogue& epilogue = {}) {
    GemmWith(GetParam(), op_a, op_b, s.m, s.n, s.k, a.data(), lda, b.data(), ldb, beta, c.data(), ldc, epilogue);
  }
};

INSTANTIATE_TEST_SUITE_P(Kernels, EachGemm, testing::ValuesIn(GemmKernels()),
                         [](const auto& kernel) { return Name(kernel.param); });

// Tiles of all heights, panels of all widths, packed and in place, one block of k and several.
TEST_P(EachGemm, EqualsTheDoubleLoopForAllOperandsAndOddSizes) {
  for (const auto [m, n, k] :
       {Sizes{1, 1, 1}, Sizes{3, 5, 7}, Sizes{33, 17, 65}, Sizes{1, 256, 23}, Sizes{255, 1, 31}, Sizes{13, 64, 16},
        Sizes{22, 43, 258}, Sizes{9, 33, 515}, Sizes{5, 32, 40}, Sizes{3, 5, 0}}) {
    for (const Op op_a : {Op::kNone, Op::kTranspose}) {
      for (const Op op_b : {Op::kNone, Op::kTranspose}) {
        for (const float beta : {0.0f, 1.0f, -0.5f}) {
          // Rows are stored wider than they are used: the row lengths are the arrays', not the product's.
          const bool ta = op_a == Op::kTranspose, tb = op_b == Op::kTranspose;
          const int lda = (ta ? m : k) + 2, ldb = (tb ? k : n) + 3, ldc = n + 1;
          const auto a = Normals((ta ? k : m) * lda, 1), b = Normals((tb ? n : k) * ldb, 2);
          const auto c0 = Normals(m * ldc, 3);
          auto c = c0;
          if (beta == 0.0f) {
            for (int i = 0; i < m; ++i) std::fill_n(c.begin() + i * ldc, n, NAN);  // overwritten, not multiplied
          }
          Multiply(op_a, op_b, {m, n, k}, a, lda, b, ldb, beta, c, ldc);
          for (int i = 0; i < m; ++i) {
            for (int j = 0; j < n; ++j) {
              const size_t at = static_cast<size_t>(i * ldc + j);
              double sum = beta == 0.0f ? 0.0 : static_cast<double>(beta) * c0[at], magnitude = std::abs(sum);
              for (int l = 0; l < k; ++l) {
                const double term = static_cast<double>(a[static_cast<size_t>(ta ? l * lda + i : i * lda + l)]) *
                                    b[static_cast<size_t>(tb ? j * ldb + l : l * ldb + j)];
                sum += term;
                magnitude += std::abs(term);
              }
              ASSERT_NEAR(c[at], sum, 2e-6 * magnitude) << m << "x" << n << "x" << k << " " << ta << tb << beta;
            }
            // Nothing is written between the rows.
            ASSERT_EQ(c[static_cast<size_t>(i * ldc + n)], c0[static_cast<size_t>(i * ldc + n)]);
          }
        }
      }
    }
  }
}

TEST_P(EachGemm, TheEpilogueIsItsPartsInOrder) {
  for (const auto [m, n, k] : {Sizes{19, 70, 30}, Sizes{16, 64, 300}}) {
    const auto a = Normals(m * k, 1), b = Normals(k * n, 2), bias = Normals(n, 3), mask = Normals(2 * m * n, 4);
    std::vector<int> rows(static_cast<size_t>(m));
    for (int i = 0; i < m; ++i) rows[static_cast<size_t>(i)] = i + i / 2;
    AlignedVector<float> product(static_cast<size_t>(m * n)), c = mask;
    Multiply(Op::kNone, Op::kNone, {m, n, k}, a, k, b, n, 0.0f, product, n);
    AlignedVector<float> sums(static_cast<size_t>(n), NAN);
    // In place: the mask is what C held before.
    Multiply(Op::kNone, Op::kNone, {m, n, k}, a, k, b, n, 0.0f, c, n,
             {.bias = bias.data(),
              .rectify = true,
              .mask = c.data(),
              .ld_mask = n,
              .mask_rows = rows.data(),
              .column_sums = sums.data()});
    for (int j = 0; j < n; ++j) {
      double sum = 0;
      for (int i = 0; i < m; ++i) {
        const float linear = product[static_cast<size_t>(i * n + j)] + bias[static_cast<size_t>(j)];
        const bool kept = linear > 0 && mask[static_cast<size_t>(rows[static_cast<size_t>(i)] * n + j)] > 0;
        ASSERT_NEAR(c[static_cast<size_t>(i * n + j)], kept ? linear : 0.0f, 1e-4) << i << " " << j;
        sum += c[static_cast<size_t>(i * n + j)];
      }
      ASSERT_NEAR(sums[static_cast<size_t>(j)], sum, 1e-4) << j;
    }
  }
}

TEST(Gemm, AnElementsBitsDependOnItsRowAndColumnAlone) {
  const int m = 40, n = 70, k = 300;
  const auto a = Normals(m * k, 1), b = Normals(k * n, 2);
  AlignedVector<float> whole(static_cast<size_t>(m * n));
  Gemm(Op::kNone, Op::kNone, m, n, k, a.data(), k, b.data(), n, 0.0f, whole.data(), n);
  for (int i = 0; i < m; i += 3) {
    for (int j = 0; j < n; j += 3) {
      float alone;
      Gemm(Op::kNone, Op::kNone, 1, 1, k, a.data() + i * k, k, b.data() + j, n, 0.0f, &alone, 1);
      ASSERT_EQ(alone, whole[static_cast<size_t>(i * n + j)]) << i << " " << j;
    }
  }
}

TEST(Gemm, EmptyProductsTouchNothing) {
  float c = 5;
  Gemm(Op::kNone, Op::kNone, 0, 1, 1, &c, 1, &c, 1, 0.0f, &c, 1);
  Gemm(Op::kNone, Op::kNone, 1, 0, 1, &c, 1, &c, 1, 0.0f, &c, 1);
  EXPECT_EQ(c, 5);
}

TEST(Gemm, CalledOnFourThreadsAtOnceGivesTheBytesOfOne) {
  const int m = 256, n = 256, k = 273;
  const auto a = Normals(m * k, 4), b = Normals(k * n, 5);
  const auto product = [&] {
    AlignedVector<float> c(static_cast<size_t>(m * n));
    Gemm(Op::kNone, Op::kNone, m, n, k, a.data(), k, b.data(), n, 0.0f, c.data(), n);
    return c;
  };
  const auto alone = product();
  std::vector<AlignedVector<float>> results(4);
  std::vector<std::thread> threads;
  for (auto& result : results) {
    threads.emplace_back([&] {
      for (int i = 0; i < 10; ++i) result = product();
    });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& result : results)
    EXPECT_EQ(std::memcmp(result.data(), alone.data(), alone.size() * sizeof(float)), 0);
}

}  // namespace oted::gemm_test
