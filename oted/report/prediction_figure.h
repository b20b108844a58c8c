#pragma once
/// Errors of predicted logs, channel by channel: nominal, designed, and what the sensors alone would leave.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace oted {

/// One line per channel that is judged, in shares of the channel's spread over the logs. As HTML, with its key; empty
/// where nothing can be drawn.
/// @param horizon  one of design.json's validation
std::string PredictionFigure(const nlohmann::json& horizon);

}  // namespace oted
