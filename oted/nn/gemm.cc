#include "oted/nn/gemm.h"

#include <algorithm>
#include <cstddef>

#include "oted/base/array2.h"
#include "oted/base/error.h"
#include "oted/nn/gemm_tiles.h"

namespace oted {

const std::vector<GemmKernel>& GemmKernels() {
  static const std::vector<GemmKernel> kernels = [] {
    std::vector<GemmKernel> found;
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) found.push_back(GemmKernel::kAvx512);
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) found.push_back(GemmKernel::kAvx2);
#endif
    found.push_back(GemmKernel::kPortable);
    return found;
  }();
  return kernels;
}

void GemmWith(GemmKernel kernel, Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b,
              int ldb, float beta, float* c, int ldc, const GemmEpilogue& epilogue) {
  if (m == 0 || n == 0) return;
  constexpr int kDepth = 256;
  const int depth = std::max(1, epilogue.mask != nullptr ? k : std::min(k, kDepth));
  thread_local AlignedVector<float> scratch;
  scratch.resize(std::max(scratch.size(), static_cast<size_t>(depth) * kGemmMaxPanel));
  const GemmArguments arguments{op_a, op_b, m, n, k, a, lda, b, ldb, beta, c, ldc, &epilogue, depth, scratch.data()};
  switch (kernel) {
#if defined(__x86_64__)
    case GemmKernel::kAvx512:
      return GemmAvx512(arguments);
    case GemmKernel::kAvx2:
      return GemmAvx2(arguments);
#endif
    case GemmKernel::kPortable:
      return GemmPortable(arguments);
    default:
      OTED_CHECK(false);
  }
}

void Gemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta, float* c,
          int ldc, const GemmEpilogue& epilogue) {
  static const GemmKernel kernel = GemmKernels().front();
  GemmWith(kernel, op_a, op_b, m, n, k, a, lda, b, ldb, beta, c, ldc, epilogue);
}

}  // namespace oted
