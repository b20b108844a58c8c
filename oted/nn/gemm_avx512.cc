// Compiled with -mavx512f (CMakeLists.txt); called where the processor has it. 16 sums of 32 registers.
#if defined(__x86_64__)
#define OTED_GEMM_WIDTH 16
#define OTED_GEMM_TILE_ROWS 8
#include "oted/nn/gemm_tiles.h"

namespace oted {
void GemmAvx512(const GemmArguments& arguments) { Multiply(arguments); }
}  // namespace oted
#endif
