#include "oted/run/prediction_words.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "oted/base/words.h"
#include "oted/matching/verdict.h"

namespace oted {
namespace {

constexpr double kMayBeChance = 1.3;   // times the floor, and not surely more
constexpr double kShown = 0.5;         // [s]
constexpr double kWorse = 1.1;         // times the nominal simulator's error
constexpr double kVisiblyMore = 1.1;   // times the floor
constexpr double kVisiblyLost = 0.05;  // of the nominal simulator's error

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

std::vector<std::string> FewOf(const std::vector<std::string>& channels) {
  if (channels.size() <= 3) return channels;
  return {channels[0], channels[1], fmt::format("{} other channels", channels.size() - 2)};
}

std::string WithUnit(double value, const std::string& unit) {
  return unit.empty() ? fmt::format("{:.2g}", value) : fmt::format("{:.2g} {}", value, unit);
}

std::string ShareInWords(double narrowed) {
  return narrowed > 0.995 && narrowed < 1 ? "over 99 %" : fmt::format("{:.0f} %", 100 * narrowed);
}

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

std::string WindowsOf(const DesignRecord::Validation::Horizon& horizon) {
  return fmt::format("{} window{}", horizon.n_windows, horizon.n_windows == 1 ? "" : "s");
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

std::string LongestInWords(const DesignRecord::Validation& validation) {
  if (!validation.longest) return "";
  const DesignRecord::Validation::Horizon& longest = *validation.longest;
  return fmt::format(
      "Replays can be followed for at least {}: over that the designed simulator's error is {} than the nominal one's "
      "({} window{}{})",
      InWords(longest), LessOrMore(longest.narrowed), longest.n_windows, longest.n_windows == 1 ? "" : "s",
      longest.learned ? " that it learned from" : "");
}

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

std::string ButOverLonger(const DesignRecord::Validation& validation) {
  if (!validation.longest || !(validation.longest->narrowed < -kVisiblyLost)) return "";
  return fmt::format("; over {} the designed simulator's error is {} than the nominal one's",
                     InWords(*validation.longest), LessOrMore(validation.longest->narrowed));
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

std::string ButOdd(const DesignRecord::Validation& validation) {
  // A seam lies in one of a recording's few long windows, or of its many short ones.
  std::vector<int> numbers = ToldOf(validation.horizons).odd_episodes;
  for (const auto& horizon : validation.horizons) {
    for (const int episode : horizon.odd_episodes) {
      if (std::ranges::find(numbers, episode) == numbers.end()) numbers.push_back(episode);
    }
  }
  if (numbers.empty()) return "";
  for (int& number : numbers) ++number;
  const bool is_one = numbers.size() == 1;
  return fmt::format(
      "; {} {} of the logs {} far off{}, the others are not: look there for another load or setting, or "
      "a push from outside",
      is_one ? "episode" : "episodes", fmt::join(numbers, ", "), is_one ? "is" : "are",
      is_one ? "" : ", the first of them most");
}

std::string NotTold(const DesignRecord::Validation& validation) {
  if (FollowsAFewWindows(validation.horizons)) {
    return "these logs do not tell whether the sensors explain what remains: the design learned from all of them, and "
           "it can follow so few rows whatever the truth is";
  }
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

}  // namespace oted
