#pragma once
/// The matrix product of libtorch's BLAS (MKL), for benchmarks to hold ours against. Programs that include it export
/// their symbols (ENABLE_EXPORTS): MKL asks mkl_serv_intel_cpu_true whether the processor is Intel's and runs at less
/// than half speed on others; here the answer is yes, so that it picks its kernels by the processor's instructions.

#include "oted/nn/gemm.h"

extern "C" {
void sgemm_(const char* trans_a, const char* trans_b, const int* m, const int* n, const int* k, const float* alpha,
            const float* a, const int* lda, const float* b, const int* ldb, const float* beta, float* c,
            const int* ldc);
int MKL_Set_Num_Threads_Local(int n_threads);
int mkl_serv_intel_cpu_true(void);
int mkl_serv_intel_cpu_true(void) { return 1; }
}

namespace oted {

/// As Gemm, on one thread.
inline void BlasGemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb,
                     float beta, float* c, int ldc) {
  const char trans_a = op_a == Op::kNone ? 'N' : 'T', trans_b = op_b == Op::kNone ? 'N' : 'T';
  const float alpha = 1.0f;
  MKL_Set_Num_Threads_Local(1);
  // BLAS counts in columns: a row-major product is the product of the transposes in the other order.
  sgemm_(&trans_b, &trans_a, &n, &m, &k, &alpha, b, &ldb, a, &lda, &beta, c, &ldc);
}

/// Gemm without an epilogue.
inline void OwnGemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta,
                    float* c, int ldc) {
  Gemm(op_a, op_b, m, n, k, a, lda, b, ldb, beta, c, ldc);
}

}  // namespace oted
