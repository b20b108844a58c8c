// For any processor: the vectors of SSE2 or NEON. 8 sums of 16 registers.
#define OTED_GEMM_WIDTH 4
#define OTED_GEMM_TILE_ROWS 4
#include "oted/nn/gemm_tiles.h"

namespace oted {
void GemmPortable(const GemmArguments& arguments) { Multiply(arguments); }
}  // namespace oted
