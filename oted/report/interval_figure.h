#pragma once
/// The designed values as a forest plot: each parameter's interval within the range that was searched.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace oted {

/// One line per parameter, from the lower to the upper end of its range, on the scale on which it is searched: the 90 %
/// interval, the designed value, the nominal one and, where it is known, the truth. As HTML, with its key.
/// @param parameters  report.json's
std::string IntervalFigure(const nlohmann::json& parameters);

}  // namespace oted
