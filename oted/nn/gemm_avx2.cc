// Compiled with -mavx2 -mfma (CMakeLists.txt); called where the processor has them. 12 sums of 16 registers.
#if defined(__x86_64__)
#define OTED_GEMM_WIDTH 8
#define OTED_GEMM_TILE_ROWS 6
#include "oted/nn/gemm_tiles.h"

namespace oted {
void GemmAvx2(const GemmArguments& arguments) { Multiply(arguments); }
}  // namespace oted
#endif
