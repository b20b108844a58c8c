#include "oted/stages/design/trajectories/mirrored_values.h"

#include <cmath>

#include "oted/matching/verdict.h"

namespace oted {
namespace {

constexpr double kApart = 2.0;   // standard deviations from 0: nearer, the interval holds both sides anyhow
constexpr double kDenied = 4.0;  // nats by which the windows are surely less likely

/// Whether its negative is another value, which the search allows.
bool HasOtherSide(const ParameterSpec& spec, double z, double std) {
  return !spec.IsMultiple() && spec.low < -z && -z < spec.high && std::abs(z) > kApart * std;
}

}  // namespace

std::vector<MirroredValue> FindMirrored(const LevelFit& fit, const Designer& q) {
  const std::vector<double> mode = q.Mode(), std = q.Std();
  const std::vector<Designer::Interval> intervals = q.CentralInterval(kIntervalMass);
  std::vector<int> sided;
  for (int i = 0; i < q.size(); ++i) {
    if (HasOtherSide(q.space()[i], mode[static_cast<size_t>(i)], std[static_cast<size_t>(i)])) sided.push_back(i);
  }
  const auto x = Eigen::Map<const Eigen::VectorXd>(q.mean().data(), q.size());
  const auto is_alike = [&](const std::vector<int>& turned) {
    std::vector<double> z = mode;
    for (const int i : turned) z[static_cast<size_t>(i)] *= -1;
    const std::vector<double> there = ZToLogit(q.space(), z);
    return !(fit.NatsLostAt(Eigen::Map<const Eigen::VectorXd>(there.data(), q.size()), x) > kDenied);
  };
  std::vector<int> alike;
  for (const int i : sided) {
    if (is_alike({i})) alike.push_back(i);
  }
  if (alike.empty() && sided.size() > 1 && is_alike(sided)) alike = sided;
  std::vector<MirroredValue> mirrored;
  for (const int i : alike) {
    const Designer::Interval& interval = intervals[static_cast<size_t>(i)];
    mirrored.push_back({.parameter = i, .interval90 = {-interval.high, -interval.low}});
  }
  return mirrored;
}

}  // namespace oted
