#include "oted/data/checks_turning.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "oted/base/angle.h"

namespace oted {
namespace {

constexpr int kFewestTurns = 20;
constexpr double kFits = 0.4;    // share of the squared rate that a reading may miss
constexpr double kBetter = 0.5;  // of what the log's own reading misses
constexpr double kFine = 0.1;    // share of the squared rate below which nothing is to be mended

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// How logged numbers may be meant.
struct Reading {
  bool scalar_last = false;  // quaternion x, y, z, w
  bool inverse = false;      // it turns the world into the body
  bool world = false;        // the angular velocity is about the world's axes
  bool IsOwn() const { return !scalar_last && !inverse && !world; }
};

/// Which numbers of an angular velocity are meant: component k is `factor` k times logged number `from` k.
struct RateColumns {
  std::array<int, 3> from = {0, 1, 2};
  Vector3d factor = {1, 1, 1};
  Vector3d operator()(const Vector3d& logged) const {
    return {factor[0] * logged[from[0]], factor[1] * logged[from[1]], factor[2] * logged[from[2]]};
  }
};

Quaterniond OrientationOf(std::span<const double> row, const TurningBody& body, const Reading& reading) {
  const auto number = [&](size_t k) { return row[static_cast<size_t>(body.orientation[k])]; };
  const Quaterniond q = reading.scalar_last ? Quaterniond(number(3), number(0), number(1), number(2))
                                            : Quaterniond(number(0), number(1), number(2), number(3));
  const double norm = q.norm();
  if (!(norm > 1e-6)) return Quaterniond(0, 0, 0, 0);
  const Quaterniond unit(q.coeffs() / norm);
  return reading.inverse ? unit.conjugate() : unit;
}

Vector3d VectorOf(std::span<const double> row, const std::array<int, 3>& at) {
  return {row[static_cast<size_t>(at[0])], row[static_cast<size_t>(at[1])], row[static_cast<size_t>(at[2])]};
}

/// The rotation from a to b as a vector: its axis, its angle [rad] as length.
Vector3d Turn(const Quaterniond& from, const Quaterniond& to, bool world) {
  Quaterniond turn = world ? to * from.conjugate() : from.conjugate() * to;
  if (turn.w() < 0) turn.coeffs() *= -1;
  const Eigen::AngleAxisd axis(turn.normalized());
  return axis.angle() * axis.axis();
}

/// Share of the squared logged rate that a reading misses; 2 where nothing turns.
double Missed(const Dataset& d, const TurningBody& body, const Reading& reading, double period,
              const RateColumns& columns = {}) {
  double missed = 0, all = 0;
  for (int i = 0; i < d.size(); ++i) {
    const auto here = d.observations.row(i), there = d.next_observations.row(i);
    const Quaterniond from = OrientationOf(here, body, reading), to = OrientationOf(there, body, reading);
    if (from.norm() < 0.5 || to.norm() < 0.5) continue;
    const Vector3d rate = columns((VectorOf(here, body.turn) + VectorOf(there, body.turn)) / 2);
    const Vector3d seen = Turn(from, to, reading.world) / period;
    // A single impact must not outweigh the rest.
    missed += std::min((seen - rate).squaredNorm(), 4 * rate.squaredNorm());
    all += rate.squaredNorm();
  }
  return all > 0 ? missed / all : 2;
}

/// The same for positions against linear velocities, along the world's axes or the body's own.
double MissedLinear(const Dataset& d, const TurningBody& body, const Reading& reading, bool in_body, double period) {
  double missed = 0, all = 0;
  for (int i = 0; i < d.size(); ++i) {
    const auto here = d.observations.row(i), there = d.next_observations.row(i);
    const Quaterniond from = OrientationOf(here, body, reading), to = OrientationOf(there, body, reading);
    Vector3d a = VectorOf(here, body.velocity), b = VectorOf(there, body.velocity);
    if (in_body) {
      a = from * a;
      b = to * b;
    }
    for (int k = 0; k < 3; ++k) {
      const int at = body.position[static_cast<size_t>(k)];
      if (at < 0) continue;
      const double change = (there[static_cast<size_t>(at)] - here[static_cast<size_t>(at)]) / period;
      missed += std::pow(change - (a[k] + b[k]) / 2, 2);
      all += change * change;
    }
  }
  return all > 0 ? missed / all : 2;
}

template <size_t n>
bool IsSeen(const std::array<int, n>& at, const Dataset& d) {
  return std::ranges::all_of(at, [&](int j) { return j >= 0 && j < d.obs_dim(); });
}

template <size_t n>
std::vector<std::string> Names(const std::array<int, n>& at, const TaskFacts& facts) {
  std::vector<std::string> names;
  for (const int j : at) {
    if (j >= 0) names.push_back(facts.ObservationName(j));
  }
  return names;
}

void AddReading(const Reading& best, double own, double left, const TurningBody& body, const TaskFacts& facts,
                std::vector<Finding>& findings) {
  const std::vector<std::string> quaternion = Names(body.orientation, facts), turn = Names(body.turn, facts);
  const std::string what = fmt::format(
      "{} to {} and {} to {} disagree: {:.0f} % of the squared rate is missed, {:.0f} % ", quaternion.front(),
      quaternion.back(), turn.front(), turn.back(), 100 * std::min(own, 1.0), 100 * left);
  const auto add = [&](const char* check, const char* as, const char* meaning, std::string remedy,
                       const std::vector<std::string>& channels) {
    findings.push_back({.check = check,
                        .severity = Severity::kWarning,
                        .what = what + as,
                        .count = static_cast<int64_t>(channels.size()),
                        .channels = channels,
                        .meaning = meaning,
                        .remedy = std::move(remedy)});
  };
  if (best.scalar_last) {
    add("quaternion_order", "with the quaternion read as x, y, z, w", "MuJoCo's quaternions are w, x, y, z",
        fmt::format("put {}, the scalar, before the other three", quaternion.back()), quaternion);
  }
  if (best.inverse) {
    add("quaternion_inverse", "with the inverse rotation", "the quaternion turns the world into the body",
        "turn round the signs of its x, y and z", quaternion);
  }
  if (best.world) {
    add("turn_frame", "with the rate about the world's axes",
        "MuJoCo's angular velocities are about the body's own axes",
        "rotate the angular velocity into the body by the quaternion's inverse", turn);
  }
}

/// Signs, places and unit of the three numbers of an angular velocity, where one change of them makes it that of the
/// orientation. @return whether one does
bool AddRateColumns(const Dataset& d, const TurningBody& body, double own, double period, const TaskFacts& facts,
                    std::vector<Finding>& findings) {
  struct Change {
    RateColumns columns;
    const char* check;
    std::vector<int> of;
    std::string remedy;
  };
  const std::vector<std::string> names = Names(body.turn, facts);
  std::vector<Change> changes;
  for (int k = 0; k < 3; ++k) {
    const auto at = static_cast<size_t>(k);
    Change turned{{}, "rate_sign", {k}, fmt::format("turn round the sign of {}", names[at])};
    turned.columns.factor[k] = -1;
    changes.push_back(turned);
    const size_t other = (at + 1) % 3;
    const auto [one, two] = std::minmax(at, other);
    Change swapped{{},
                   "swapped_columns",
                   {static_cast<int>(one), static_cast<int>(two)},
                   fmt::format("swap {} and {}", names[one], names[two])};
    std::swap(swapped.columns.from[one], swapped.columns.from[two]);
    changes.push_back(swapped);
  }
  changes.push_back({{{0, 1, 2}, Vector3d::Constant(kDegree)},
                     "rate_unit",
                     {0, 1, 2},
                     fmt::format("multiply {} by {:.6g}", fmt::join(names, ", "), kDegree)});
  const Change* best = nullptr;
  double left = std::min(kFits, kBetter * own);
  for (const Change& change : changes) {
    const double missed = Missed(d, body, {}, period, change.columns);
    if (missed > left) continue;
    left = missed;
    best = &change;
  }
  if (best == nullptr) return false;
  std::vector<std::string> channels;
  for (const int k : best->of) channels.push_back(names[static_cast<size_t>(k)]);
  findings.push_back(
      {.check = best->check,
       .severity = Severity::kWarning,
       .what = fmt::format("{} miss {:.0f} % of the squared rate at which the quaternion turns, {:.0f} % "
                           "with one change",
                           fmt::join(names, ", "), 100 * std::min(own, 1.0), 100 * left),
       .count = static_cast<int64_t>(channels.size()),
       .channels = channels,
       .meaning = "the angular velocity is not that of the orientation",
       .remedy = best->remedy});
  return true;
}

/// q and -q are one rotation, and drivers change from one to the other as they like.
void AddSignChanges(const Dataset& d, const TurningBody& body, const TaskFacts& facts, std::vector<Finding>& findings) {
  int first = -1, n = 0;
  for (int i = 0; i < d.size(); ++i) {
    const Quaterniond from = OrientationOf(d.observations.row(i), body, {});
    const Quaterniond to = OrientationOf(d.next_observations.row(i), body, {});
    if (from.dot(to) >= 0) continue;
    if (n++ == 0) first = i;
  }
  if (n == 0) return;
  const std::vector<std::string> names = Names(body.orientation, facts);
  findings.push_back(
      {.check = "quaternion_sign",
       .severity = Severity::kWarning,
       .what = fmt::format("{} to {} change their signs together in {} rows", names.front(), names.back(), n),
       .row = first,
       .count = n,
       .channels = names,
       .meaning = "the same orientation, but a design compares number by number and sees a jump",
       .remedy = "go through the rows: where the product of a quaternion with the one before is negative, "
                 "turn round its four signs"});
}

}  // namespace

std::vector<int> CheckTurning(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  std::vector<int> explained;
  const double period = facts.control_period_s > 0 ? facts.control_period_s : dataset.period_s;
  if (period <= 0 || dataset.size() < kFewestTurns) return explained;
  for (const TurningBody& body : facts.bodies) {
    if (!IsSeen(body.orientation, dataset)) continue;
    AddSignChanges(dataset, body, facts, findings);
    Reading best;
    if (IsSeen(body.turn, dataset)) {
      const double own = Missed(dataset, body, {}, period);
      double left = own;
      for (const Reading& reading :
           {Reading{true, false, false}, Reading{false, false, true}, Reading{true, false, true},
            Reading{false, true, false}, Reading{true, true, false}}) {
        const double missed = Missed(dataset, body, reading, period);
        if (missed >= left || missed > kFits || missed > kBetter * own) continue;
        left = missed;
        best = reading;
      }
      const bool by_columns = left > kFine && AddRateColumns(dataset, body, left, period, facts, findings);
      if (by_columns) best = {};
      if (!best.IsOwn()) AddReading(best, own, left, body, facts, findings);
    }
    if (!IsSeen(body.velocity, dataset) || std::ranges::all_of(body.position, [](int j) { return j < 0; })) continue;
    const double along_world = MissedLinear(dataset, body, best, false, period);
    const double along_body = MissedLinear(dataset, body, best, true, period);
    if (along_body > kFits || along_body > kBetter * along_world) continue;
    const std::vector<std::string> names = Names(body.velocity, facts);
    findings.push_back(
        {.check = "velocity_frame",
         .severity = Severity::kWarning,
         .what = fmt::format("{} miss {:.0f} % of the squared change of {} along the world's axes, {:.0f} % along the "
                             "body's own",
                             fmt::join(names, ", "), 100 * std::min(along_world, 1.0),
                             fmt::join(Names(body.position, facts), ", "), 100 * along_body),
         .count = 3,
         .channels = names,
         .meaning = "MuJoCo's linear velocities of a free body are along the world's axes",
         .remedy = "rotate them into the world by the quaternion"});
    explained.insert(explained.end(), body.velocity.begin(), body.velocity.end());
  }
  return explained;
}

}  // namespace oted
