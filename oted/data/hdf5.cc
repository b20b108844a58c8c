#include "oted/data/hdf5.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "oted/base/error.h"

namespace oted {

void Hdf5Reader::Fail(const std::string& name, std::string_view what, std::string_view remedy) const {
  throw DataError(fmt::format("'{}': {} {}; {}", path_, name, what, remedy));
}

bool FitsFloat32(std::initializer_list<std::span<const double>> arrays) {
  return std::ranges::all_of(arrays, [](std::span<const double> values) {
    return std::ranges::all_of(values, [](double value) {
      return std::abs(value) <= std::numeric_limits<float>::max() &&
             static_cast<double>(static_cast<float>(value)) == value;
    });
  });
}

}  // namespace oted
