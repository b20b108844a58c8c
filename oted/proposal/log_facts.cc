#include "oted/proposal/log_facts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "oted/base/angle.h"
#include "oted/checks/data_check.h"
#include "oted/sim/one_step.h"

namespace oted {
namespace {

constexpr double kExact = 1e-3;   // one-step error of the logs' own simulator
constexpr double kUseless = 0.5;  // share of the squared change that a model should not miss
constexpr double kWindow_s = 0.1;
constexpr size_t kWindows = 200;
constexpr double kBeyondLimit = 0.25;  // of a joint's range: limits give way
constexpr double kAsDegrees = 3;       // times a joint's range that angles in degrees go through
constexpr int kRows = 400;

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
        high - low > kAsDegrees * (joint.high - joint.low))
      why = fmt::format("it looks like degrees; multiply its column by {:.6g}", kDegree);
    facts.push_back(fmt::format("{} goes from {:.4g} to {:.4g}, and the model's joint from {:.4g} to {:.4g}: {}", *at,
                                low, high, joint.low, joint.high, why));
  }
}

/// How far a replay of kWindow_s from logged states ends from the log: the mean over channels of the squared error, in
/// units of the channel's own change. Nothing where no row can be replayed.
std::optional<double> WindowError(const SimulatorFactory& factory, const Dataset& dataset) {
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
      simulator->Step({&lane, 1}, dataset.actions.row(i));
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
  const std::optional<double> own = WindowError(factory, dataset);
  if (!own) {
    facts.emplace_back("no row could be replayed: the logged states are none of this model; compare units and columns");
    return;
  }
  const auto better = BetterShift(MeasureOneStep(factory, dataset, kRows, n_threads), kShiftGain);
  if (better && better->own > kExact) {
    const bool is_before = better->shift < 0;
    facts.push_back(fmt::format("the action {} row(s) {} predicts a row better than its own: {}",
                                std::abs(better->shift), is_before ? "before" : "later",
                                is_before
                                    ? "the robot acts late, which the parameter delay may take, or a sensor shows late "
                                      "(obs/NAME/delay)"
                                    : "actions were logged too late; shift them"));
  }
  if (*own > kUseless) {
    facts.push_back(
        fmt::format("replayed for {:g} s, the model ends {:.2f} times as far from the log as if nothing had "
                    "moved: units, signs or columns are wrong, or parameters far off; look before a design",
                    kWindow_s, std::sqrt(*own)));
  }
}

}  // namespace

double RoundedUp(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)));
  return std::stod(fmt::format("{:.6g}", std::ceil(value / unit - 1e-9) * unit));
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
                                         const ModelOutline& model, const RunContext& context) {
  std::vector<std::string> facts;
  AddLimitFacts(dataset, factory.spec(), model, facts);
  for (const Finding& f : FindCorrections(factory, dataset, context)) {
    // A note has a rival, which its meaning names.
    const std::string meaning = f.severity == Severity::kNote ? f.meaning + "; " : "";
    facts.push_back(fmt::format("{}: {}; {}{}", f.check, f.what, meaning, f.remedy));
  }
  if (factory.spec().can_set_state) AddReplayFacts(factory, dataset, context.n_threads, facts);
  return facts;
}

}  // namespace oted
