#include "oted/nn/gemm.h"

#include <algorithm>
#include <cstddef>

#include "oted/base/array2.h"
#include "oted/base/error.h"
#include "oted/nn/gemm_tiles.h"

extern "C" {
// The Fortran interface that every BLAS has; libtorch_cpu exports MKL's.
void sgemm_(const char* trans_a, const char* trans_b, const int* m, const int* n, const int* k, const float* alpha,
            const float* a, const int* lda, const float* b, const int* ldb, const float* beta, float* c,
            const int* ldc);

// MKL's thread count of the calling thread; absent from other libraries.
int MKL_Set_Num_Threads_Local(int n_threads) __attribute__((weak));

// MKL asks this function whether the processor is Intel's and runs at less than half speed on others; ours answers yes
// for all, so that it picks its kernels by the instructions that the processor has.
int mkl_serv_intel_cpu_true(void);
int mkl_serv_intel_cpu_true(void) { return 1; }
}

namespace oted {
namespace {

// From the product (m, n) to c.
void ApplyEpilogue(const GemmEpilogue& e, const float* product, int ld_product, float* c, int ldc, int m, int n) {
  if (e.column_sums != nullptr) std::fill_n(e.column_sums, n, 0.0f);
  for (int i = 0; i < m; ++i, c += ldc, product += ld_product) {
    const ptrdiff_t mask_row = e.mask_rows != nullptr ? e.mask_rows[i] : i;
    for (int j = 0; j < n; ++j) {
      float v = product[j];
      if (e.bias != nullptr) v += e.bias[j];
      if (e.rectify) v = std::max(v, 0.0f);
      if (e.mask != nullptr && !(e.mask[mask_row * e.ld_mask + j] > 0.0f)) v = 0.0f;
      c[j] = v;
      if (e.column_sums != nullptr) e.column_sums[j] += v;
    }
  }
}

void GemmBlas(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta,
              float* c, int ldc, const GemmEpilogue& epilogue) {
  const char trans_a = op_a == Op::kNone ? 'N' : 'T';
  const char trans_b = op_b == Op::kNone ? 'N' : 'T';
  const float alpha = 1.0f;
  const int callers = MKL_Set_Num_Threads_Local != nullptr ? MKL_Set_Num_Threads_Local(1) : 0;
  // The mask may be C: it must outlive the product.
  AlignedVector<float> apart;
  float* product = c;
  int ld_product = ldc;
  if (epilogue.mask != nullptr) {
    apart.resize(static_cast<size_t>(m) * static_cast<size_t>(n));
    product = apart.data();
    ld_product = n;
    for (int i = 0; beta != 0.0f && i < m; ++i) {
      std::copy_n(c + static_cast<ptrdiff_t>(i) * ldc, n, product + static_cast<ptrdiff_t>(i) * n);
    }
  }
  // BLAS counts in columns: a row-major product is the product of the transposes in the other order.
  sgemm_(&trans_b, &trans_a, &n, &m, &k, &alpha, b, &ldb, a, &lda, &beta, product, &ld_product);
  if (MKL_Set_Num_Threads_Local != nullptr) MKL_Set_Num_Threads_Local(callers);
  const GemmEpilogue& e = epilogue;
  if (e.bias != nullptr || e.rectify || e.mask != nullptr || e.column_sums != nullptr) {
    ApplyEpilogue(e, product, ld_product, c, ldc, m, n);
  }
}

}  // namespace

const std::vector<GemmKernel>& GemmKernels() {
  static const std::vector<GemmKernel> kernels = [] {
    std::vector<GemmKernel> found;
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) found.push_back(GemmKernel::kAvx512);
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) found.push_back(GemmKernel::kAvx2);
#endif
    found.push_back(GemmKernel::kBlas);
    return found;
  }();
  return kernels;
}

void GemmWith(GemmKernel kernel, Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b,
              int ldb, float beta, float* c, int ldc, const GemmEpilogue& epilogue) {
  if (m == 0 || n == 0) return;
  if (kernel == GemmKernel::kBlas) return GemmBlas(op_a, op_b, m, n, k, a, lda, b, ldb, beta, c, ldc, epilogue);
#if defined(__x86_64__)
  constexpr int kDepth = 256;
  const int depth = std::max(1, epilogue.mask != nullptr ? k : std::min(k, kDepth));
  thread_local AlignedVector<float> scratch;
  scratch.resize(std::max(scratch.size(), static_cast<size_t>(depth) * kGemmMaxPanel));
  (kernel == GemmKernel::kAvx512 ? GemmAvx512 : GemmAvx2)(
      {op_a, op_b, m, n, k, a, lda, b, ldb, beta, c, ldc, &epilogue, depth, scratch.data()});
#else
  OTED_CHECK(false);
#endif
}

void Gemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta, float* c,
          int ldc, const GemmEpilogue& epilogue) {
  static const GemmKernel kernel = GemmKernels().front();
  GemmWith(kernel, op_a, op_b, m, n, k, a, lda, b, ldb, beta, c, ldc, epilogue);
}

}  // namespace oted
