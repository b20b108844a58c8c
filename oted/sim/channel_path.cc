#include "oted/sim/channel_path.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/base/glob.h"

namespace oted {
namespace {

struct Quantity {
  const char* word;
  ChannelQuantity quantity;
  const char* meaning;
};

constexpr Quantity kObservationQuantities[] = {
    {"noise_std", ChannelQuantity::kNoiseStd, "standard deviation of white noise on the sensor's reading"},
    {"bias", ChannelQuantity::kBias, "constant offset of the sensor's reading"},
    {"delay", ChannelQuantity::kObservationDelay, "age of the sensor's reading"},
};
constexpr const char* kActionDelayMeaning = "time from a command to its effect";
constexpr const char* kSteps = "control steps";
constexpr const char* kObservationUnit = "unit of the observation";

/// The unit that all of them have in common.
std::string CommonUnit(const SimulatorSpec& spec, const std::vector<int>& observations) {
  if (spec.observation_units.empty()) return kObservationUnit;
  const std::string& first = spec.observation_units[static_cast<size_t>(observations.front())];
  const bool same = std::all_of(observations.begin(), observations.end(),
                                [&](int j) { return spec.observation_units[static_cast<size_t>(j)] == first; });
  return same && !first.empty() ? first : kObservationUnit;
}

std::string UnitOf(const SimulatorSpec& spec, const ChannelField& field) {
  const bool reading = field.quantity == ChannelQuantity::kNoiseStd || field.quantity == ChannelQuantity::kBias;
  return reading ? CommonUnit(spec, field.observations) : kSteps;
}

std::string NameOf(const SimulatorSpec& spec, int observation) {
  const size_t j = static_cast<size_t>(observation);
  return spec.observation_names.empty() ? fmt::format("#{}", observation) : spec.observation_names[j];
}

std::vector<int> MatchObservations(const SimulatorSpec& spec, std::string_view pattern, const std::string& path) {
  std::vector<int> by_name, by_number;
  std::vector<std::string> names;
  for (int j = 0; j < spec.obs_dim(); ++j) {
    names.push_back(NameOf(spec, j));
    if (MatchesGlob(pattern, names.back())) by_name.push_back(j);
    if (pattern == std::to_string(j) || pattern == fmt::format("#{}", j)) by_number.push_back(j);
  }
  if (!by_name.empty()) return by_name;
  if (!by_number.empty()) return by_number;
  throw UsageError(fmt::format("parameter path '{}': no observation matches '{}'{}; there are {}", path, pattern,
                               DidYouMean(pattern, names), fmt::join(names, ", ")));
}

}  // namespace

bool IsSensorNoise(const std::string& path) { return path.starts_with("obs/") && path.ends_with("/noise_std"); }
bool IsSensorBias(const std::string& path) { return path.starts_with("obs/") && path.ends_with("/bias"); }

bool IsChannelPath(const std::string& path) {
  const std::string word = path.substr(0, path.find('/'));
  return word == "action" || word == "obs";
}

ChannelField ResolveChannel(const SimulatorSpec& spec, const std::string& path) {
  const size_t first = path.find('/'), last = path.rfind('/');
  if (path == "action/delay") return {ChannelQuantity::kActionDelay, {}};
  if (path.starts_with("action")) {
    throw UsageError(fmt::format("parameter path '{}': of actions there is action/delay alone", path));
  }
  if (first == std::string::npos || first == last) {
    throw UsageError(fmt::format(
        "parameter path '{}': wanted obs/NAME/noise_std, obs/NAME/bias or obs/NAME/delay, with * for every observation",
        path));
  }
  std::vector<std::string> words;
  for (const Quantity& q : kObservationQuantities) {
    words.emplace_back(q.word);
    if (path.substr(last + 1) != q.word) continue;
    return {q.quantity, MatchObservations(spec, std::string_view(path).substr(first + 1, last - first - 1), path)};
  }
  throw UsageError(fmt::format("parameter path '{}': an observation has no '{}'{}; it has {}", path,
                               path.substr(last + 1), DidYouMean(path.substr(last + 1), words),
                               fmt::join(words, ", ")));
}

ChannelField ResolveChannelParameter(const SimulatorSpec& spec, ParameterSpec& parameter) {
  const ChannelField field = ResolveChannel(spec, parameter.field);
  if (parameter.scale != ParameterScale::kAbsolute) {
    throw UsageError(
        fmt::format("parameter '{}': the nominal value of '{}' is 0 and has no multiples; set scale = \"absolute\" "
                    "(':absolute' on the command line)",
                    parameter.name, parameter.field));
  }
  if (parameter.low > 0 || parameter.high < 0) {
    throw UsageError(fmt::format(
        "parameter '{}': got bounds [{}, {}] for '{}', wanted a range that holds 0, its value in the "
        "nominal simulator{}",
        parameter.name, parameter.low, parameter.high, parameter.field, parameter.logarithmic ? "; drop 'log'" : ""));
  }
  if (parameter.low < 0 && field.quantity != ChannelQuantity::kBias) {
    throw UsageError(fmt::format("parameter '{}': got the lower bound {}, wanted 0: '{}' cannot be negative",
                                 parameter.name, parameter.low, parameter.field));
  }
  constexpr double kLongestDelay = 1000;  // [control steps]: what is remembered per lane grows with it
  if (parameter.high > kLongestDelay && UnitOf(spec, field) == kSteps) {
    throw UsageError(fmt::format("parameter '{}': got a delay of up to {} control steps, wanted {} at most",
                                 parameter.name, parameter.high, kLongestDelay));
  }
  parameter.nominal = 0;
  parameter.unit = UnitOf(spec, field);
  return field;
}

PathInfo DescribeChannel(const SimulatorSpec& spec, const std::string& path) {
  const ChannelField field = ResolveChannel(spec, path);
  PathInfo info;
  info.unit = UnitOf(spec, field);
  if (field.quantity == ChannelQuantity::kActionDelay) {
    info.places = {{path, 0.0}};
    info.meaning = kActionDelayMeaning;
    return info;
  }
  for (const Quantity& q : kObservationQuantities) {
    if (q.quantity != field.quantity) continue;
    info.meaning = q.meaning;
    for (const int j : field.observations) {
      info.places.push_back({fmt::format("obs/{}/{}", NameOf(spec, j), q.word), 0.0});
    }
  }
  return info;
}

std::vector<ParameterOffer> ChannelOffers(const SimulatorSpec& spec) {
  std::vector<ParameterOffer> offers = {{"action", "action/delay", kSteps, kActionDelayMeaning, {{"action/delay", 0}}}};
  for (const Quantity& q : kObservationQuantities) {
    const PathInfo info = DescribeChannel(spec, fmt::format("obs/*/{}", q.word));
    offers.push_back({"obs", fmt::format("obs/NAME/{}", q.word), info.unit, info.meaning, info.places});
  }
  return offers;
}

}  // namespace oted
