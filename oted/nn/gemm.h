#pragma once
/// Single-precision matrix products on one thread, with what surrounds a product in a network done on the way out.

#include <vector>

namespace oted {

enum class Op { kNone, kTranspose };

/// What is done to C's elements before they are stored, in the order of the members; any may be absent.
struct GemmEpilogue {
  const float* bias = nullptr;     ///< (n): c[i, j] += bias[j]
  bool rectify = false;            ///< c = max(c, 0)
  const float* mask = nullptr;     ///< c[i, j] = 0 where mask[i, j] <= 0: the rectifier's derivative. May be C itself
  int ld_mask = 0;                 ///< row length of `mask`; that of C where it is C
  const int* mask_rows = nullptr;  ///< (m), ascending: c[i, j] is masked by mask[mask_rows[i], j]
  float* column_sums = nullptr;    ///< (n), overwritten: sums over i of what is stored
};

/// C = op(A) op(B) + beta C, row-major, with C (m, n), op(A) (m, k), op(B) (k, n), and then the epilogue. `lda`, `ldb`,
/// `ldc` are the row lengths of the arrays as stored. Always one thread: parallelism is across seeds and lanes.
///
/// The product is this library's own, compiled for AVX-512, for AVX2 with FMA, and for any processor
/// (docs/architecture.md says why). An element's bits depend on its row of op(A), its column of op(B) and the
/// instruction set alone: not on m, n, alignment or the number of threads.
void Gemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta, float* c,
          int ldc, const GemmEpilogue& epilogue = {});

/// Which code multiplies.
enum class GemmKernel { kAvx512, kAvx2, kPortable };

/// Those that this processor can run, fastest first; Gemm takes the first.
const std::vector<GemmKernel>& GemmKernels();

/// Gemm by a given kernel, one of GemmKernels(): for tests and benchmarks.
void GemmWith(GemmKernel kernel, Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b,
              int ldb, float beta, float* c, int ldc, const GemmEpilogue& epilogue = {});

}  // namespace oted
