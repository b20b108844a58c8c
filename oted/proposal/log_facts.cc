#include "oted/proposal/log_facts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "oted/sim/one_step.h"

namespace oted {
namespace {

constexpr double kClear = 0.8;      // correlation from which on a velocity is the rate of its position
constexpr double kUnitSlack = 0.2;  // relative
constexpr double kFlipGain = 0.8;   // a flipped sign must bring the error below this share
constexpr double kExact = 1e-3;     // one-step error of the logs' own simulator
constexpr double kUseless = 0.5;    // share of the squared change that a model should not miss
constexpr double kWindow_s = 0.1;
constexpr size_t kWindows = 200;
constexpr double kBeyondLimit = 0.1;  // of a joint's range
constexpr int kRows = 400;
constexpr int kMostLag = 6;       // rows that a velocity is looked for in
constexpr double kLate = 0.5;     // rows from which on it is said
constexpr double kLagGain = 0.7;  // the lag must bring what is unexplained below this share
constexpr double kDegree = std::numbers::pi / 180;

bool Near(double value, double wanted) { return std::abs(value - wanted) < kUnitSlack * std::abs(wanted); }

void AddRateFacts(const Dataset& dataset, const SimulatorSpec& spec, std::vector<std::string>& facts) {
  for (const RateAgreement& rate : CompareRates(dataset, spec.rate_of)) {
    const std::string& velocity = spec.observation_names[static_cast<size_t>(rate.velocity)];
    const std::string& position = spec.observation_names[static_cast<size_t>(rate.position)];
    const double ratio = rate.rows_s / spec.control_period_s;
    if (std::abs(rate.correlation) < kClear || Near(ratio, 1)) continue;
    const std::string shown = fmt::format("{} changes {:.3g} times as fast as {} says", position, ratio, velocity);
    if (Near(ratio, -1)) {
      facts.push_back(shown + ": one of the two has the other sign; turn it round in the log");
    } else if (Near(std::abs(ratio), 1 / kDegree)) {
      facts.push_back(
          fmt::format("{}: the position looks like degrees; multiply its column by {:.6g}", shown, kDegree));
    } else if (Near(std::abs(ratio), kDegree)) {
      facts.push_back(
          fmt::format("{}: the velocity looks like degrees per second; multiply its column by {:.6g}", shown, kDegree));
    } else {
      facts.push_back(shown + ": look at the units of both, at the control period, and at what filters the velocity");
    }
  }
}

/// By how many rows the velocity shows what its position does: 0 where that is not clear.
double VelocityLag(const Dataset& dataset, const std::vector<Episode>& episodes, const RateAgreement& rate) {
  std::vector<double> unexplained;  // by lag
  for (int lag = 0; lag <= kMostLag; ++lag) {
    double dv = 0, vv = 0, dd = 0;
    for (const Episode& episode : episodes) {
      for (int i = episode.begin + kMostLag + 1; i < episode.end; ++i) {
        const double change = (dataset.next_observations(i - lag, rate.position) -
                               dataset.observations(i - lag - 1, rate.position));  // over two rows, about row i - lag
        const double speed = dataset.observations(i, rate.velocity);
        dv += change * speed;
        vv += speed * speed;
        dd += change * change;
      }
    }
    if (vv == 0 || dd == 0 || dv <= 0) return 0;
    unexplained.push_back(1 - dv * dv / (vv * dd));
  }
  const auto best = static_cast<size_t>(std::ranges::min_element(unexplained) - unexplained.begin());
  const bool is_clear = best > 0 && best < kMostLag && unexplained[best] < 1 - kClear * kClear &&
                        unexplained[best] < kLagGain * unexplained[0];
  if (!is_clear) return 0;
  const double before = unexplained[best - 1], at = unexplained[best], after = unexplained[best + 1];
  return static_cast<double>(best) + (before - after) / (2 * (before - 2 * at + after));
}

/// Velocities that show late, as a drive's filter makes them.
void AddLagFacts(const Dataset& dataset, const SimulatorSpec& spec, std::vector<std::string>& facts) {
  const std::vector<Episode> episodes = dataset.Episodes();
  std::vector<std::string> late;
  for (const RateAgreement& rate : CompareRates(dataset, spec.rate_of)) {
    const double lag = VelocityLag(dataset, episodes, rate);
    if (lag < kLate) continue;
    late.push_back(fmt::format("{} by {:.2g} rows", spec.observation_names[static_cast<size_t>(rate.velocity)], lag));
  }
  if (late.empty()) return;
  facts.push_back(
      fmt::format("velocities show late: {}; leave them out of the observations, or make the lag a parameter "
                  "(obs/joint/*/qvel/delay)",
                  fmt::join(late, ", ")));
}

/// Logged positions against the joint's limits.
void AddLimitFacts(const Dataset& dataset, const SimulatorSpec& spec, const ModelOutline& model,
                   std::vector<std::string>& facts) {
  for (const ModelOutline::Joint& joint : model.joints) {
    const auto at = std::ranges::find(spec.observation_names, fmt::format("joint/{}/qpos", joint.name));
    if (!joint.limited || !joint.has_one_number() || at == spec.observation_names.end()) continue;
    const int channel = static_cast<int>(at - spec.observation_names.begin());
    double low = dataset.observations(0, channel), high = low;
    for (int i = 0; i < dataset.size(); ++i) {
      low = std::min(low, dataset.observations(i, channel));
      high = std::max(high, dataset.observations(i, channel));
    }
    const double slack = kBeyondLimit * (joint.high - joint.low);
    if (low >= joint.low - slack && high <= joint.high + slack) continue;
    std::string why = "another zero, sign or unit than the model's";
    if (low * kDegree >= joint.low - slack && high * kDegree <= joint.high + slack &&
        high - low > joint.high - joint.low)
      why = fmt::format("it looks like degrees; multiply its column by {:.6g}", kDegree);
    facts.push_back(fmt::format("{} goes from {:.4g} to {:.4g}, and the model's joint from {:.4g} to {:.4g}: {}", *at,
                                low, high, joint.low, joint.high, why));
  }
}

/// How far a replay of kWindow_s from logged states ends from the log: the mean over channels of the squared error, in
/// units of the channel's own change. Nothing where no row can be replayed.
/// @param flipped  an action whose sign is turned round; -1: none
std::optional<double> WindowError(const SimulatorFactory& factory, const Dataset& dataset, int flipped) {
  const SimulatorSpec& spec = factory.spec();
  const int n_steps = std::max(1, static_cast<int>(std::round(kWindow_s / spec.control_period_s)));
  const auto simulator = factory.Make(1, 1);
  simulator->SetParameters(0, factory.parameters().Nominal());
  std::vector<int> starts;
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i + n_steps <= episode.end; ++i) starts.push_back(i);
  }
  const size_t stride = std::max<size_t>(1, starts.size() / kWindows);
  std::vector<double> error(static_cast<size_t>(spec.obs_dim())), change = error;
  for (size_t s = 0; s < starts.size(); s += stride) {
    const int begin = starts[s], end = begin + n_steps - 1, lane = 0;
    if (!simulator->SetStateFromObservation(lane, dataset.observations.row(begin))) continue;
    for (int i = begin; i <= end && simulator->status(lane) != LaneStatus::kDiverged; ++i) {
      std::vector<double> action(dataset.actions.row(i).begin(), dataset.actions.row(i).end());
      if (flipped >= 0) action[static_cast<size_t>(flipped)] *= -1;
      simulator->Step({&lane, 1}, action);
    }
    if (simulator->status(lane) == LaneStatus::kDiverged) continue;
    for (int c = 0; c < spec.obs_dim(); ++c) {
      const double logged = dataset.next_observations(end, c);
      error[static_cast<size_t>(c)] += std::pow(simulator->observation(lane)[static_cast<size_t>(c)] - logged, 2);
      change[static_cast<size_t>(c)] += std::pow(logged - dataset.observations(begin, c), 2);
    }
  }
  double total = 0;
  int n_channels = 0;
  for (size_t c = 0; c < error.size(); ++c) {
    if (change[c] <= 0) continue;
    total += error[c] / change[c];
    ++n_channels;
  }
  return n_channels == 0 ? std::nullopt : std::optional(total / n_channels);
}

