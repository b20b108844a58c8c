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
  double nominal = 0;
};

constexpr const char* kDelayWord = "delay";
constexpr Quantity kObservationQuantities[] = {
    {"noise_std", ChannelQuantity::kNoiseStd, "standard deviation of white noise on the sensor's reading"},
    {"bias", ChannelQuantity::kBias, "constant offset of the sensor's reading"},
    {"scale", ChannelQuantity::kScale, "factor of the sensor's reading, as of an encoder's gear", 1},
    {kDelayWord, ChannelQuantity::kObservationDelay, "age of the sensor's reading"},
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
  if (field.quantity == ChannelQuantity::kScale) return "";
  const bool reading = field.quantity == ChannelQuantity::kNoiseStd || field.quantity == ChannelQuantity::kBias;
  return reading ? CommonUnit(spec, field.channels) : kSteps;
}

/// One per number, "#k" where there is none.
std::vector<std::string> AllNames(std::vector<std::string> names, int n) {
  for (int k = static_cast<int>(names.size()); k < n; ++k) names.push_back(fmt::format("#{}", k));
  return names;
}

std::vector<std::string> ObservationNames(const SimulatorSpec& spec) {
  return AllNames(spec.observation_names, spec.obs_dim());
}

std::vector<std::string> ActionNames(const SimulatorSpec& spec) { return AllNames(spec.action_names, spec.act_dim); }

/// @param kind  what the names are of
std::vector<int> Match(const std::vector<std::string>& names, std::string_view pattern, const char* kind,
                       const std::string& path) {
  std::vector<int> by_name, by_number;
  for (int k = 0; k < static_cast<int>(names.size()); ++k) {
    if (MatchesGlob(pattern, names[static_cast<size_t>(k)])) by_name.push_back(k);
    if (pattern == std::to_string(k) || pattern == fmt::format("#{}", k)) by_number.push_back(k);
  }
  if (!by_name.empty()) return by_name;
  if (!by_number.empty()) return by_number;
  throw UsageError(fmt::format("parameter path '{}': no {} matches '{}'{}; there are {}", path, kind, pattern,
                               DidYouMean(pattern, names), fmt::join(names, ", ")));
}

/// @param first, last  of the path's slashes
ChannelField ResolveAction(const SimulatorSpec& spec, const std::string& path, size_t first, size_t last) {
  if (first == std::string::npos || path.substr(last + 1) != kDelayWord) {
    throw UsageError(fmt::format("parameter path '{}': of actions there are action/delay and action/NAME/delay", path));
  }
  const std::string name = first == last ? "*" : path.substr(first + 1, last - first - 1);
  return {ChannelQuantity::kActionDelay, Match(ActionNames(spec), name, "action", path)};
}

/// One path that nothing is tied to.
ChannelField ResolveOne(const SimulatorSpec& spec, const std::string& path) {
  const size_t first = path.find('/'), last = path.rfind('/');
  if (path.starts_with("action")) return ResolveAction(spec, path, first, last);
  std::vector<std::string> words;
  for (const Quantity& q : kObservationQuantities) words.emplace_back(q.word);
  if (first == std::string::npos || first == last) {
    throw UsageError(fmt::format("parameter path '{}': wanted obs/NAME/{}, with * for every observation", path,
                                 fmt::join(words, ", obs/NAME/")));
  }
  for (const Quantity& q : kObservationQuantities) {
    if (path.substr(last + 1) != q.word) continue;
    const std::string_view name = std::string_view(path).substr(first + 1, last - first - 1);
    return {q.quantity, Match(ObservationNames(spec), name, "observation", path)};
  }
  throw UsageError(fmt::format("parameter path '{}': an observation has no '{}'{}; it has {}", path,
                               path.substr(last + 1), DidYouMean(path.substr(last + 1), words),
                               fmt::join(words, ", ")));
}

}  // namespace

bool IsSensorNoise(const std::string& path) { return path.starts_with("obs/") && path.ends_with("/noise_std"); }
bool IsSensorBias(const std::string& path) { return path.starts_with("obs/") && path.ends_with("/bias"); }
bool IsSensorScale(const std::string& path) { return path.starts_with("obs/") && path.ends_with("/scale"); }

