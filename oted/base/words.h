#pragma once
/// What the terminal and the report say in the same words.

namespace oted {

/// Under a table some of whose channels have a star.
inline constexpr const char* kStarredChannels = "* computed from positions, or late: no verdict rests on it";

}  // namespace oted