void AddReplayFacts(const SimulatorFactory& factory, const Dataset& dataset, int n_threads,
                    std::vector<std::string>& facts) {
  const std::optional<double> own = WindowError(factory, dataset, -1);
  if (!own) {
    facts.emplace_back("no row could be replayed: the logged states are none of this model; compare units and columns");
    return;
  }
  for (int a = 0; a < dataset.act_dim(); ++a) {
    const std::optional<double> other = WindowError(factory, dataset, a);
    if (!other || *other > kFlipGain * *own) continue;
    facts.push_back(
        fmt::format("with the other sign of {} the model predicts better: turn its column round, or the "
                    "joint's axis in the model",
                    factory.spec().action_names[static_cast<size_t>(a)]));
  }
  const auto shifts = MeasureOneStep(factory, dataset, kRows, n_threads).ratio_by_shift;
  const auto best = std::ranges::min_element(shifts, {}, [](const auto& shift) { return shift.second; });
  if (best != shifts.end() && best->first != 0 && best->second < kFlipGain * shifts.at(0) && shifts.at(0) > kExact) {
    facts.push_back(fmt::format("the action {} row(s) {} predicts a row better than its own: {}", std::abs(best->first),
                                best->first < 0 ? "before" : "later",
                                best->first < 0
                                    ? "the robot acts late, which the parameter delay may take, or a sensor shows late "
                                      "(obs/NAME/delay)"
                                    : "actions were logged too late; shift them"));
  }
  if (*own > kUseless) {
    facts.push_back(
        fmt::format("replayed for {:g} s, the model ends {:.2f} times as far from the log as if nothing had "
                    "moved: compare units, signs and columns before a design",
                    kWindow_s, std::sqrt(*own)));
  }
}

}  // namespace

