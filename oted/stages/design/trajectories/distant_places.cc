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

constexpr double kSharesNear[] = {-0.02, -0.005, 0.005, 0.02};  // of the range

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
  std::optional<LevelFit> worst;
  std::optional<Eigen::VectorXd> best;
  double gained = kFewestSureNats;
  for (int i = 0; i < space.size(); ++i) {
    if (!IsPlace(space[i])) continue;
    if (!worst) worst.emplace(fit.WorstExplained(kProbedRows, explained_alone));
    std::vector<double> z = fit.z();
    const double present = z[static_cast<size_t>(i)];
    std::vector<double> values;
    for (const double share : kSharesOff) values.push_back(ValueOff(space[i], share));
    // Through contact the cost is rough, and a descent ends in its first hollow.
    for (const double share : kSharesNear) values.push_back(present + share * (space[i].high - space[i].low));
    for (const double value : values) {
      z[static_cast<size_t>(i)] = std::clamp(value, space[i].low, space[i].high);
      Eigen::VectorXd x = fit.x();
      x[i] = ZToLogit(space, z)[static_cast<size_t>(i)];
      const double nats = -worst->NatsLostAt(x, fit.x());
      if (!(nats > gained)) continue;
      gained = nats;
      best = x;
    }
  }
  return best;
}

}  // namespace oted
