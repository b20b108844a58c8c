#pragma once
/// Single-precision matrix products on one thread.

namespace oted {

enum class Op { kNone, kTranspose };

/// C = op(A) op(B) + beta C, row-major, with C (m, n), op(A) (m, k), op(B) (k, n). `lda`, `ldb`, `ldc` are the row
/// lengths of the arrays as stored. Always one thread, whatever the caller's BLAS settings are (and they are left as
/// they were): parallelism is across seeds and lanes. Equal inputs at equal alignment give equal bytes.
void Gemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta, float* c,
          int ldc);

}  // namespace oted
