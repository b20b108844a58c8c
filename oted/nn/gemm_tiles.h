#pragma once
/// The matrix product for one instruction set, after Goto and van de Geijn (2008). gemm_avx2.cc, gemm_avx512.cc
/// and gemm_portable.cc alone define OTED_GEMM_WIDTH, and each is compiled for its instruction set: no inline function
/// from elsewhere may be called here, or the linker could give this file's copy of it to a processor that cannot run
/// it.

#include <cstddef>
#include <utility>

#include "oted/nn/gemm.h"

namespace oted {

struct GemmArguments {
  Op op_a, op_b;
  int m, n, k;
  const float* a;
  int lda;
  const float* b;
  int ldb;
  float beta;
  float* c;
  int ldc;
  const GemmEpilogue* epilogue;
  int depth;       // rows of op(B) that are packed at a time; k where the mask is C itself
  float* scratch;  // depth kGemmMaxPanel floats, aligned to 64 bytes
};

// The most columns of a packed panel of B. With 256 rows that is 32 KB, which the first-level cache holds.
inline constexpr int kGemmMaxPanel = 32;

void GemmPortable(const GemmArguments& arguments);
#if defined(__x86_64__)
void GemmAvx2(const GemmArguments& arguments);
void GemmAvx512(const GemmArguments& arguments);
#endif

#if defined(OTED_GEMM_WIDTH)
namespace {

constexpr int kWidth = OTED_GEMM_WIDTH;         // floats of a vector register
constexpr int kTileRows = OTED_GEMM_TILE_ROWS;  // a tile of C is kept in kTileRows x kTileVectors registers
constexpr int kTileVectors = 2;
constexpr int kPanel = kTileVectors * kWidth;
static_assert(kPanel <= kGemmMaxPanel);

typedef float Vector __attribute__((vector_size(kWidth * sizeof(float)), aligned(4), may_alias));

inline int Min(int a, int b) { return a < b ? a : b; }

// `beta` and the epilogue of this block of k: later blocks add to what the first one stored, the last one finishes.
struct Store {
  float* c;
  int ldc;
  float beta;
  GemmEpilogue epilogue;
};

// The tile's `width` leading columns, one element at a time: for the last columns of C where no vector fits.
void StoreEdge(const float* tile, int rows, int row, int column, int width, const Store& store) {
  const GemmEpilogue& e = store.epilogue;
  for (int i = 0; i < rows; ++i) {
    float* c = store.c + static_cast<ptrdiff_t>(row + i) * store.ldc + column;
    for (int j = 0; j < width; ++j) {
      float v = tile[i * kPanel + j];
      if (store.beta != 0.0f) v += store.beta * c[j];
      if (e.bias != nullptr) v += e.bias[column + j];
      if (e.rectify) v = v > 0.0f ? v : 0.0f;
      if (e.mask != nullptr) {
        const ptrdiff_t mask_row = e.mask_rows != nullptr ? e.mask_rows[row + i] : row + i;
        if (!(e.mask[mask_row * e.ld_mask + column + j] > 0.0f)) v = 0.0f;
      }
      c[j] = v;
      if (e.column_sums != nullptr) e.column_sums[column + j] += v;
    }
  }
}

// kRows rows of a panel of C. a: (kRows, k) or, transposed, (k, kRows), with row length `lda`. b: (k, kVectors vectors)
// with row length `ldb`.
template <int kRows, int kVectors, bool kTransposedA>
__attribute__((noinline)) void Tile(const float* a, ptrdiff_t lda, const float* b, ptrdiff_t ldb, int k, int row,
                                    int column, int width, const Store& store) {
  Vector sums[kRows][kVectors];
#pragma GCC unroll 8
  for (int i = 0; i < kRows; ++i) {
#pragma GCC unroll 8
    for (int j = 0; j < kVectors; ++j) sums[i][j] = Vector{};
  }
  // What the end of the tile will touch, on its way while the sums are made.
#pragma GCC unroll 8
  for (int i = 0; i < kRows; ++i) {
    float* c = store.c + static_cast<ptrdiff_t>(row + i) * store.ldc + column;
#pragma GCC unroll 8
    for (int j = 0; j < kVectors; ++j) __builtin_prefetch(c + j * kWidth, 1);
  }
  for (ptrdiff_t p = 0; p < k; ++p, b += ldb) {
    Vector b_row[kVectors];
#pragma GCC unroll 8
    for (int j = 0; j < kVectors; ++j) b_row[j] = *reinterpret_cast<const Vector*>(b + j * kWidth);
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) {
      const float factor = kTransposedA ? a[p * lda + i] : a[i * lda + p];
#pragma GCC unroll 8
      for (int j = 0; j < kVectors; ++j) sums[i][j] += factor * b_row[j];
    }
  }

