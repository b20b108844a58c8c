#include "oted/data/field_text.h"

#include <charconv>
#include <cmath>

namespace oted {
namespace {

/// Of the whole text.
template <class Float>
std::errc Parse(std::string_view text, Float& number) {
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && rest != text.data() + text.size() ? std::errc::invalid_argument : error;
}

}  // namespace

std::string_view Trimmed(std::string_view field) {
  const size_t begin = field.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return field.substr(begin, field.find_last_not_of(" \t") - begin + 1);
}

std::optional<double> ParseNumber(std::string_view field) {
  std::string_view text = Trimmed(field);
  if (text.starts_with('+')) text.remove_prefix(1);
  double number = 0;
  const std::errc error = Parse(text, number);
  if (error == std::errc{}) return number;
  // Too small and too large are one error here; the wider type tells them apart.
  long double wide = 0;
  if (error != std::errc::result_out_of_range || Parse(text, wide) != std::errc{} || std::abs(wide) > 1) return {};
  return static_cast<double>(wide);
}

}  // namespace oted
