#pragma once
/// A field of a text table.

#include <optional>
#include <string_view>

namespace oted {

/// Without blanks around it.
std::string_view Trimmed(std::string_view field);

/// The number that a field holds, blanks and a plus sign allowed; "nan" and "inf" are numbers. What lies nearer to zero
/// than any double is zero, as for numpy. @return nothing where the field is empty, no number, or beyond a double's
/// range
std::optional<double> ParseNumber(std::string_view field);

}  // namespace oted
