#pragma once
/// Elements of a list by their indices.

#include <cstddef>
#include <vector>

namespace oted {

/// Of `all`, those at `which`, in that order.
template <class T>
std::vector<T> Picked(const std::vector<T>& all, const std::vector<size_t>& which) {
  std::vector<T> picked;
  picked.reserve(which.size());
  for (const size_t i : which) picked.push_back(all[i]);
  return picked;
}

}  // namespace oted