bool IsChannelPath(const std::string& path) {
  const std::string word = path.substr(0, path.find('/'));
  return word == "action" || word == "obs";
}

ChannelField ResolveChannel(const SimulatorSpec& spec, const std::string& path) {
  const std::vector<std::string> tied = TiedPaths(path);
  ChannelField field = ResolveOne(spec, tied.front());
  for (size_t k = 1; k < tied.size(); ++k) {
    const ChannelField other = ResolveOne(spec, tied[k]);
    if (other.quantity != field.quantity) {
      throw UsageError(
          fmt::format("parameter path '{}': '{}' is of another kind than '{}'; tie paths that end in one word", path,
                      tied[k], tied.front()));
    }
    field.channels.insert(field.channels.end(), other.channels.begin(), other.channels.end());
  }
  std::ranges::sort(field.channels);
  const auto twice = std::ranges::unique(field.channels);
  field.channels.erase(twice.begin(), twice.end());
  return field;
}

ChannelField ResolveChannelParameter(const SimulatorSpec& spec, ParameterSpec& parameter) {
  const ChannelField field = ResolveChannel(spec, parameter.field);
  const bool is_factor = field.quantity == ChannelQuantity::kScale;
  if (is_factor && !parameter.IsMultiple()) {
    throw UsageError(fmt::format("parameter '{}': '{}' is a factor, nominally 1; leave scale = \"absolute\" out",
                                 parameter.name, parameter.field));
  }
  if (!is_factor && parameter.IsMultiple()) {
    throw UsageError(
        fmt::format("parameter '{}': the nominal value of '{}' is 0 and has no multiples; set scale = \"absolute\" "
                    "(':absolute' on the command line)",
                    parameter.name, parameter.field));
  }
  const double nominal = is_factor ? 1 : 0;
  if (parameter.low > nominal || parameter.high < nominal) {
    throw UsageError(
        fmt::format("parameter '{}': got bounds [{}, {}] for '{}', wanted a range that holds {}, its value in the "
                    "nominal simulator{}",
                    parameter.name, parameter.low, parameter.high, parameter.field, nominal,
                    parameter.logarithmic && !is_factor ? "; drop 'log'" : ""));
  }
  if (is_factor && !(parameter.low > 0)) {
    throw UsageError(
        fmt::format("parameter '{}': got the lower bound {}, wanted a factor above 0; data.scale turns signs",
                    parameter.name, parameter.low));
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
  parameter.nominal = nominal;
  if (!is_factor) parameter.unit = UnitOf(spec, field);
  return field;
}

PathInfo DescribeChannel(const SimulatorSpec& spec, const std::string& path) {
  const ChannelField field = ResolveChannel(spec, path);
  PathInfo info;
  info.unit = UnitOf(spec, field);
  if (field.quantity == ChannelQuantity::kActionDelay) {
    const std::vector<std::string> names = ActionNames(spec);
    for (const int k : field.channels) {
      info.places.push_back({fmt::format("action/{}/{}", names[static_cast<size_t>(k)], kDelayWord), 0.0});
    }
    info.meaning = kActionDelayMeaning;
    return info;
  }
  const std::vector<std::string> names = ObservationNames(spec);
  for (const Quantity& q : kObservationQuantities) {
    if (q.quantity != field.quantity) continue;
    info.meaning = q.meaning;
    for (const int j : field.channels) {
      info.places.push_back({fmt::format("obs/{}/{}", names[static_cast<size_t>(j)], q.word), q.nominal});
    }
  }
  return info;
}

std::vector<ParameterOffer> ChannelOffers(const SimulatorSpec& spec) {
  const PathInfo delay = DescribeChannel(spec, "action/delay");
  std::vector<ParameterOffer> offers = {{"action", "action/delay", delay.unit, delay.meaning, {{"action/delay", 0}}}};
  if (spec.act_dim > 1) offers.push_back({"action", "action/NAME/delay", delay.unit, delay.meaning, delay.places});
  for (const Quantity& q : kObservationQuantities) {
    const PathInfo info = DescribeChannel(spec, fmt::format("obs/*/{}", q.word));
    offers.push_back({"obs", fmt::format("obs/NAME/{}", q.word), info.unit, info.meaning, info.places});
  }
  return offers;
}

}  // namespace oted
