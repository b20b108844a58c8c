#include "oted/data/time_column.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>

namespace oted {
namespace {

constexpr std::array<std::string_view, 5> kTimeNames = {"time", "time_s", "time [s]", "t", "timestamp"};

std::string InLowerCase(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

/// "t", "ms" of "t_ms", "t [ms]" and "tMs".
std::vector<std::string> Parts(std::string_view name) {
  std::vector<std::string> parts;
  bool begins = true, after_small = false;
  for (const char c : name) {
    const auto letter = static_cast<unsigned char>(c);
    if (std::isalnum(letter) == 0) {
      begins = true;
      continue;
    }
    if (begins || (after_small && std::isupper(letter) != 0)) parts.emplace_back();
    parts.back() += static_cast<char>(std::tolower(letter));
    begins = false;
    after_small = std::islower(letter) != 0;
  }
  return parts;
}

double UnitsPerSecond(const std::vector<std::string>& parts) {
  static const std::map<std::string, double> kUnits = {{"ms", 1e3},   {"msec", 1e3}, {"us", 1e6},
                                                       {"usec", 1e6}, {"ns", 1e9},   {"nsec", 1e9}};
  const auto unit = parts.size() > 1 ? kUnits.find(parts.back()) : kUnits.end();
  return unit == kUnits.end() ? 1 : unit->second;
}

}  // namespace

double UnitsPerSecond(std::string_view column) { return UnitsPerSecond(Parts(column)); }

int FindTimeColumn(const std::vector<std::string>& header) {
  for (const std::string_view wanted : kTimeNames) {
    const auto found = std::ranges::find(header, wanted, InLowerCase);
    if (found != header.end()) return static_cast<int>(found - header.begin());
  }
  const auto scaled = std::ranges::find_if(header, [](const std::string& name) {
    const std::vector<std::string> parts = Parts(name);
    return parts.size() == 2 && std::ranges::find(kTimeNames, parts.front()) != kTimeNames.end() &&
           UnitsPerSecond(parts) != 1;
  });
  return scaled == header.end() ? -1 : static_cast<int>(scaled - header.begin());
}

}  // namespace oted
