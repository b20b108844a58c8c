#pragma once
/// Lists of units as schedulers take them.

#include <string>
#include <vector>

namespace oted {

/// "0-3,7" for 0, 1, 2, 3, 7; "" for none. @param indices  ascending
std::string IndexRanges(const std::vector<int>& indices);

/// An array of a scheduler that knows no index above its own limit: unit = offset + index.
struct IndexChunk {
  int offset = 0;
  std::vector<int> indices;  ///< each below the limit
};
/// @param limit  the number of indices that an array may have, from 0
std::vector<IndexChunk> ChunksOf(const std::vector<int>& indices, int limit);

}  // namespace oted
