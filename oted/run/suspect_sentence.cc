#include "oted/run/suspect_sentence.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/matching/verdict.h"
#include "oted/run/prediction_words.h"
#include "oted/run/verdict_sentence.h"
#include "oted/sim/channel_path.h"

namespace oted {
namespace {

constexpr double kMuchMore = 2;  // times the floor

/// "about 1.9 control steps", "0.70 times the model's value".
std::string ValueInWords(const ParameterSpec& spec, double value) {
  if (spec.IsMultiple()) {
    const std::string of = spec.MultipliesOthers()     ? fmt::format("what '{}' gives", spec.unit.substr(2))
                           : IsSensorScale(spec.field) ? "the model's reading"
                                                       : "the model's value";
    // 1.04, but 2.1.
    return fmt::format("{:.{}g} times {}", value, std::abs(value - 1) < 0.1 ? 3 : 2, of);
  }
  const bool is_tilt = spec.field == "opt/gravity[0]" || spec.field == "opt/gravity[1]";
  return fmt::format("{:.2g}{}{}", value, spec.unit.empty() ? "" : " " + spec.unit,
                     is_tilt ? ": a base or floor that is not level" : "");
}

/// ": elbow 0.041 to 0.012 rad over 0.5 s, with 64 % less error in all".
std::string Bought(const FreedTrial& trial, const std::vector<DesignRecord::Validation::Channel>& channels,
                   const std::vector<int>& off) {
  // The channel, of those that were off, that it helped most.
  const auto helped = [&](int channel) {
    const auto c = static_cast<size_t>(channel);
    const bool is_known = c < channels.size() && c < trial.before.size();
    const double ratio = is_known ? trial.before[c] / trial.after[c] : 0;
    return std::isfinite(ratio) ? ratio : 0;
  };
  const auto most = std::ranges::max_element(off, {}, helped);
  const std::string horizon =
      trial.seconds > 0 ? fmt::format("{:.2g} s", trial.seconds) : fmt::format("{} control steps", trial.n_steps);
  std::string text = fmt::format("{} less error over {} than without it",
                                 ShareInWords(1 - std::exp(-0.5 * trial.gain.value)), horizon);
  if (most != off.end() && helped(*most) > 1) {
    const auto c = static_cast<size_t>(*most);
    const std::string unit = channels[c].unit.empty() ? "" : " " + channels[c].unit;
    text += fmt::format(", {} {:.2g} to {:.2g}{}", channels[c].name, trial.before[c], trial.after[c], unit);
    // The floor was found without it: what is left with it shows that sensors alone leave no more.
    if (channels[c].floor > trial.after[c]) {
      text += " (sensors alone: no more)";
    } else if (channels[c].floor > 0) {
      text += fmt::format(" (sensors alone: {:.2g})", channels[c].floor);
    }
  }
  return text;
}

/// Whether it leaves more than sensors do in one of the channels that were off.
bool LeavesMore(const FreedTrial& trial, const std::vector<DesignRecord::Validation::Channel>& channels,
                const std::vector<int>& off) {
  return std::ranges::any_of(off, [&](int channel) {
    const auto c = static_cast<size_t>(channel);
    return c < channels.size() && c < trial.after.size() && channels[c].floor > 0 &&
           trial.after[c] > kMuchMore * channels[c].floor;
  });
}

}  // namespace

std::string ConditionInWords(const Condition& condition) {
  const ParameterSpec& spec = condition.spec;
  const std::string more = spec.IsMultiple() ? fmt::format("{:.0f} %", 100 * (condition.off - 1))
                                             : fmt::format("{:.2g}{}", condition.off - spec.nominal,
                                                           spec.unit.empty() ? "" : " " + spec.unit);
  return fmt::format("{} were {} more", spec.field, more);
}

std::string RivalSentence(const Suspect& added, const Suspect& rival) {
  return fmt::format(
      "'{}' was added, but the logs are about as likely with {} freed in its place ({}): intervals hold both, and "
      "which of the two is off the logs do not say; measure one of them",
      added.spec.name, rival.spec.field, ValueInWords(rival.spec, rival.trial->value));
}

std::string SuspectSentence(const Suspect& suspect, const std::vector<DesignRecord::Validation::Channel>& channels,
                            const std::vector<int>& off) {
  const ParameterSpec& spec = suspect.spec;
  if (!suspect.trial) return fmt::format("{}: by the logs about {}", spec.field, ValueInWords(spec, suspect.value));
  const FreedTrial& trial = *suspect.trial;
  const std::string freed = fmt::format("with {} freed ({})", spec.field, ValueInWords(spec, trial.value));
  std::string likelier;
  if (trial.kept && IsLikelier(trial)) {
    likelier = fmt::format("; the logs are surely likelier with it (by {:.0f} nats)", trial.nats->value);
  } else if (!trial.kept && suspect.IsLikely()) {
    const bool is_denied = trial.nats && !(trial.nats->value > 0);
    likelier = fmt::format("; yet the windows of the logs that named it are likelier with it (by {:.0f} nats){}",
                           suspect.explains, is_denied ? ", those that it was freed by are not" : "");
  }
  if (!(trial.gain.value > 0)) return freed + ": predictions get no better" + likelier;
  const std::string text = fmt::format("{}: {}", freed, Bought(trial, channels, off));
  if (trial.kept) {
    if (!trial.led_by.empty()) {
      return text + likelier +
             fmt::format("; the logs are surely likelier yet with '{}' in its place", trial.led_by.front());
    }
    return text + likelier +
           (LeavesMore(trial, channels, off)
                ? "; as it leaves more than the sensors do, something else is off too, or it "
                  "imitates what has no parameter, such as backlash or an elastic drive"
                : "");
  }
  if (EndsAtBound(spec, trial.value, trial.value)) {
    return text + "; it is at the end of its range, so that something else may be off";
  }
  // Surely better, and not kept all the same: FreedTrial::kept says when.
  if (IsSure(trial.gain)) {
    return text + "; but with it a parameter is at its bound, or other horizons are predicted worse";
  }
  return text + "; that is not sure";
}

}  // namespace oted
