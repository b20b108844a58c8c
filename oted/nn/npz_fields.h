#pragma once
/// The arrays PREFIX/... of a saved network.

#include <fmt/format.h>

#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/data/npz.h"

namespace oted {

struct NpzFields {
  const std::string& prefix;
  const NpzArrays& arrays;
  const std::string& where;  ///< the file, for messages

  /// @throws DataError, always
  [[noreturn]] void Fail(const std::string& name) const {
    throw DataError(fmt::format("'{}': array '{}/{}' is missing or does not fit; the file is damaged, make it again",
                                where, prefix, name));
  }
  /// Null when there is none.
  const NpyArray* Find(const std::string& name) const {
    const auto found = arrays.find(prefix + "/" + name);
    return found == arrays.end() ? nullptr : &found->second;
  }
  /// @throws DataError when there is none
  std::vector<double> Get(const std::string& name) const {
    const NpyArray* array = Find(name);
    if (array == nullptr) Fail(name);
    return array->ToDouble();
  }
};

}  // namespace oted
