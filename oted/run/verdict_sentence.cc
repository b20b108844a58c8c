#include "oted/run/verdict_sentence.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "oted/base/words.h"
#include "oted/matching/verdict.h"
#include "oted/run/prediction_words.h"

namespace oted {
namespace {

constexpr int kFewToldWindows = 10;  // fewer are told beside the horizon
constexpr double kMuchNarrowed = 0.5;
constexpr const char* kAsksForMore =
    "the logs surely ask for something that is not searched (see the suspects): values may be off";

/// What judged, to be appended to a sentence with a good word: it claims no more than that.
std::string JudgedBy(const DesignRecord::Validation& validation, const DesignRecord::Validation::Horizon& shown,
                     DesignVerdict verdict) {
  if (shown.learned) return "; judged by the logs that it learned from";
  const int n = validation.n_recordings;
  const std::string recordings = fmt::format("{} recording{} that it did not learn from", n, n == 1 ? "" : "s");
  if (validation.n_parts == 0) return n > 0 ? "; judged by " + recordings : "";
  if (n == 0) return "; judged by other parts of the recordings that it learned from: other motions were not tested";
  std::string text = fmt::format("; judged by {}, and by other parts of those that it did", recordings);
  if (verdict == DesignVerdict::kNoGap || !shown.in_recordings) return text;
  if (shown.in_recordings->surely_better && shown.surely_better) return text;
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
  if (!not_told.empty()) return "; " + not_told + "; log more";
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
  return fmt::format("; {} of {} channels {} computed from positions or late", n, horizon.channels.size(),
                     n == 1 ? "has no part in this, as it is" : "have no part in this, as they are");
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

bool EndsAtBound(const DesignRecord::Parameter& p) {
  const ParameterSpec spec{.name = p.name,
                           .field = p.field,
                           .low = p.low,
                           .high = p.high,
                           .logarithmic = p.logarithmic,
                           .nominal = p.nominal};
  return EndsAtBound(spec, p.mode, p.mode);
}

namespace {

/// The verdict and what is to be said of it, between semicolons.
std::string Clauses(const DesignRecord& record, const std::vector<int>& off) {
  if (!record.validation || record.validation->horizons.empty()) return WithoutPrediction(record);
  const auto& horizon = ShownHorizon(*record.validation);
  const std::string few =
      horizon.n_windows > 0 && horizon.n_windows < kFewToldWindows ? fmt::format(" ({})", WindowsOf(horizon)) : "";
  const std::string over = "over " + InWords(horizon) + few, share = ShareInWords(horizon.narrowed);
  const std::string at_bounds = AtBounds(record), judged_by = JudgedBy(*record.validation, horizon, record.verdict);
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