  if (width < kVectors * kWidth) {
    alignas(64) float tile[kRows * kPanel];
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) {
#pragma GCC unroll 8
      for (int j = 0; j < kVectors; ++j) *reinterpret_cast<Vector*>(tile + i * kPanel + j * kWidth) = sums[i][j];
    }
    StoreEdge(tile, kRows, row, column, width, store);
    return;
  }
  const GemmEpilogue& e = store.epilogue;
  const Vector zero{};
#pragma GCC unroll 8
  for (int j = 0; j < kVectors; ++j) {
    const int at = column + j * kWidth;
    const Vector bias = e.bias != nullptr ? *reinterpret_cast<const Vector*>(e.bias + at) : zero;
    Vector column_sum = e.column_sums != nullptr ? *reinterpret_cast<const Vector*>(e.column_sums + at) : zero;
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) {
      Vector v = sums[i][j];
      Vector* c = reinterpret_cast<Vector*>(store.c + static_cast<ptrdiff_t>(row + i) * store.ldc + at);
      if (store.beta != 0.0f) v += store.beta * *c;
      v += bias;
      if (e.rectify) v = v > zero ? v : zero;
      if (e.mask != nullptr) {
        const ptrdiff_t mask_row = e.mask_rows != nullptr ? e.mask_rows[row + i] : row + i;
        const Vector mask = *reinterpret_cast<const Vector*>(e.mask + mask_row * e.ld_mask + at);
        v = mask > zero ? v : zero;
      }
      *c = v;
      column_sum += v;
    }
    if (e.column_sums != nullptr) *reinterpret_cast<Vector*>(e.column_sums + at) = column_sum;
  }
}

// Tile with its number of rows known when compiled.
template <int kRows, int kVectors, bool kTransposedA>
void TileOf(int rows, const float* a, ptrdiff_t lda, const float* b, ptrdiff_t ldb, int k, int row, int column,
            int width, const Store& store) {
  if constexpr (kRows > 1) {
    if (rows < kRows) {
      return TileOf<kRows - 1, kVectors, kTransposedA>(rows, a, lda, b, ldb, k, row, column, width, store);
    }
  }
  Tile<kRows, kVectors, kTransposedA>(a, lda, b, ldb, k, row, column, width, store);
}

// a0 b0 a1 b1 ... of the vectors' halves that begin at `from`.
template <int from, int... i>
inline Vector Interleave(const Vector& a, const Vector& b, std::integer_sequence<int, i...>) {
  return __builtin_shufflevector(a, b, (from + i / 2 + (i % 2) * kWidth)...);
}

// A square of kWidth x kWidth floats, transposed: each round interleaves the upper with the lower half of the rows, and
// after log2(kWidth) rounds each element is where it belongs.
void TransposeSquare(const float* from, ptrdiff_t ld_from, float* to, ptrdiff_t ld_to) {
  using Lanes = std::make_integer_sequence<int, kWidth>;
  Vector rows[kWidth], next[kWidth];
#pragma GCC unroll 16
  for (int i = 0; i < kWidth; ++i) rows[i] = *reinterpret_cast<const Vector*>(from + i * ld_from);
#pragma GCC unroll 4
  for (int round = 1; round < kWidth; round *= 2) {
#pragma GCC unroll 16
    for (int i = 0; i < kWidth / 2; ++i) {
      next[2 * i] = Interleave<0>(rows[i], rows[i + kWidth / 2], Lanes{});
      next[2 * i + 1] = Interleave<kWidth / 2>(rows[i], rows[i + kWidth / 2], Lanes{});
    }
#pragma GCC unroll 16
    for (int i = 0; i < kWidth; ++i) rows[i] = next[i];
  }
#pragma GCC unroll 16
  for (int i = 0; i < kWidth; ++i) *reinterpret_cast<Vector*>(to + i * ld_to) = rows[i];
}

