#include "oted/checks/correction_candidates.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "oted/base/angle.h"
#include "oted/data/checks_rates.h"

namespace oted {
namespace {

constexpr double kCorrelated = 0.6, kBeyond = 3;  // a velocity with its position; an action, times its bound
constexpr double kThousandth = 1e-3, kHundredth = 1e-2;
constexpr double kSmallestZero = 0.02;  // [rad]; [m]: a tenth

class CandidateList {
 public:
  CandidateList(const SimulatorSpec& spec, const ReplayedWindows& windows, const std::vector<LoggedJoint>& joints)
      : spec_(spec), windows_(windows), joints_(joints) {}

  std::vector<Correction> All(const ChannelErrors& now) const {
    std::vector<LoggedJoint> bad;
    for (const LoggedJoint& joint : joints_) {
      if (MeanOf(now, joint.Channels()) > kGoodError * kGoodError) bad.push_back(joint);
    }
    std::ranges::sort(bad, [&](const LoggedJoint& x, const LoggedJoint& y) {
      return MeanOf(now, x.Channels()) > MeanOf(now, y.Channels());
    });
    if (bad.size() > kMostAskedJoints) bad.resize(kMostAskedJoints);
    std::vector<Correction> all;
    for (const LoggedJoint& joint : bad) AddOfJoint(joint, all);
    AddDegrees(all);
    for (size_t i = 0; i < bad.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        const bool in_order = bad[k].position < bad[i].position;  // as the task names them
        AddSwaps(bad[in_order ? k : i], bad[in_order ? i : k], all);
      }
    }
    for (const TurningBody& body : spec_.bodies) {
      if (!windows_.states.empty() || std::ranges::any_of(body.orientation, [](int j) { return j < 0; })) continue;
      const std::vector<int> columns(body.orientation.begin(), body.orientation.end());
      all.push_back({CorrectionKind::kQuaternionOrder, columns, 0, columns});
    }
    if (spec_.n_discrete_actions > 0) return all;
    for (int a = 0; a < spec_.act_dim; ++a) {
      all.push_back({CorrectionKind::kActionSign, {a}});
      for (int b = 0; b < a; ++b) all.push_back({CorrectionKind::kActionSwap, {b, a}});
    }
    AddActionUnits(all);
    return all;
  }

 private:
  /// Of actions far beyond their range: degrees, thousandths or percent.
  void AddActionUnits(std::vector<Correction>& all) const {
    std::vector<int> beyond;
    for (int a = 0; a < spec_.act_dim; ++a) {
      const auto k = static_cast<size_t>(a);
      const double bound = std::max(std::abs(spec_.action_low[k]), std::abs(spec_.action_high[k]));
      double largest = 0;
      for (int i = 0; i < windows_.log.size(); ++i) largest = std::max(largest, std::abs(windows_.log.actions(i, a)));
      if (largest > kBeyond * bound) beyond.push_back(a);
    }
    if (beyond.empty()) return;
    for (const double unit : {kDegree, kThousandth, kHundredth}) {
      all.push_back({CorrectionKind::kActionUnit, beyond, unit});
    }
  }

  void AddOfJoint(const LoggedJoint& joint, std::vector<Correction>& all) const {
    const std::vector<int> both = joint.Channels();
    std::vector<std::vector<int>> sets;
    if (joint.agree) {
      sets = {both};
    } else {
      sets = {{joint.position}, {joint.velocity}, both};
    }
    const double unit = InMetres(joint) ? kThousandth : kDegree;
    for (const auto& columns : sets) {
      all.push_back({CorrectionKind::kSign, columns, 0, both});
      // Never the reverse: a motion made 57 times as fast hides what moves it, and so every other defect. The unit of
      // one of the two shows only where they move together: what stands still is predicted better the smaller it is.
      if (joint.correlated) all.push_back({CorrectionKind::kUnit, columns, unit, both});
    }
    if (joint.agree) {
      // No factors of a gear, such as 2: a motion twice as fast looks like half of the mass, or twice the gain.
      if (InMetres(joint)) all.push_back({CorrectionKind::kUnit, both, kHundredth, both});
    }
    for (const double size : {1.0, 2.5, 5.0, 10.0, 20.0}) {
      for (const double sign : {-1.0, 1.0}) {
        all.push_back({CorrectionKind::kZero, {joint.position}, sign * size * SmallestZero(joint), {both.back()}});
      }
    }
  }

  /// All turning joints in degrees: one alone that is put right still moves among others that are not.
  void AddDegrees(std::vector<Correction>& all) const {
    std::vector<int> turning;
    int n = 0;
    for (const LoggedJoint& joint : joints_) {
      if (InMetres(joint) || !joint.correlated) continue;
      std::ranges::copy(joint.Channels(), std::back_inserter(turning));
      ++n;
    }
    if (n > 1) all.push_back({CorrectionKind::kUnit, turning, kDegree, turning});
  }

  bool InMetres(const LoggedJoint& joint) const {
    const size_t p = static_cast<size_t>(joint.position);
    return p < spec_.observation_units.size() && spec_.observation_units[p] == "m";
  }
  double SmallestZero(const LoggedJoint& joint) const { return InMetres(joint) ? kSmallestZero / 10 : kSmallestZero; }

  static void AddSwaps(const LoggedJoint& x, const LoggedJoint& y, std::vector<Correction>& all) {
    if (x.velocity < 0 || y.velocity < 0) {
      if (x.velocity != y.velocity) return;
      all.push_back({CorrectionKind::kSwap, {x.position, y.position}, 0, {x.position, y.position}});
      return;
    }
    const std::vector<int> judged = {x.position, x.velocity, y.position, y.velocity};
    all.push_back({CorrectionKind::kSwap, {x.position, y.position, x.velocity, y.velocity}, 0, judged});
    if (x.agree || y.agree) return;
    all.push_back({CorrectionKind::kSwap, {x.position, y.position}, 0, judged});
    all.push_back({CorrectionKind::kSwap, {x.velocity, y.velocity}, 0, judged});
  }

  const SimulatorSpec& spec_;
  const ReplayedWindows& windows_;
  const std::vector<LoggedJoint>& joints_;
};

}  // namespace

std::vector<LoggedJoint> JointsOf(const Dataset& dataset, const SimulatorSpec& spec, bool guesses_rates) {
  std::vector<LoggedJoint> joints;
  for (const RateAgreement& rate : CompareRates(dataset, spec.rate_of, spec.control_period_s)) {
    const double factor = spec.control_period_s > 0 ? rate.slope / spec.control_period_s : 1;
    const bool agree = rate.correlation > kCorrelated && std::abs(factor - 1) < 0.3;
    joints.push_back({rate.position, rate.velocity, agree, std::abs(rate.correlation) > kCorrelated});
  }
  if (!guesses_rates) return joints;
  for (const HiddenCoordinate& hidden : spec.hidden) {
    if (hidden.rate_of >= 0) joints.push_back({.position = hidden.rate_of});
  }
  return joints;
}

std::vector<Correction> CandidateCorrections(const SimulatorSpec& spec, const ReplayedWindows& windows,
                                             const std::vector<LoggedJoint>& joints, const ChannelErrors& now) {
  return CandidateList(spec, windows, joints).All(now);
}

}  // namespace oted
