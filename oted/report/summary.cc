#include "oted/report/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "oted/base/words.h"
#include "oted/report/html_text.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

std::vector<std::string> NamesOf(const json& parameters, const std::string& verdict = "") {
  std::vector<std::string> names;
  for (const json& parameter : parameters) {
    if (verdict.empty() || TextAt(parameter, "verdict") == verdict) names.push_back(TextAt(parameter, "name"));
  }
  return names;
}

// The common scores, less their value at a perfect match.
struct Match {
  std::optional<double> nominal;
  std::optional<double> designed;
};

Match MatchOf(const json& report) {
  Match match;
  if (!report.contains("design")) return match;
  const json& design = report["design"];
  const double log2 = NumberAt(design, "log2").value_or(std::log(2.0));
  const auto less_log2 = [log2](std::optional<double> value) { return value ? std::optional(*value - log2) : value; };
  match.nominal = less_log2(NumberAt(design, "nominal_common"));
  for (const json& setting : ListAt(design, "settings")) {
    if (TextAt(setting, "name") == TextAt(design, "selected")) match.designed = less_log2(NumberAt(setting, "common"));
  }
  return match;
}

/// With a capital and a full stop.
std::string AsSentence(std::string text) {
  text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text + ".";
}

// The verdict's sentence, as the design wrote it.
std::string Headline(const json& report) {
  if (!report.contains("design")) {
    return report.contains("design_seeds") ? "The design is not complete yet."
                                           : "No simulator has been designed in this run yet.";
  }
  const std::string sentence = TextAt(report["design"], "sentence");
  if (sentence.empty()) return "A simulator has been designed; no verdict was recorded.";
  return AsSentence(sentence);
}

std::string Asked(const json& report) {
  const std::vector<std::string> names = NamesOf(ListAt(report, "parameters"));
  std::string logs = "the logs";
  if (report.contains("dataset")) {
    const std::optional<double> episodes = NumberAt(report["dataset"], "n_episodes");
    logs = fmt::format("the {} logged episode{} ({} steps)", FormatCount(episodes), episodes == 1 ? "" : "s",
                       FormatCount(NumberAt(report["dataset"], "n_transitions")));
  }
  if (names.empty()) return fmt::format("Which simulator behaves as in {}?", logs);
  return fmt::format("Which value{} of {} make{} the simulator behave as in {}?", names.size() == 1 ? "" : "s",
                     Enumerate(names), names.size() == 1 ? "s" : "", logs);
}

void AddParameters(const json& report, json* found) {
  const json& parameters = ListAt(report, "parameters");
  std::vector<std::string> identified;
  for (const json& parameter : parameters) {
    if (TextAt(parameter, "verdict") != "identified") continue;
    identified.push_back(fmt::format("{} ({})", TextAt(parameter, "name"),
                                     FormatSpread(NumberAt(parameter, "mode"), NumberAt(parameter, "std"))));
  }
  const std::string whole = report.contains("design") ? TextAt(report["design"], "verdict") : "";
  const bool outside = whole == "outside_family" || whole == "gap_narrowed" || whole == "undecided";
  if (!identified.empty()) {
    found->push_back(fmt::format("{} logs determine {}, if what was not searched is as in the model.",
                                 outside ? "Within this family, the" : "The", Enumerate(identified)));
  }
  const std::vector<std::string> weak = NamesOf(parameters, "weak");
  if (!weak.empty()) {
    const char* be = weak.size() == 1 ? "is" : "are";
    const std::string names = Enumerate(weak);
    found->push_back(
        outside ? fmt::format(
                      "Something that is not searched may be off: {} may be farther off than the intervals say.", names)
                : fmt::format("The logs show only roughly what {} {}.", names, be));
  }
}

void AddError(const json& report, json* trust) {
  std::vector<std::string> errors;
  for (const json& parameter : ListAt(report, "parameters")) {
    const std::optional<double> error = NumberAt(parameter, "absolute_error");
    if (!error) continue;
    errors.push_back(fmt::format("{} {}", TextAt(parameter, "name"), FormatNumber(*error)));
  }
  if (!errors.empty())
    trust->push_back(fmt::format("The design did not see the truth. Its errors: {}.", Enumerate(errors)));
}

// How far the replays are from the logs when they end.
void AddReplay(const json& report, json* trust, json* unknown) {
  if (!report.contains("replay") || !report["replay"].contains("error")) return;
  const json& replay = report["replay"];
  const auto last = [&](const char* side) {
    const json& median = replay["error"].contains(side) ? ListAt(replay["error"][side], "median") : EmptyList();
    return median.empty() ? std::nullopt : AsNumber(median.back());
  };
  if (last("designed").value_or(HUGE_VAL) >= last("nominal").value_or(HUGE_VAL)) {
    unknown->push_back(
        "In replays, the designed simulator is no nearer to the logs than the nominal one. Look at the motion below "
        "before you rely on it.");
  }
  const auto distance = [](std::optional<double> error) {
    return error ? fmt::format("{} standard deviations", FormatNumber(error)) : "nowhere: its physics broke down";
  };
  trust->push_back(
      fmt::format("After {} replayed actions the designed simulator is {} from the logs, the nominal one {} (median of "
                  "{} stretches).",
                  FormatCount(NumberAt(replay, "n_steps")), distance(last("designed")), distance(last("nominal")),
                  FormatCount(NumberAt(replay, "n_windows"))));
}

