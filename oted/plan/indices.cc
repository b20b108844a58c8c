#include "oted/plan/indices.h"

#include <fmt/format.h>

#include "oted/base/error.h"

namespace oted {

std::string IndexRanges(const std::vector<int>& indices) {
  std::string text;
  for (size_t i = 0; i < indices.size();) {
    size_t end = i;
    while (end + 1 < indices.size() && indices[end + 1] == indices[end] + 1) ++end;
    text += fmt::format("{}{}", text.empty() ? "" : ",", indices[i]);
    if (end > i) text += fmt::format("-{}", indices[end]);
    i = end + 1;
  }
  return text;
}

std::vector<IndexChunk> ChunksOf(const std::vector<int>& indices, int limit) {
  OTED_CHECK(limit > 0);
  std::vector<IndexChunk> chunks;
  for (const int index : indices) {
    const int offset = index / limit * limit;
    if (chunks.empty() || chunks.back().offset != offset) chunks.push_back({offset, {}});
    chunks.back().indices.push_back(index - offset);
  }
  return chunks;
}

}  // namespace oted
