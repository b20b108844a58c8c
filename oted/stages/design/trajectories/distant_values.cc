#include "oted/stages/design/trajectories/distant_values.h"

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

constexpr int kMostHalvings = 18;  // of a limit

/// Values at a distance from the nominal one, which `from` is where it is not searched.
std::vector<double> ValuesOff(const ParameterSpec& spec, double from) {
  std::vector<double> values;
  if (IsLimit(spec)) {
    double value = 2 * from;
    for (int k = 0; k <= kMostHalvings; ++k, value /= 2) {
      if (value != from && spec.low < value && value < spec.high) values.push_back(value);
    }
    return values;
  }
  for (const double share : kSharesOff) {
    const double end = share < 0 ? spec.low : spec.high;
    values.push_back(spec.nominal + std::abs(share) * (end - spec.nominal));
  }
  return values;
}

}  // namespace

bool IsLimit(const ParameterSpec& spec) {
  const bool is_range = spec.field.ends_with("/forcerange") || spec.field.ends_with("/actfrcrange");
  return spec.field.ends_with("/force_limit") || (spec.IsMultiple() && is_range);
}

bool IsDistant(const ParameterSpec& spec) { return IsPlace(spec) || IsLimit(spec); }

bool IsAtLowEnd(const ParameterSpec& spec) {
  constexpr double kNearly = 0.01;  // of the range
  return spec.nominal - spec.low < kNearly * (spec.high - spec.low);
}

bool IsShift(const ParameterSpec& spec) { return !spec.IsMultiple() && !IsAtLowEnd(spec) && spec.nominal < spec.high; }

bool IsPlace(const ParameterSpec& spec) { return IsShift(spec) && spec.field.find("/pos[") != std::string::npos; }

std::vector<Suspect> FindDistant(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider) {
  const LevelFit worst = fit.WorstExplained(kProbedRows, false);
  std::vector<double> z = fit.z();
  const size_t n_searched = z.size();
  for (const ParameterSpec& spec : specs) z.push_back(spec.nominal);
  const LevelFit::Gained gained(worst, wider, z);
  std::vector<Suspect> found;
  for (size_t k = 0; k < specs.size(); ++k) {
    Suspect best{.spec = specs[k], .value = specs[k].nominal};
    for (const double value : ValuesOff(specs[k], specs[k].nominal)) {
      std::vector<double> moved = z;
      moved[n_searched + k] = value;
      const double nats = gained.At(moved);
      if (nats > best.explains) {
        best.explains = nats;
        best.value = value;
      }
      // Where a limit makes windows less likely, a lower one makes them even less so.
      if (IsLimit(specs[k]) && value < specs[k].nominal && nats < -kFewestSureNats) break;
    }
    if (best.explains > kFewestSureNats) found.push_back(std::move(best));
  }
  std::ranges::stable_sort(found, std::ranges::greater(), &Suspect::explains);
  return found;
}

std::optional<Eigen::VectorXd> WithDistantMoved(const LevelFit& fit, const ParameterSpace& space,
                                                bool explained_alone) {
  const std::vector<double> z = fit.z();
  std::vector<std::vector<double>> values;
  for (size_t i = 0; i < z.size(); ++i) {
    const ParameterSpec& spec = space[static_cast<int>(i)];
    if (!IsDistant(spec)) continue;
    const auto add = [&](double value) {
      values.push_back(z);
      values.back()[i] = std::clamp(value, spec.low, spec.high);
    };
    for (const double value : ValuesOff(spec, z[i])) add(value);
    if (!IsPlace(spec)) continue;
    // Through contact the cost is rough, and a descent ends in its first hollow.
    for (const double share : kSharesNear) add(z[i] + share * (spec.high - spec.low));
  }
  if (values.empty()) return std::nullopt;
  const LevelFit worst = fit.WorstExplained(kProbedRows, explained_alone);
  const LevelFit::Gained of_worst(worst);
  std::vector<double> gained;
  for (const std::vector<double>& moved : values) gained.push_back(of_worst.At(moved));
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
