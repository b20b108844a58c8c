#pragma once
/// Units and meanings of the arrays of mjModel and mjOption that can be parameters.

#include <string>
#include <string_view>
#include <vector>

namespace oted {

struct FieldInfo {
  std::string unit;     ///< "" where the numbers have none
  std::string meaning;  ///< one line
};

/// What array `name` ("geom_friction", "gravity") holds; of its number `index` per object, or of all for -1. A joint's
/// units depend on whether it slides or turns: "N s/m | N m s/rad" has both, the sliding one first.
/// Empty for an array that is not in the table.
FieldInfo DescribeField(std::string_view name, int index);

/// The names of all arrays in the table, ascending.
std::vector<std::string> DescribedFields();

/// One half of a unit with two: `slides` picks the first.
std::string PickUnit(const std::string& unit, bool slides);

}  // namespace oted
