#include "oted/nn/gemm.h"

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

void Gemm(Op op_a, Op op_b, int m, int n, int k, const float* a, int lda, const float* b, int ldb, float beta, float* c,
          int ldc) {
  if (m == 0 || n == 0) return;
  const char trans_a = op_a == Op::kNone ? 'N' : 'T';
  const char trans_b = op_b == Op::kNone ? 'N' : 'T';
  const float alpha = 1.0f;
  const int callers = MKL_Set_Num_Threads_Local != nullptr ? MKL_Set_Num_Threads_Local(1) : 0;
  // BLAS counts in columns: a row-major product is the product of the transposes in the other order.
  sgemm_(&trans_b, &trans_a, &n, &m, &k, &alpha, b, &ldb, a, &lda, &beta, c, &ldc);
  if (MKL_Set_Num_Threads_Local != nullptr) MKL_Set_Num_Threads_Local(callers);
}

}  // namespace oted