void AddPolicies(const json& report, json* found) {
  std::optional<double> ours, clone, nominal;
  std::string baselines;
  const auto add_baseline = [&](const char* words, std::optional<double> value) {
    if (value) baselines += fmt::format("; {} {}", words, FormatNumber(value));
  };
  for (const json& policy : ListAt(report, "policies")) {
    const std::optional<double> value = NumberAt(policy, "mean_return");
    const std::string name = TextAt(policy, "name");
    if (name.starts_with("oted_")) ours = value;
    if (name == "clone") clone = value;
    if (name.ends_with("_nominal")) nominal = value;
    if (name == "bc_dr") {
      add_baseline("a clone of logs and randomised simulators", value);
    } else if (name.ends_with("_dr")) {
      add_baseline("one trained with domain randomisation", value);
    } else if (name.ends_with("_is")) {
      add_baseline("one trained by interval search", value);
    } else if (const std::string label = TextAt(policy, "label"); label.ends_with(" learned from the logs")) {
      add_baseline(label.c_str(), value);
    }
  }
  if (!ours) return;
  std::string text =
      fmt::format("In the target, the policy trained in the designed simulators returns {}", FormatNumber(ours));
  if (clone) text += fmt::format("; the clone of the logged behaviour {}", FormatNumber(clone));
  if (nominal) text += fmt::format("; a policy trained in the nominal simulator {}", FormatNumber(nominal));
  found->push_back(text + baselines + ".");
}

void AddMatch(const json& report, json* trust) {
  const Match match = MatchOf(report);
  if (!match.nominal || !match.designed) return;
  trust->push_back(
      fmt::format("A classifier learned to tell simulated samples from logged ones. Its score is {} for the designed "
                  "simulator and {} for the nominal one; 0 means that it cannot tell.",
                  FormatScore(match.designed), FormatScore(match.nominal)));
}

// Whether freeing a suspect surely bought something.
bool IsBought(const json& suspect) { return suspect.contains("freed") && suspect["freed"].value("kept", false); }

// Whether another that bought something surely leads this one: the two may stand for one cause.
bool IsLed(const json& suspect, const json& suspects) {
  const json leaders = ListAt(suspect["freed"], "led_by");
  return std::ranges::any_of(suspects, [&](const json& other) {
    return IsBought(other) && std::ranges::find(leaders, json(TextAt(other, "name"))) != leaders.end();
  });
}

// What is not searched and surely explains what is left, and what joined the parameters.
void AddSuspects(const json& design, json* found) {
  for (const json& grown : ListAt(design, "grown")) {
    found->push_back(fmt::format("The parameter {} ({}) was added by the design itself: it predicts better with it.",
                                 TextAt(grown, "name"), TextAt(grown, "field")));
  }
  int n_bought = 0;
  const json& suspects = ListAt(design["fit"], "suspects");
  for (const json& suspect : suspects) {
    if (!IsBought(suspect)) continue;
    ++n_bought;
    found->push_back(fmt::format("Suspect, not among the parameters: {}.{}", TextAt(suspect, "sentence"),
                                 IsLed(suspect, suspects) ? "" : " Add this line to them: " + TextAt(suspect, "line")));
  }
  if (n_bought > 1) {
    found->push_back(
        "Add the first of these lines alone and design again: several suspects may stand for one cause. --grow does so "
        "by itself.");
  }
}

// Which method of the design was taken where that was left open, and why.
void AddMethodChoice(const json& report, json* trust) {
  if (!report.contains("design")) return;
  for (const json& choice : ListAt(report["design"], "method_choices")) {
    if (TextAt(choice, "picked") != TextAt(report["design"], "selected")) continue;
    trust->push_back(
        fmt::format("The program chose the method {}: {}.", TextAt(choice, "method"), TextAt(choice, "reason")));
  }
}

// The channels of a fit in which surely more is left than the sensors explain.
std::vector<std::string> Disagreeing(const json& fit) {
  std::vector<std::string> names;
  for (const json& channel : ListAt(fit, "channels")) {
    if (channel.value("disagrees", false)) names.push_back(TextAt(channel, "name"));
  }
  return names;
}

/// Channels that no verdict rests on.
std::vector<std::string> Starred(const json& report) {
  std::vector<std::string> names;
  if (!report.contains("design") || !report["design"].contains("validation")) return names;
  const json& horizons = ListAt(report["design"]["validation"], "horizons");
  if (horizons.empty()) return names;
  for (const json& channel : ListAt(horizons.front(), "channels")) {
    if (!channel.value("judged", true)) names.push_back(TextAt(channel, "name"));
  }
  return names;
}

