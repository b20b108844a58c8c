#include "oted/stages/design/trajectories/distant_places.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "oted/matching/verdict.h"

namespace oted {
namespace {

constexpr int kProbedRows = 240;
constexpr double kSharesOff[] = {-0.5, -0.25, -0.12, 0.12, 0.25, 0.5};  // of the way to an end of the range

double ValueOff(const ParameterSpec& place, double share) {
  const double end = share < 0 ? place.low : place.high;
  return place.nominal + std::abs(share) * (end - place.nominal);
}

}  // namespace

bool IsPlace(const ParameterSpec& spec) {
  return !spec.IsMultiple() && spec.low < spec.nominal && spec.nominal < spec.high &&
         spec.field.find("/pos[") != std::string::npos;
}

std::vector<Suspect> FindDistantPlaces(const std::vector<ParameterSpec>& places, const LevelFit& fit,
                                       WindowReplayer& wider) {
  const LevelFit worst = fit.WorstExplained(kProbedRows);
  std::vector<double> nominal;
  for (const ParameterSpec& place : places) nominal.push_back(place.nominal);
  std::vector<Suspect> off;
  std::vector<std::vector<double>> values;
  for (size_t k = 0; k < places.size(); ++k) {
    for (const double share : kSharesOff) {
      off.push_back({.spec = places[k], .value = ValueOff(places[k], share)});
      values.push_back(nominal);
      values.back()[k] = off.back().value;
    }
  }
  const std::vector<double> gained = worst.NatsGainedIn(wider, nominal, values);
  for (size_t k = 0; k < off.size(); ++k) off[k].explains = gained[k];
  std::ranges::stable_sort(off, std::ranges::greater(), &Suspect::explains);
  std::vector<Suspect> found;
  for (Suspect& suspect : off) {
    const auto is_it = [&](const Suspect& other) { return other.spec.field == suspect.spec.field; };
    if (suspect.explains > kFewestSureNats && std::ranges::none_of(found, is_it)) found.push_back(std::move(suspect));
  }
  return found;
}

}  // namespace oted
