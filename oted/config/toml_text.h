#pragma once
/// What is checked of a TOML text before it is parsed.

#include <string>
#include <string_view>

namespace oted {

/// TOML has characters beyond ASCII in strings and comments alone. toml++ 3.3 does not refuse one elsewhere: it reads
/// on in undefined behaviour (its table of white space ends in an unreachable branch).
/// @throws UsageError naming the line of a character beyond ASCII outside of strings and comments
void CheckTomlCharacters(std::string_view text, const std::string& file_name);

}  // namespace oted