// What the fit of replayed windows says of the sensors, or of what the simulator lacks.
void AddFit(const json& report, json* found, json* trust) {
  if (!report.contains("design") || !report["design"].contains("fit")) return;
  const json& fit = report["design"]["fit"];
  const std::vector<std::string> disagreeing = Disagreeing(fit), starred = Starred(report);
  std::optional<double> lowest, highest;
  for (const json& channel : ListAt(fit, "channels")) {
    const std::optional<double> noise = NumberAt(channel, "noise_std");
    if (!noise || std::ranges::find(starred, TextAt(channel, "name")) != starred.end()) continue;
    lowest = std::min(lowest.value_or(*noise), *noise);
    highest = std::max(highest.value_or(*noise), *noise);
  }
  // Where logs were predicted, the headline says so.
  if (!disagreeing.empty() && !report["design"].contains("validation")) {
    found->push_back(
        fmt::format("In predictions of the designed simulator, the error of {} is more than the sensors explain: look "
                    "there for what the simulator lacks.",
                    Enumerate(disagreeing)));
  }
  AddSuspects(report["design"], found);
  if (disagreeing.empty() && lowest) {
    trust->push_back(
        fmt::format("The simulator explains {:.0f}% of the logged windows up to sensor noise, which has a standard "
                    "deviation of {} to {}, by channel.",
                    100 * NumberAt(fit, "explained").value_or(0), FormatNumber(lowest), FormatNumber(highest)));
  }
}

json Unknown(const json& report, const std::string& verdict) {
  json unknown = json::array();
  const json& parameters = ListAt(report, "parameters");
  const std::vector<std::string> open = NamesOf(parameters, "not_identified");
  if (!open.empty()) {
    unknown.push_back(
        fmt::format("The logs do not tell {}: other values fit about as well, where the other parameters go with them. "
                    "To set one to a value of your own, take it out of the parameters and design again.",
                    Enumerate(open)));
  }
  const std::vector<std::string> edge = NamesOf(parameters, "at_bound");
  if (!edge.empty()) {
    unknown.push_back(
        fmt::format("{} ended at the edge of the range: the best value may lie beyond.", Enumerate(edge)));
  }
  if (report.contains("design") && report["design"].contains("fit")) {
    for (const json& suspect : ListAt(report["design"]["fit"], "suspects")) {
      if (IsBought(suspect)) continue;
      unknown.push_back(fmt::format("Suspect, not among the parameters: {}.", TextAt(suspect, "sentence")));
    }
  }
  if (verdict == "gap_closed" || verdict == "no_gap") {
    unknown.push_back(
        "A difference may remain: motions that the logs do not contain, and effects that no parameter describes, are "
        "untested.");
  }
  if (verdict == "outside_family" || verdict == "gap_narrowed" || verdict == "undecided") {
    const bool has_fit = report.contains("design") && report["design"].contains("fit");
    const bool is_told = verdict != "undecided" && (!has_fit || !Disagreeing(report["design"]["fit"]).empty());
    unknown.push_back(is_told
                          ? "More error is left than the sensors explain. Something beside these parameters may "
                            "differ, or the method has not found them exactly."
                          : "Whether the sensors explain what is left these logs do not tell. Something beside these "
                            "parameters may differ.");
  }
  if (report.contains("export") && !TextAt(report["export"], "lacks").empty()) {
    unknown.push_back(
        fmt::format("The file export/designed.xml is {}. Environments that oted makes of this run have it.",
                    TextAt(report["export"], "lacks")));
  }
  if (const std::vector<std::string> starred = Starred(report); !starred.empty()) {
    unknown.push_back(AsSentence(StarredForPolicies(starred)));
  }
  if (report.contains("policy_selection") && !report.contains("evaluation")) {
    unknown.push_back("No policy was evaluated in the target.");
  }
  return unknown;
}

}  // namespace

json Summarise(const json& report) {
  const std::string verdict = report.contains("design") ? TextAt(report["design"], "verdict") : "";
  json found = json::array();
  AddParameters(report, &found);
  AddPolicies(report, &found);
  json trust = json::array();
  AddFit(report, &found, &trust);
  // Where logs were predicted, that is what the verdict rests on.
  const bool predicted = report.contains("design") && report["design"].contains("validation");
  if (!predicted) AddMatch(report, &trust);
  AddMethodChoice(report, &trust);
  json unknown = Unknown(report, verdict);
  if (!predicted) AddReplay(report, &trust, &unknown);
  AddError(report, &trust);
  return {{"verdict", verdict},     {"headline", Headline(report)},
          {"asked", Asked(report)}, {"found", found},
          {"trust", trust},         {"unknown", unknown}};
}

}  // namespace oted
