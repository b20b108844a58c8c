#include "oted/run/verdict_sentence.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <vector>

#include "oted/base/words.h"
#include "oted/matching/verdict.h"

namespace oted {
namespace {

constexpr double kShown = 0.5;        // [s]
constexpr int kFewToldWindows = 10;   // fewer are told beside the horizon
constexpr double kWorse = 1.1;        // times the nominal simulator's error
constexpr double kVisiblyMore = 1.1;  // times the floor
constexpr double kMayBeChance = 1.5;  // times the floor, and not surely more
constexpr double kMuchNarrowed = 0.5;
constexpr double kVisiblyLost = 0.05;  // of the nominal simulator's error
constexpr const char* kAsksForMore =
    "the logs surely ask for something that is not searched (see the suspects): values may be off";
constexpr const char* kGuesses = "its mean, that it stays, that it goes on as it began";

/// Three names at most, the last of them how many there are beside.
std::vector<std::string> FewOf(const std::vector<std::string>& channels) {
  if (channels.size() <= 3) return channels;
  return {channels[0], channels[1], fmt::format("{} other channels", channels.size() - 2)};
}

/// "[rad/s]" behind a number.
std::string WithUnit(double value, const std::string& unit) {
  return unit.empty() ? fmt::format("{:.2g}", value) : fmt::format("{:.2g} {}", value, unit);
}

}  // namespace

std::string WhatRemains(const DesignRecord::Validation& validation, const DesignRecord::Validation::Horizon& shown,
                        const std::vector<int>& off) {
  const auto first_of = [&](const auto& horizon) { return horizon.channels[static_cast<size_t>(off.front())]; };
  const auto more = [&](const auto& horizon) { return first_of(horizon).designed / first_of(horizon).floor; };
  const auto& at = more(shown) > kVisiblyMore ? shown : *std::ranges::max_element(validation.horizons, {}, more);
  const auto& c = first_of(at);
  const auto in_some = [&](const auto& horizon) { return first_of(horizon).times_in_some; };
  const auto& farthest = *std::ranges::max_element(validation.horizons, {}, in_some);
  std::string others;
  if (off.size() == 2) others = " and " + shown.channels[static_cast<size_t>(off[1])].name;
  if (off.size() > 2) others = fmt::format(" and {} other channels", off.size() - 1);
  if (!(more(at) > kVisiblyMore) && in_some(farthest) > 0) {
    return fmt::format(
        "{}{} (over {} up to {:.2g} times as much in all windows together, those of the logs that it learned from as "
        "well: some are far off)",
        c.name, others, InWords(farthest), in_some(farthest));
  }
  return fmt::format("{} {}{} (sensors alone: {:.2g}){}", c.name, WithUnit(c.designed, c.unit),
                     &at == &shown ? "" : " over " + InWords(at), c.floor, others);
}

namespace {

/// What judged, to be appended to a sentence with a good word: it claims no more than that.
std::string JudgedBy(const DesignRecord::Validation& validation, const DesignRecord::Validation::Horizon& shown) {
  if (shown.learned) return "; judged by the logs that it learned from";
  const int n = validation.n_recordings;
  const std::string recordings = fmt::format("{} recording{} that it did not learn from", n, n == 1 ? "" : "s");
  if (validation.n_parts == 0) return n > 0 ? "; judged by " + recordings : "";
  if (n == 0) return "; judged by other parts of the recordings that it learned from: other motions were not tested";
  std::string text = fmt::format("; judged by {}, and by other parts of those that it did", recordings);
  if (!shown.in_recordings || (shown.in_recordings->surely_better && shown.surely_better)) return text;
  const std::string alone = n == 1 ? "that recording" : "those recordings";
  const double narrowed = shown.in_recordings->narrowed;
  if (shown.in_recordings->surely_better) {
    return text + fmt::format(": in {} alone its error is {} less, over all windows that is not sure", alone,
                              ShareInWords(narrowed));
  }
  return text + fmt::format(": in {} alone it is {}", alone,
                            narrowed < -0.005 ? fmt::format("{:.0f} % worse than the nominal one", -100 * narrowed)
                                              : "not surely better than the nominal one");
}

/// "episode 3" or "episodes 3, 5": those of parts; "3 with 4" of one part.
std::string EpisodesOf(const std::vector<LeftOutPart>& parts) {
  std::vector<std::string> numbers;
  for (const LeftOutPart& part : parts) {
    std::vector<int> from_one;
    for (const int episode : part.episodes) from_one.push_back(episode + 1);
    numbers.push_back(fmt::format("{}", fmt::join(from_one, " with ")));
  }
  const bool is_one = parts.size() == 1 && parts[0].episodes.size() == 1;
  return fmt::format("{} {}", is_one ? "episode" : "episodes", fmt::join(numbers, ", "));
}

/// What recordings say that were left out in turn, where one of them is predicted worse than by doing nothing.
std::string ButLeftOut(const DesignRecord& record) {
  if (!record.fit || !record.fit->left_out) return "";
  const std::vector<LeftOutPart>& parts = record.fit->left_out->parts;
  const std::vector<LeftOutPart> worse = record.fit->left_out->WorseRecordings();
  if (worse.empty()) return "";
  const double worst = std::ranges::max(worse, {}, &LeftOutPart::error).error;
  const bool is_one = worse.size() == 1;
  const bool are_groups = std::ranges::any_of(parts, [](const LeftOutPart& part) { return part.episodes.size() > 1; });
  return fmt::format(
      "; left out of the fit, {} of {} {}recordings ({}) {} predicted {}{:.0f} % worse than by the nominal "
      "simulator: so may be a motion unlike these",
      worse.size(), parts.size(), are_groups ? "groups of " : "", EpisodesOf(worse), is_one ? "is" : "are",
      is_one ? "" : "up to ", 100 * (worst - 1));
}

/// The parameters that the logs put at the end of their range: an interval that reaches it asks for nothing beyond, nor
/// does a value there that they do not tell.
std::string AtBounds(const DesignRecord& record) {
  std::string names;
  for (const DesignRecord::Parameter& p : record.parameters) {
    if (p.verdict == ParameterVerdict::kAtBound && EndsAtBound(p))
      names += (names.empty() ? "'" : ", '") + p.name + "'";
  }
  return names;
}

/// Values that may be off though predictions are good, to be appended to a sentence that the floor is reached.
/// @param names  AtBounds
std::string ButAtBounds(const std::string& names) {
  if (names.empty()) return "";
  return fmt::format("; the value of {} is at the end of its range: the true one may be beyond, and others off with it",
                     names);
}

/// Whether the logs surely ask for something that is not searched.
bool AsksForMore(const DesignRecord& record) {
  const auto is_likely = [](const DesignRecord::Suspected& s) { return s.suspect.IsLikely(); };
  return record.fit && std::ranges::any_of(record.fit->suspects, is_likely);
}

/// Why the gap is not closed though at no horizon more is left than the sensors explain.
std::string WhyOnlyNarrowed(const DesignRecord& record) {
  const std::string not_told = NotTold(*record.validation);
  if (!not_told.empty()) return "; " + not_told;
  return std::string(": there the sensors explain what remains, but ") +
         (AsksForMore(record) ? kAsksForMore : "not in every recording");
}

/// Channels that no prediction tells anything of, to be appended to a sentence that the floor is reached.
std::string ButUntold(const DesignRecord::Validation::Horizon& horizon) {
  std::vector<std::string> names;
  for (const auto& c : horizon.channels) {
    if (c.judged && IsNoBetterThanGuess(c.floor, c.spread)) names.push_back(c.name);
  }
  if (names.empty()) return "";
  return fmt::format("; of {} {} tells nothing: there noise alone explains what is read", Enumerate(FewOf(names)),
                     horizon.learned ? "this" : "what was kept aside");
}

/// Channels that no verdict rests on, to be appended to a sentence that the floor is reached.
std::string ButStarred(const DesignRecord::Validation::Horizon& horizon) {
  const auto n = std::ranges::count_if(horizon.channels, [](const auto& c) { return !c.judged; });
  if (n == 0) return "";
  return fmt::format("; {} of {} channels judge nothing, as {} computed from positions or late", n,
                     horizon.channels.size(), n == 1 ? "it is" : "they are");
}

/// Values off the nominal ones though predictions are as good by these, to be appended to a sentence that there is no
/// gap.
std::string ButValuesOff(const DesignRecord& record) {
  std::vector<std::string> names;
  for (const DesignRecord::Parameter& p : record.parameters) {
    const bool is_told = p.verdict == ParameterVerdict::kWeak || p.verdict == ParameterVerdict::kIdentified;
    if (is_told && LiesOff(p.mode, p.nominal, p.std, p.high - p.low)) names.push_back("'" + p.name + "'");
  }
  if (names.empty()) return "";
  return fmt::format(
      "; the fit asks for {} of {} though: a gap that noise hides from predictions, or an error of the fit",
      names.size() == 1 ? "another value" : "other values", Enumerate(names));
}

std::string WindowsOf(const DesignRecord::Validation::Horizon& horizon) {
  return fmt::format("{} window{}", horizon.n_windows, horizon.n_windows == 1 ? "" : "s");
}

/// Where no channel is surely above what the sensors leave: that in which the errors of a few windows are.
std::string ButByChance(const DesignRecord::Validation::Horizon& shown) {
  const DesignRecord::Validation::Channel* most = nullptr;
  for (const auto& c : shown.channels) {
    if (!c.judged || !(c.designed > kMayBeChance * c.floor)) continue;
    if (most == nullptr || c.designed / c.floor > most->designed / most->floor) most = &c;
  }
  if (most == nullptr) return "";
  return fmt::format("; in {} it leaves {}, the sensors {:.2g}: in few of these windows, which may be chance",
                     most->name, WithUnit(most->designed, most->unit), most->floor);
}

/// That longer replays are worse than the nominal simulator's, to be appended to a good word.
std::string ButOverLonger(const DesignRecord::Validation& validation) {
  if (!validation.longest || !(validation.longest->narrowed < -kVisiblyLost)) return "";
  return fmt::format("; over {} the designed simulator's error is {} than the nominal one's",
                     InWords(*validation.longest), LessOrMore(validation.longest->narrowed));
}

std::string GapClosedForAClassifier(const DesignRecord& record) {
  const double nominal_common = record.nominal_common.value();
  double designed_common = nominal_common;
  for (const DesignRecord::Setting& setting : record.settings) {
    if (setting.name == record.selected) designed_common = setting.common.value();
  }
  if (JudgeDesign(nominal_common, designed_common, record.dataset.n_transitions) == DesignVerdict::kNoGap) {
    return "gap closed: a classifier can tell neither simulator from the logs, but an identified parameter lies off "
           "its "
           "nominal value";
  }
  const bool hardly = CannotTell(nominal_common);
  return fmt::format(
      "gap closed: a classifier cannot tell the designed simulator from the logs; it can {}tell the nominal one",
      hardly ? "hardly " : "");
}

std::string WithoutPrediction(const DesignRecord& record) {
  switch (record.verdict) {
    case DesignVerdict::kNoGap:
      return "no gap: a classifier cannot tell the nominal simulator from the logs";
    case DesignVerdict::kGapClosed:
      return GapClosedForAClassifier(record);
    case DesignVerdict::kGapNarrowed:
      return "gap narrowed: a classifier tells the designed simulator from the logs, but less surely than the nominal "
             "one";
    case DesignVerdict::kUndecided:
      return fmt::format(
          "undecided: {} transitions, of which none can be predicted, are too few to judge a simulator by; log longer "
          "episodes",
          record.dataset.n_transitions);
    case DesignVerdict::kOutsideFamily:
      break;
  }
  return "outside the family: a classifier tells the designed simulator from the logs as surely as the nominal one";
}

}  // namespace

const DesignRecord::Validation::Horizon& ShownHorizon(const DesignRecord::Validation& validation) {
  const auto rank = [](const DesignRecord::Validation::Horizon& h) { return 2 * !h.learned + h.surely_better; };
  const auto* shown = &validation.horizons.front();
  for (const auto& horizon : validation.horizons) {
    const bool is_brief = horizon.seconds > 0 && horizon.seconds <= kShown + 1e-9;
    // A gain that is sure over a longer time alone is what the verdict rests on.
    if (is_brief ? rank(horizon) >= rank(*shown) : rank(horizon) > rank(*shown)) shown = &horizon;
  }
  return *shown;
}

bool EndsAtBound(const DesignRecord::Parameter& p) {
  const ParameterSpec spec{.name = p.name,
                           .field = p.field,
                           .low = p.low,
                           .high = p.high,
                           .logarithmic = p.logarithmic,
                           .nominal = p.nominal};
  return EndsAtBound(spec, p.mode, p.mode);
}

std::string ShareInWords(double narrowed) {
  return narrowed > 0.995 && narrowed < 1 ? "over 99 %" : fmt::format("{:.0f} %", 100 * narrowed);
}

/// "64 % less", "12 % more".
std::string LessOrMore(double narrowed) {
  if (std::abs(narrowed) < 0.005) return narrowed < 0 ? "under 1 % more" : "under 1 % less";
  return narrowed < 0 ? fmt::format("{:.0f} % more", -100 * narrowed) : ShareInWords(narrowed) + " less";
}

std::string InWords(const DesignRecord::Validation::Horizon& horizon) {
  return horizon.seconds > 0 ? fmt::format("{:.2g} s", horizon.seconds)
                             : fmt::format("{} control steps", horizon.n_steps);
}

std::string InWords(const DesignRecord::Validation::Channel& channel) {
  return channel.name + (channel.unit.empty() ? "" : fmt::format(" [{}]", channel.unit)) + (channel.judged ? "" : " *");
}

std::string NotesOf(const DesignRecord::Validation::Horizon& horizon) {
  const bool all = std::ranges::all_of(horizon.channels, &DesignRecord::Validation::Channel::judged);
  std::string notes = all ? "" : fmt::format("{}\n", kStarredChannels);
  std::vector<std::string> far_off;
  for (const auto& c : horizon.channels) {
    if (c.judged && c.nominal > c.spread) far_off.push_back(c.name);
  }
  if (!far_off.empty()) notes += CountedAtMost(far_off) + "\n";
  return notes;
}

std::string ButAGuess(const DesignRecord::Validation& validation) {
  std::string text;
  std::vector<std::string> first;
  bool can_be_better = false;
  for (const auto& horizon : validation.horizons) {
    std::vector<std::string> names;
    for (const auto& c : horizon.channels) {
      if (!c.judged || !IsNoBetterThanGuess(c.designed, c.guess)) continue;
      names.push_back(c.name);
      can_be_better |= !IsNoBetterThanGuess(c.floor, c.guess);
    }
    if (names.empty()) continue;
    if (text.empty()) {
      first = names;
      text = fmt::format("; over {} it predicts {} no better than a guess ({})", InWords(horizon),
                         Enumerate(FewOf(names)), kGuesses);
    } else {
      text += fmt::format(
          ", over {} {}", InWords(horizon),
          names == first ? "likewise" : fmt::format("{} channel{}", names.size(), names.size() == 1 ? "" : "s"));
    }
  }
  return text.empty() || can_be_better ? text : text + "; nor could any simulator: noise alone leaves as much";
}

std::string LongestInWords(const DesignRecord::Validation& validation) {
  if (!validation.longest) return "";
  const DesignRecord::Validation::Horizon& longest = *validation.longest;
  return fmt::format(
      "Replays can be followed for at least {}: over that the designed simulator's error is {} than the nominal one's "
      "({} window{}{})",
      InWords(longest), LessOrMore(longest.narrowed), longest.n_windows, longest.n_windows == 1 ? "" : "s",
      longest.learned ? " that it learned from" : "");
}

std::string ButElsewhere(const DesignRecord::Validation& validation) {
  const auto& shown = ShownHorizon(validation);
  std::string unsure;
  const DesignRecord::Validation::Horizon* worst_at = nullptr;
  const DesignRecord::Validation::Channel* worst = nullptr;
  std::set<std::string> worse;
  for (const auto& horizon : validation.horizons) {
    if (horizon.n_steps > shown.n_steps && shown.surely_better && !horizon.surely_better) {
      unsure += fmt::format("{}{} ({})", unsure.empty() ? "" : " and ", InWords(horizon), WindowsOf(horizon));
    }
    for (const auto& channel : horizon.channels) {
      const auto ratio = [](const auto& c) { return c.designed / c.nominal; };
      if (!channel.judged || !(ratio(channel) > kWorse)) continue;
      worse.insert(channel.name);
      if (worst != nullptr && ratio(channel) <= ratio(*worst)) continue;
      worst = &channel;
      worst_at = &horizon;
    }
  }
  std::string text;
  if (!unsure.empty()) text = fmt::format("; over {} it is not surely better", unsure);
  text += ButOverLonger(validation);
  if (worst == nullptr) return text;
  const size_t n_others = worse.size() - 1;
  return text +
         fmt::format("; it predicts {} worse than the nominal simulator over {}: {} against {:.2g}{}", worst->name,
                     InWords(*worst_at), WithUnit(worst->designed, worst->unit), worst->nominal,
                     n_others == 0 ? "" : fmt::format(", and {} other channel{}", n_others, n_others == 1 ? "" : "s"));
}

std::string ButOdd(const DesignRecord::Validation& validation) {
  std::set<int> numbers;  // a seam lies in one of a recording's few long windows, or of its many short ones
  for (const auto& horizon : validation.horizons) {
    for (const int episode : horizon.odd_episodes) numbers.insert(episode + 1);
  }
  if (numbers.empty()) return "";
  return fmt::format("; {} {} of the logs {} far off, the others are not: look there",
                     numbers.size() == 1 ? "episode" : "episodes", fmt::join(numbers, ", "),
                     numbers.size() == 1 ? "is" : "are");
}

std::string NotTold(const DesignRecord::Validation& validation) {
  const DesignRecord::Validation::Horizon* worst = &ToldOf(validation.horizons);
  for (const auto& horizon : validation.horizons) {
    if (IsTold(horizon) && horizon.most_times_floor > worst->most_times_floor) worst = &horizon;
  }
  if (TellsFloor(worst->most_times_floor)) return "";
  constexpr double kMostShown = 10;
  const std::string times = worst->most_times_floor < kMostShown
                                ? fmt::format("up to {:.2g} times", worst->most_times_floor)
                                : "more than ten times";
  return fmt::format(
      "these logs do not tell whether the sensors explain what remains: over {} it may be {} what they leave",
      InWords(*worst), times);
}

namespace {

/// The verdict and what is to be said of it, between semicolons.
std::string Clauses(const DesignRecord& record, const std::vector<int>& off) {
  if (!record.validation || record.validation->horizons.empty()) return WithoutPrediction(record);
  const auto& horizon = ShownHorizon(*record.validation);
  const std::string few =
      horizon.n_windows > 0 && horizon.n_windows < kFewToldWindows ? fmt::format(" ({})", WindowsOf(horizon)) : "";
  const std::string over = "over " + InWords(horizon) + few, share = ShareInWords(horizon.narrowed);
  const std::string at_bounds = AtBounds(record), judged_by = JudgedBy(*record.validation, horizon);
  const std::string odd_ones = ButOdd(*record.validation);
  // Where the floor is reached.
  const std::string but = ButUntold(horizon) + ButStarred(horizon) + ButOverLonger(*record.validation) +
                          ButAtBounds(at_bounds) + odd_ones + judged_by;
  const std::string by_chance = off.empty() && odd_ones.empty() ? ButByChance(horizon) : "";
  switch (record.verdict) {
    case DesignVerdict::kNoGap:
      return fmt::format("no gap: {} the nominal simulator predicts the logs as well as the sensors let it{}{}", over,
                         off.empty() ? "" : "; the designed one does not: keep the nominal one",
                         ButValuesOff(record) + but);
    case DesignVerdict::kGapClosed: {
      const std::string closed =
          fmt::format("gap closed: {} the designed simulator predicts the logs as well as the sensors let it", over);
      if (record.predicts_better)
        return closed + fmt::format(", with {} less error than the nominal one{}{}", share, by_chance, but);
      if (horizon.narrowed > kMuchNarrowed) {
        return closed +
               fmt::format("; its error is {} less than the nominal one's, in too few windows for that to be sure{}",
                           share, but);
      }
      return closed + "; its parameters are not the nominal ones, but that it predicts better is not sure" + but;
    }
    case DesignVerdict::kGapNarrowed:
      if (off.empty()) {
        return fmt::format("gap narrowed by {} {}{}", share, over, WhyOnlyNarrowed(record)) + by_chance + odd_ones +
               judged_by + ButLeftOut(record);
      }
      return fmt::format("gap narrowed by {} {}; what remains is more than the sensors explain: {}", share, over,
                         WhatRemains(*record.validation, horizon, off)) +
             ButElsewhere(*record.validation) + ButAGuess(*record.validation) + odd_ones + judged_by +
             ButLeftOut(record);
    case DesignVerdict::kUndecided: {
      if (ShowsNothing(record.validation->horizons)) return std::string("undecided: ") + kNothingShown;
      const std::string not_told = NotTold(*record.validation);
      return fmt::format(
          "undecided: {} the designed simulator does not surely predict better than the nominal one, and {}{}", over,
          not_told.empty() ? "that one may predict as well as the sensors let it" : not_told,
          odd_ones.empty() ? "; log more" : odd_ones);
    }
    case DesignVerdict::kOutsideFamily:
      break;
  }
  if (GuessesAsWell(record.validation->horizons)) {
    return fmt::format(
        "outside the family: at no horizon does the designed simulator predict better than guesses do (of each "
        "channel, {}); "
        "{} its error is {} than the nominal simulator's{}",
        kGuesses, over, LessOrMore(horizon.narrowed),
        off.empty() ? "" : ": " + WhatRemains(*record.validation, horizon, off));
  }
  if (record.predicts_better) {
    return fmt::format(
               "outside the family: the best fit lies at the end of the range of {}; there the error {} is {} less "
               "than the nominal one's{}",
               at_bounds.empty() ? "some parameter" : at_bounds, over, share,
               off.empty() ? "; " + NotTold(*record.validation)
                           : ", and more than the sensors explain: " + WhatRemains(*record.validation, horizon, off)) +
           ButAGuess(*record.validation) + odd_ones;
  }
  if (off.empty()) {
    return fmt::format(
        "outside the family: {} {}the designed simulator does not surely predict better than the nominal one, and {}",
        over, NotTold(*record.validation).empty() ? "the sensors explain what remains, but " : "", kAsksForMore);
  }
  return fmt::format(
             "outside the family: {} the designed simulator does not surely predict better than the nominal one; what "
             "remains is more than the sensors explain: {}",
             over, WhatRemains(*record.validation, horizon, off)) +
         odd_ones;
}

}  // namespace

std::string VerdictSentence(const DesignRecord& record, const std::vector<int>& off) {
  return Sentences(Clauses(record, off));
}

}  // namespace oted