double RoundedUp(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)));
  return std::stod(fmt::format("{:.6g}", std::ceil(value / unit - 1e-9) * unit));
}

std::vector<RateAgreement> CompareRates(const Dataset& dataset, const std::vector<int>& rate_of) {
  std::vector<RateAgreement> rates;
  for (size_t v = 0; v < rate_of.size(); ++v) {
    if (rate_of[v] < 0) continue;
    RateAgreement rate{static_cast<int>(v), rate_of[v], 0, 0};
    double dv = 0, vv = 0, dd = 0;
    for (int i = 0; i < dataset.size(); ++i) {
      const double change = dataset.next_observations(i, rate.position) - dataset.observations(i, rate.position);
      const double speed = (dataset.observations(i, rate.velocity) + dataset.next_observations(i, rate.velocity)) / 2;
      dv += change * speed;
      vv += speed * speed;
      dd += change * change;
    }
    if (vv == 0 || dd == 0) continue;
    rate.rows_s = dv / vv;
    rate.correlation = dv / std::sqrt(vv * dd);
    rates.push_back(rate);
  }
  return rates;
}

double PeriodByRates(const std::vector<RateAgreement>& rates) {
  std::vector<double> periods;
  for (const RateAgreement& rate : rates) {
    if (rate.correlation > kClear) periods.push_back(rate.rows_s);
  }
  if (periods.empty()) return 0;
  std::ranges::sort(periods);
  const double median = periods[periods.size() / 2];
  const auto agrees = [&](double period) { return Near(period, median); };
  return 2 * std::ranges::count_if(periods, agrees) > static_cast<ptrdiff_t>(periods.size()) ? median : 0;
}

std::optional<Dataset> WithVelocities(const Dataset& dataset, const std::vector<std::string>& has,
                                      const std::vector<std::string>& names, double period_s) {
  struct Source {
    int column;
    bool is_rate;
  };
  std::vector<Source> sources;
  for (const std::string& name : names) {
    auto at = std::ranges::find(has, name);
    const bool is_rate = at == has.end() && name.ends_with("/qvel");
    if (is_rate) at = std::ranges::find(has, name.substr(0, name.size() - 5) + "/qpos");
    if (at == has.end()) return std::nullopt;
    sources.push_back({static_cast<int>(at - has.begin()), is_rate});
  }
  Dataset full = dataset;
  full.observation_names = names;
  full.observations = full.next_observations = Array2<double>(dataset.size(), static_cast<int>(names.size()));
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i < episode.end; ++i) {
      const int after = std::min(i + 1, episode.end - 1);
      for (int c = 0; c < full.obs_dim(); ++c) {
        const auto [from, is_rate] = sources[static_cast<size_t>(c)];
        const auto change = [&](int row) {
          return (dataset.next_observations(row, from) - dataset.observations(row, from)) / period_s;
        };
        full.observations(i, c) = is_rate ? change(i) : dataset.observations(i, from);
        full.next_observations(i, c) = is_rate ? change(after) : dataset.next_observations(i, from);
      }
    }
  }
  return full;
}

std::vector<std::string> SuspiciousFacts(const SimulatorFactory& factory, const Dataset& dataset,
                                         const ModelOutline& model, int n_threads) {
  std::vector<std::string> facts;
  AddRateFacts(dataset, factory.spec(), facts);
  // A replay begins where both say: what it would tell of actions may be the opposite of the truth.
  const bool disagree = !facts.empty();
  if (disagree)
    facts.emplace_back("until positions and velocities agree, the actions' signs and delays are not judged");
  AddLagFacts(dataset, factory.spec(), facts);
  AddLimitFacts(dataset, factory.spec(), model, facts);
  if (factory.spec().can_set_state && !disagree) AddReplayFacts(factory, dataset, n_threads, facts);
  return facts;
}

}  // namespace oted
