#include "oted/nn/gemm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <thread>
#include <vector>

#include "oted/base/array2.h"
#include "oted/base/rng.h"

namespace oted {
namespace {

AlignedVector<float> Normals(int n, uint64_t seed) {
  AlignedVector<float> values(static_cast<size_t>(n));
  Rng(seed).FillNormal({values.data(), values.size()});
  return values;
}

struct Sizes {
  int m, n, k;
};

TEST(Gemm, EqualsTheDoubleLoopForAllOperandsAndOddSizes) {
  for (const auto [m, n, k] :
       {Sizes{1, 1, 1}, Sizes{3, 5, 7}, Sizes{33, 17, 65}, Sizes{1, 256, 23}, Sizes{255, 1, 31}}) {
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
          Gemm(op_a, op_b, m, n, k, a.data(), lda, b.data(), ldb, beta, c.data(), ldc);
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

}  // namespace
}  // namespace oted
