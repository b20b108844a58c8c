#pragma once
/// Names by pattern.

#include <string_view>

namespace oted {

/// Whether the whole of `text` matches `pattern`, in which * stands for any text, also none, and ? for one character.
bool MatchesGlob(std::string_view pattern, std::string_view text);

}  // namespace oted
