#include "oted/sim/parameter_space.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "oted/base/error.h"

namespace oted {
namespace {

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (size_t begin = 0;;) {
    const size_t end = text.find(separator, begin);
    parts.push_back(text.substr(begin, end == std::string_view::npos ? end : end - begin));
    if (end == std::string_view::npos) return parts;
    begin = end + 1;
  }
}

constexpr const char* kForm =
    "write name=path:low:high[:log][:absolute][:prior=MEAN,STD], for example friction=geom/*/friction[0]:0.2:2.0";

double ParseBound(std::string_view text, const std::string& whole) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) {
    throw UsageError(fmt::format("parameter '{}': got bound '{}', wanted a number; {}", whole, text, kForm));
  }
  return value;
}

}  // namespace

void ParameterSpec::Check() const {
  if (name.empty()) throw UsageError(fmt::format("parameter for '{}' has no name; {}", field, kForm));
  if (field.empty()) throw UsageError(fmt::format("parameter '{}' has no field path; {}", name, kForm));
  if (!std::isfinite(low) || !std::isfinite(high) || !(low < high)) {
    throw UsageError(
        fmt::format("parameter '{}': got bounds [{}, {}], wanted finite numbers with low < high", name, low, high));
  }
  if (logarithmic && low <= 0) {
    throw UsageError(fmt::format(
        "parameter '{}': got a logarithmic range with low = {}, wanted low > 0; raise it or drop 'log'", name, low));
  }
  if (prior && !(prior->mean > low && prior->mean < high && prior->std > 0 && std::isfinite(prior->std))) {
    throw UsageError(fmt::format(
        "parameter '{}': got a prior of mean {} and std {}, wanted a mean inside of the range {} to {} and a "
        "std above 0",
        name, prior->mean, prior->std, low, high));
  }
}

std::string UnitOfMultiple(const std::vector<std::string>& others) {
  return others.empty() ? ParameterSpec().unit : fmt::format("x {}", fmt::join(others, " x "));
}

std::vector<std::string> TiedPaths(const std::string& field) {
  constexpr std::string_view kTie = " + ";
  std::vector<std::string> paths;
  for (size_t begin = 0;;) {
    const size_t end = field.find(kTie, begin);
    paths.push_back(field.substr(begin, end == std::string::npos ? end : end - begin));
    if (end == std::string::npos) return paths;
    begin = end + kTie.size();
  }
}

ParameterSpec ParseParameterSpec(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos) throw UsageError(fmt::format("parameter '{}' has no '='; {}", text, kForm));
  const std::vector<std::string_view> parts = Split(std::string_view(text).substr(equals + 1), ':');
  if (parts.size() < 3) throw UsageError(fmt::format("parameter '{}' has no bounds; {}", text, kForm));
  ParameterSpec spec;
  spec.name = text.substr(0, equals);
  spec.field = parts[0];
  spec.low = ParseBound(parts[1], text);
  spec.high = ParseBound(parts[2], text);
  for (size_t i = 3; i < parts.size(); ++i) {
    if (parts[i] == "log") {
      spec.logarithmic = true;
    } else if (parts[i] == "absolute") {
      spec.scale = ParameterScale::kAbsolute;
    } else if (parts[i].starts_with("prior=")) {
      const std::vector<std::string_view> numbers = Split(parts[i].substr(6), ',');
      if (numbers.size() != 2) {
        throw UsageError(fmt::format("parameter '{}': got '{}', wanted prior=MEAN,STD", text, parts[i]));
      }
      spec.prior = ParameterSpec::Belief{ParseBound(numbers[0], text), ParseBound(numbers[1], text)};
    } else {
      throw UsageError(
          fmt::format("parameter '{}': got option '{}', wanted log, absolute or prior=MEAN,STD", text, parts[i]));
    }
  }
  spec.Check();
  return spec;
}

ParameterSpace::ParameterSpace(std::vector<ParameterSpec> specs) : specs_(std::move(specs)) {
  for (size_t i = 0; i < specs_.size(); ++i) {
    specs_[i].Check();
    for (size_t j = 0; j < i; ++j) {
      if (specs_[i].name == specs_[j].name) {
        throw UsageError(fmt::format("parameter '{}' is given twice ('{}' and '{}'); rename one", specs_[i].name,
                                     specs_[j].field, specs_[i].field));
      }
    }
  }
}

std::vector<double> ParameterSpace::Nominal() const {
  std::vector<double> z;
  for (const ParameterSpec& spec : specs_) z.push_back(spec.nominal);
  return z;
}

std::vector<double> ParameterSpace::FromUnit(std::span<const double> u) const {
  OTED_CHECK(u.size() == specs_.size());
  std::vector<double> z(u.size());
  for (size_t i = 0; i < u.size(); ++i) {
    const ParameterSpec& spec = specs_[i];
    const double t = std::clamp(u[i], 0.0, 1.0);
    const double value = spec.logarithmic
                             ? std::exp(std::log(spec.low) + t * (std::log(spec.high) - std::log(spec.low)))
                             : spec.low + t * (spec.high - spec.low);
    // Rounding may miss a bound on either side: a z must be inside, and the ends of the cube are the bounds.
    z[i] = t == 0 ? spec.low : t == 1 ? spec.high : std::clamp(value, spec.low, spec.high);
  }
  return z;
}

std::vector<double> ParameterSpace::ToUnit(std::span<const double> z) const {
  OTED_CHECK(z.size() == specs_.size());
  std::vector<double> u(z.size());
  for (size_t i = 0; i < z.size(); ++i) {
    const ParameterSpec& spec = specs_[i];
    const double value = std::clamp(z[i], spec.low, spec.high);
    u[i] = spec.logarithmic ? (std::log(value) - std::log(spec.low)) / (std::log(spec.high) - std::log(spec.low))
                            : (value - spec.low) / (spec.high - spec.low);
    u[i] = std::clamp(u[i], 0.0, 1.0);
  }
  return u;
}

std::vector<double> ParameterSpace::SampleUniform(Rng& rng) const {
  std::vector<double> u(specs_.size());
  for (double& value : u) value = rng.Uniform();
  return FromUnit(u);
}

void ParameterSpace::CheckInside(std::span<const double> z) const {
  if (z.size() != specs_.size()) {
    throw UsageError(fmt::format("got {} parameter values, wanted {}", z.size(), specs_.size()));
  }
  for (size_t i = 0; i < z.size(); ++i) {
    // Written so that NaN is outside.
    if (!(z[i] >= specs_[i].low && z[i] <= specs_[i].high)) {
      throw UsageError(fmt::format(
          "parameter '{}': got {}{}, wanted a value in [{}, {}]; widen its range or change the value", specs_[i].name,
          z[i], z[i] == specs_[i].nominal ? ", which is its nominal value" : "", specs_[i].low, specs_[i].high));
    }
  }
}

}  // namespace oted
