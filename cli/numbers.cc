#include "cli/numbers.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

namespace oted::cli {
namespace {

CLI::Validator Number(bool positive) {
  // CLI11's own takes nan, and names the largest double digit by digit.
  const char* wanted = positive ? "a positive number" : "a number, 0 or more";
  return CLI::Validator(
      [positive, wanted](const std::string& word) {
        double value = 0;
        // CLI11 takes a longer integer for the largest that there is.
        constexpr double kEnd = 9.2e18;
        const bool is_number = CLI::detail::lexical_cast(word, value) && std::isfinite(value);
        const bool is_integer = word.find_first_not_of("+0123456789") == std::string::npos;
        if (is_number && is_integer && value >= kEnd)
          return fmt::format("got '{}', wanted {}, below {:g}", word, wanted, kEnd);
        return is_number && (positive ? value > 0 : value >= 0) ? "" : fmt::format("got '{}', wanted {}", word, wanted);
      },
      positive ? "POSITIVE" : "NONNEGATIVE");
}

}  // namespace

const CLI::Validator& PositiveNumber() {
  static const CLI::Validator validator = Number(true);
  return validator;
}

const CLI::Validator& NonNegativeNumber() {
  static const CLI::Validator validator = Number(false);
  return validator;
}

}  // namespace oted::cli
