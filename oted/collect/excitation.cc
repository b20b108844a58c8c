#include "oted/collect/excitation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <sstream>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr int kSines = 5;
constexpr double kLowestFrequency = 0.1;  // [Hz]

double Positive(const std::string& text, const std::string& whole) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value) || value <= 0) {
    throw UsageError(
        fmt::format("policy '{}': got '{}', wanted a number above 0, as in noise:0.3:0.2 or sine:0.8", whole, text));
  }
  return value;
}

}  // namespace

std::optional<Excitation> Excitation::Parse(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ':');) parts.push_back(part);
  if (parts.empty()) return std::nullopt;
  Excitation excitation;
  size_t most = 1;
  if (parts[0] == "noise") {
    excitation.kind = Kind::kNoise;
    excitation.amplitude = 0.3;
    most = 3;
  } else if (parts[0] == "sine") {
    excitation.kind = Kind::kSine;
    most = 2;
  } else if (parts[0] != "random") {
    return std::nullopt;
  }
  if (parts.size() > most || text.ends_with(':')) {
    throw UsageError(fmt::format("policy '{}': wanted random, noise:STD[:SECONDS] or sine[:AMPLITUDE]", text));
  }
  if (parts.size() > 1) excitation.amplitude = Positive(parts[1], text);
  if (parts.size() > 2) excitation.correlation_time = Positive(parts[2], text);
  return excitation;
}

OpenLoop::OpenLoop(const Excitation& excitation, const SimulatorSpec& spec, RngKey key)
    : excitation_(excitation), spec_(spec), rng_(key.MakeRng()), noise_(spec.action_low.size()) {
  if (excitation.kind == Excitation::Kind::kNoise) {
    for (double& x : noise_) x = excitation.amplitude * rng_.Normal();
  }
  if (excitation.kind != Excitation::Kind::kSine) return;
  const double highest = std::max(2 * kLowestFrequency, 1 / (8 * spec.control_period_s));
  sines_.resize(spec.action_low.size());
  for (std::vector<Sine>& sines : sines_) {
    for (int k = 0; k < kSines; ++k) {
      sines.push_back({std::exp(rng_.Uniform(std::log(kLowestFrequency), std::log(highest))),
                       rng_.Uniform(0, 2 * std::numbers::pi)});
    }
  }
}

void OpenLoop::Next(std::span<double> action) {
  const double time = step_++ * spec_.control_period_s;
  const double keep = std::exp(-spec_.control_period_s / excitation_.correlation_time);
  for (size_t i = 0; i < action.size(); ++i) {
    const double low = spec_.action_low[i], high = spec_.action_high[i];
    if (excitation_.kind == Excitation::Kind::kRandom) {
      action[i] = rng_.Uniform(low, high);
      continue;
    }
    double x = 0;
    if (excitation_.kind == Excitation::Kind::kSine) {
      for (const Sine& sine : sines_[i]) x += std::sin(2 * std::numbers::pi * sine.frequency * time + sine.phase);
      x *= excitation_.amplitude / kSines;
    } else {
      x = noise_[i];
      // The exact transition of the process over one control period.
      noise_[i] = keep * x + excitation_.amplitude * std::sqrt(1 - keep * keep) * rng_.Normal();
    }
    action[i] = std::clamp((low + high) / 2 + (high - low) / 2 * x, low, high);
  }
}

}  // namespace oted