// `width` columns of op(B) from b on as (depth, panel) with zeros beyond; panel: a multiple of kWidth.
void PackB(Op op, const float* b, ptrdiff_t ldb, int depth, int width, int panel, float* packed) {
  for (int q = 0; q < panel; q += kWidth) {
    const int columns = Min(kWidth, width - q);
    int p = 0;
    if (columns == kWidth && op == Op::kNone) {
      for (; p < depth; ++p) {
        *reinterpret_cast<Vector*>(packed + p * panel + q) = *reinterpret_cast<const Vector*>(b + p * ldb + q);
      }
    }
    if (columns == kWidth && op == Op::kTranspose) {
      for (; p + kWidth <= depth; p += kWidth) {
        TransposeSquare(b + q * ldb + p, ldb, packed + p * panel + q, panel);
      }
    }
    for (; p < depth; ++p) {
      float* to = packed + p * panel + q;
      *reinterpret_cast<Vector*>(to) = Vector{};
      if (op == Op::kNone) {
        for (int j = 0; j < columns; ++j) to[j] = b[p * ldb + q + j];
      } else {
        for (int j = 0; j < columns; ++j) to[j] = b[(q + j) * ldb + p];
      }
    }
  }
}

void Multiply(const GemmArguments& g) {
  for (int j = 0; g.epilogue->column_sums != nullptr && j < g.n; ++j) g.epilogue->column_sums[j] = 0.0f;
  for (int begin = 0; begin == 0 || begin < g.k; begin += g.depth) {
    const int depth = Min(g.depth, g.k - begin);
    const bool last = begin + g.depth >= g.k;
    const Store store{g.c, g.ldc, begin == 0 ? g.beta : 1.0f, last ? *g.epilogue : GemmEpilogue{}};
    for (int column = 0; column < g.n; column += kPanel) {
      const int width = Min(kPanel, g.n - column), panel = width > kWidth ? kPanel : kWidth;
      const float* b = g.op_b == Op::kNone ? g.b + static_cast<ptrdiff_t>(begin) * g.ldb + column
                                           : g.b + static_cast<ptrdiff_t>(column) * g.ldb + begin;
      ptrdiff_t ldb = g.ldb;
      // Few tiles read each element of B too rarely to pay for packing it.
      if (g.m > 2 * kTileRows || g.op_b == Op::kTranspose || width < panel) {
        PackB(g.op_b, b, g.ldb, depth, width, panel, g.scratch);
        b = g.scratch;
        ldb = panel;
      }
      for (int row = 0; row < g.m; row += kTileRows) {
        const int rows = Min(kTileRows, g.m - row);
        if (g.op_a == Op::kTranspose) {
          const float* a = g.a + static_cast<ptrdiff_t>(begin) * g.lda + row;
          (panel == kPanel ? TileOf<kTileRows, 2, true> : TileOf<kTileRows, 1, true>)(rows, a, g.lda, b, ldb, depth,
                                                                                      row, column, width, store);
        } else {
          const float* a = g.a + static_cast<ptrdiff_t>(row) * g.lda + begin;
          (panel == kPanel ? TileOf<kTileRows, 2, false> : TileOf<kTileRows, 1, false>)(rows, a, g.lda, b, ldb, depth,
                                                                                        row, column, width, store);
        }
      }
    }
  }
}

}  // namespace
#endif  // OTED_GEMM_WIDTH

}  // namespace oted
