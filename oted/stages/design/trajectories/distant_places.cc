#include "oted/stages/design/trajectories/distant_places.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "oted/matching/designer.h"
#include "oted/matching/verdict.h"

namespace oted {
namespace {

constexpr int kProbedRows = 240;
constexpr double kSharesOff[] = {-0.5, -0.25, -0.12, 0.12, 0.25, 0.5};  // of the way to an end of the range
constexpr double kSharesNear[] = {-0.02, -0.005, 0.005, 0.02};          // of the range

double ValueOff(const ParameterSpec& place, double share) {
  const double end = share < 0 ? place.low : place.high;
  return place.nominal + std::abs(share) * (end - place.nominal);
}

}  // namespace

bool IsShift(const ParameterSpec& spec) {
  return !spec.IsMultiple() && spec.low < spec.nominal && spec.nominal < spec.high;
}

bool IsPlace(const ParameterSpec& spec) { return IsShift(spec) && spec.field.find("/pos[") != std::string::npos; }

std::vector<Suspect> FindDistantPlaces(const std::vector<ParameterSpec>& places, const LevelFit& fit,
                                       WindowReplayer& wider) {
  const LevelFit worst = fit.WorstExplained(kProbedRows, false);
  std::vector<double> z = fit.z();
  const size_t n_searched = z.size();
  for (const ParameterSpec& place : places) z.push_back(place.nominal);
  std::vector<Suspect> off;
  std::vector<std::vector<double>> values;
  for (size_t k = 0; k < places.size(); ++k) {
    for (const double share : kSharesOff) {
      off.push_back({.spec = places[k], .value = ValueOff(places[k], share)});
      values.push_back(z);
      values.back()[n_searched + k] = off.back().value;
    }
  }
  const std::vector<double> gained = worst.NatsGainedIn(wider, z, values);
  for (size_t k = 0; k < off.size(); ++k) off[k].explains = gained[k];
  std::ranges::stable_sort(off, std::ranges::greater(), &Suspect::explains);
  std::vector<Suspect> found;
  for (Suspect& suspect : off) {
    const auto is_it = [&](const Suspect& other) { return other.spec.field == suspect.spec.field; };
    if (suspect.explains > kFewestSureNats && std::ranges::none_of(found, is_it)) found.push_back(std::move(suspect));
  }
  return found;
}

std::optional<Eigen::VectorXd> WithPlaceMoved(const LevelFit& fit, const ParameterSpace& space, bool explained_alone) {
  const std::vector<double> z = fit.z();
  std::vector<std::vector<double>> values;
  for (size_t i = 0; i < z.size(); ++i) {
    const ParameterSpec& spec = space[static_cast<int>(i)];
    if (!IsPlace(spec)) continue;
    const auto add = [&](double value) {
      values.push_back(z);
      values.back()[i] = std::clamp(value, spec.low, spec.high);
    };
    for (const double share : kSharesOff) add(ValueOff(spec, share));
    // Through contact the cost is rough, and a descent ends in its first hollow.
    for (const double share : kSharesNear) add(z[i] + share * (spec.high - spec.low));
  }
  if (values.empty()) return std::nullopt;
  const std::vector<double> gained = fit.WorstExplained(kProbedRows, explained_alone).NatsGainedAt(values);
  const auto most = std::ranges::max_element(gained);
  if (!(*most > kFewestSureNats)) return std::nullopt;
  const std::vector<double>& moved = values[static_cast<size_t>(most - gained.begin())];
  const std::vector<double> there = ZToLogit(space, moved);
  Eigen::VectorXd x = fit.x();
  for (size_t i = 0; i < z.size(); ++i) {
    if (moved[i] != z[i]) x[static_cast<Eigen::Index>(i)] = there[i];
  }
  return x;
}

}  // namespace oted
