#pragma once
/// Bytes as text, for data URIs.

#include <string>
#include <string_view>

namespace oted {

/// RFC 4648, section 4, with padding and without line breaks.
std::string Base64(std::string_view bytes);

}  // namespace oted
