#include "oted/checks/odd_recordings.h"

#include <algorithm>
#include <cstddef>

namespace oted {
namespace {

constexpr double kOdd = 4;  // squared error of a channel, of what is usual

}  // namespace

ChannelErrors UsualErrors(const std::vector<ChannelErrors>& errors, double least) {
  ChannelErrors usual;
  for (const ChannelErrors& some : errors) usual.resize(std::max(usual.size(), some.size()));
  for (size_t j = 0; j < usual.size(); ++j) {
    std::vector<double> values;
    for (const ChannelErrors& some : errors) {
      if (!some.empty()) values.push_back(some[j]);
    }
    const auto at = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 4);
    std::nth_element(values.begin(), at, values.end());
    usual[j] = std::max(*at, least);
  }
  return usual;
}

bool IsOdd(const ChannelErrors& errors, const ChannelErrors& usual) {
  for (size_t j = 0; j < errors.size(); ++j) {
    if (errors[j] > kOdd * usual[j]) return true;
  }
  return false;
}

}  // namespace oted
