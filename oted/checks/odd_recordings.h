#pragma once
/// Recordings that a simulator predicts far worse than the others of the same robot.

#include <vector>

#include "oted/checks/short_replays.h"

namespace oted {

/// Of each channel the error in the better recordings, that a quarter of them stay below, and at least `least`.
/// @param errors  of each recording; empty: it was not measured
ChannelErrors UsualErrors(const std::vector<ChannelErrors>& errors, double least);

/// Whether some channel's squared error is more than four times the usual.
bool IsOdd(const ChannelErrors& errors, const ChannelErrors& usual);

}  // namespace oted
