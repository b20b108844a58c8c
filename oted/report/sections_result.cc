#include "oted/report/sections_result.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "oted/base/words.h"
#include "oted/report/interval_figure.h"
#include "oted/report/json_values.h"
#include "oted/report/prediction_figure.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr double kShownSeconds = 0.5 + 1e-9;

std::string VerdictBadge(const std::string& verdict) {
  if (verdict.empty()) return "–";
  const char* css = verdict == "identified" ? "good" : verdict == "weak" || verdict == "at_bound" ? "fair" : "poor";
  std::string words = verdict;
  std::replace(words.begin(), words.end(), '_', ' ');
  return fmt::format("<span class=\"badge {}\">{}</span>", css, Escape(words));
}

std::string SearchRange(const json& parameter) {
  const json& bounds = ListAt(parameter, "bounds");
  if (bounds.size() != 2) return "–";
  return fmt::format("{} to {}", FormatGiven(AsNumber(bounds[0])), FormatGiven(AsNumber(bounds[1])));
}

std::string Interval(const json& parameter) {
  const json& interval = ListAt(parameter, "interval90");
  if (interval.size() != 2) return "–";
  const std::optional<double> spread = NumberAt(parameter, "std");
  return fmt::format("{} to {}", FormatAtScale(AsNumber(interval[0]), spread),
                     FormatAtScale(AsNumber(interval[1]), spread));
}

// The least and the greatest mode over the seeds.
std::string SeedRange(const json& parameter) {
  std::optional<double> least, greatest;
  for (const json& value : ListAt(parameter, "seed_modes")) {
    const std::optional<double> mode = AsNumber(value);
    if (!mode) continue;
    least = least ? std::min(*least, *mode) : *mode;
    greatest = greatest ? std::max(*greatest, *mode) : *mode;
  }
  const std::optional<double> spread = NumberAt(parameter, "std");
  return least ? fmt::format("{} to {}", FormatAtScale(least, spread), FormatAtScale(greatest, spread)) : "–";
}

/// What values of this verdict rest on.
std::string Conditions(const json& parameters, const char* verdict, const char* introduction) {
  std::vector<std::string> conditions;  // in the order that they come in
  std::map<std::string, std::string> moved;
  for (const json& parameter : parameters) {
    if (TextAt(parameter, "verdict") != verdict) continue;
    for (const json& of : ListAt(parameter, "rests_on")) {
      const std::string condition = TextAt(of, "condition");
      std::string& names = moved[condition];
      if (names.empty()) conditions.push_back(condition);
      names += fmt::format("{}<b>{}</b> {}", names.empty() ? "" : ", ", Escape(TextAt(parameter, "name")),
                           FormatNumber(NumberAt(of, "value")));
    }
  }
  std::string items;
  for (const std::string& condition : conditions) {
    items += fmt::format("<li>If {}: {}.</li>\n", Escape(condition), moved[condition]);
  }
  return items.empty() ? "" : fmt::format("<p>{}:</p>\n<ul>\n{}</ul>\n", introduction, items);
}

/// That the control period is the task's word, where it is.
std::string AssumedPeriod(const json& report) {
  if (!report.contains("design") || TextAt(report["design"], "period_sentence").empty()) return "";
  return fmt::format("<p>{}.</p>\n", Escape(Sentences(TextAt(report["design"], "period_sentence"))));
}

/// What the same method makes of logs of the design's own, where the intervals rest on that.
std::string OwnLogs(const json& report) {
  if (!report.contains("design") || !report["design"].contains("fit")) return "";
  const json& fit = report["design"]["fit"];
  if (!fit.contains("own_logs")) return "";
  return fmt::format("<p>Checked on its own logs: {}.</p>\n", Escape(Sentences(TextAt(fit["own_logs"], "sentence"))));
}

/// The horizon that is drawn: the longest up to half a second.
const json& Shown(const json& horizons) {
  const json* shown = &horizons[0];
  for (const json& horizon : horizons) {
    if (NumberAt(horizon, "seconds").value_or(0) <= kShownSeconds) shown = &horizon;
  }
  return *shown;
}

/// Where the table shows more of a difference than the verdict's percentage.
std::string NoteOfPercentages(const json& horizon) {
  std::vector<std::string> far_off;
  for (const json& channel : ListAt(horizon, "channels")) {
    const std::optional<double> nominal = NumberAt(channel, "nominal"), spread = NumberAt(channel, "spread");
    if (channel.value("judged", true) && nominal && spread && *nominal > *spread) {
      far_off.push_back(TextAt(channel, "name"));
    }
  }
  return far_off.empty() ? "" : fmt::format("<p>{}.</p>\n", Escape(CountedAtMost(far_off)));
}

bool AnyHas(const json& list, const char* key) {
  return std::any_of(list.begin(), list.end(), [&](const json& item) { return NumberAt(item, key).has_value(); });
}

/// What judged, as far as the record says.
std::string WhatJudged(const json& validation) {
  const json judges = validation.value("judged_by", json::object());
  const int recordings = judges.value("recordings", 0), parts = judges.value("parts", 0);
  if (recordings > 0 && parts == 0)
    return "Whole recordings were kept aside, and a design from the others predicts them";
  if (parts > 0 && recordings == 0) {
    return "Parts of the recordings were kept aside, and a design from the other parts predicts them: motions that no "
           "recording has were not tested";
  }
  return "Whole recordings and parts of the others were kept aside, and a design from the rest predicts them";
}

}  // namespace

Section ParametersSection(const json& report) {
  Section section{"parameters", "Parameters", "Parameters", ""};
  const json& parameters = ListAt(report, "parameters");
  if (parameters.empty()) return section;
  const bool truth = AnyHas(parameters, "truth");
  const bool error = AnyHas(parameters, "absolute_error");
  const bool seeds = std::any_of(parameters.begin(), parameters.end(),
                                 [](const json& p) { return ListAt(p, "seed_modes").size() > 1; });
  section.html = fmt::format(
      "<p>{} They say how sharply the design decided, and do not bound its error. A parameter that is <em>not "
      "identified</em> could have other values in its range, if the others go with it. Where something beside these "
      "parameters differs, none is more than <em>weak</em>, however narrow its interval. All values hold if what was "
      "not "
      "searched is as in the model: the torque of a motor and the masses that it moves, say, can be off together "
      "unseen.",
      seeds ? "Values are the best-scoring seed's mode. The spread (one standard deviation) and the interval are those "
              "of "
              "q over all seeds."
            : "Values are the mode of q. The spread is one standard deviation.");
  if (truth) section.html += " The design did not see the truth; only the last columns use it.";
  section.html += "</p>\n";
  HtmlTable table;
  table.Column("Parameter", HtmlTable::Align::kText).Column("Designed").Column("Verdict", HtmlTable::Align::kText);
  table.Column("Nominal").Column("Searched").Column("90% interval");
  if (seeds) table.Column("Modes of the seeds");
  if (truth) table.Column("Truth");
  if (error) table.Column("Error");
  for (const json& parameter : parameters) {
    const std::optional<double> spread = NumberAt(parameter, "std");
    std::vector<std::string> cells = {
        "<b>" + Escape(TextAt(parameter, "name")) + "</b>" + UnitHtml(TextAt(parameter, "unit")),
        "<b>" + FormatSpread(NumberAt(parameter, "mode"), spread) + "</b>",
        VerdictBadge(TextAt(parameter, "verdict")),
        FormatGiven(NumberAt(parameter, "nominal")),
        SearchRange(parameter),
        Interval(parameter)};
    if (seeds) cells.push_back(SeedRange(parameter));
    if (truth) cells.push_back(FormatGiven(NumberAt(parameter, "truth")));
    if (error) cells.push_back(FormatAtScale(NumberAt(parameter, "absolute_error"), spread));
    table.Row(std::move(cells));
  }
  section.html +=
      table.Html() +
      Conditions(parameters, "identified",
                 "The logs do not tell the following from the parameters. An <em>identified</em> value "
                 "holds if the model has them right. Otherwise it would be") +
      Conditions(parameters, "weak",
                 "A <em>weak</em> value moves with the following, which the logs do not tell from it. It would be") +
      AssumedPeriod(report) + OwnLogs(report) + IntervalFigure(parameters);
  return section;
}

Section ValidationSection(const json& report) {
  Section section{"validation", "Held-out logs", "How it predicts logs that it did not see", ""};
  const json& design = report.contains("design") ? report["design"] : report;
  if (!design.contains("validation")) return section;
  const json& validation = design["validation"];
  const json& horizons = ListAt(validation, "horizons");
  if (horizons.empty()) return section;
  const bool learned = horizons[0].value("learned", false);
  if (learned) {
    section.label = "Prediction";
    section.title = "How it predicts the logs";
  } else if (validation.value("n_recordings", 0) == 0) {
    section.title = "How it predicts parts of its recordings that it did not see";
  }
  section.html = fmt::format(
      "<p>{}. It gets the logged actions and nothing else, in {} windows of {} s and fewer longer ones. The error is "
      "the root mean square over the window, in the channel's unit. <em>Sensors</em> is what their noise alone would "
      "leave: the designed simulator predicts logs of its own, with the same noise on them.</p>\n",
      learned ? "No logs were kept aside: the design predicts those that it learned from" : WhatJudged(validation),
      FormatCount(NumberAt(horizons[0], "n_windows")), FormatGiven(NumberAt(horizons[0], "seconds")));
  HtmlTable table;
  table.Column("Channel", HtmlTable::Align::kText);
  for (const json& horizon : horizons) {
    table.Column(fmt::format("{} s: nominal, designed (sensors)", FormatGiven(NumberAt(horizon, "seconds"))));
  }
  const json& channels = ListAt(horizons[0], "channels");
  bool starred = false;
  for (size_t c = 0; c < channels.size(); ++c) {
    std::vector<std::string> cells = {Escape(TextAt(channels[c], "name")) + UnitHtml(TextAt(channels[c], "unit"))};
    if (!channels[c].value("judged", true)) {
      cells.front() += "&#8201;*";
      starred = true;
    }
    for (const json& horizon : horizons) {
      const json& channel = ListAt(horizon, "channels").at(c);
      cells.push_back(fmt::format("{}, <b>{}</b> <small>({})</small>", FormatNumber(NumberAt(channel, "nominal")),
                                  FormatNumber(NumberAt(channel, "designed")),
                                  FormatNumber(NumberAt(channel, "floor"))));
    }
    table.Row(std::move(cells));
  }
  section.html += PredictionFigure(Shown(horizons)) + table.Html();
  if (starred) section.html += fmt::format("<p>{}.</p>\n", kStarredChannels);
  section.html += NoteOfPercentages(Shown(horizons));
  if (validation.contains("longest")) {
    section.html += fmt::format("<p>{}.</p>\n", Escape(TextAt(validation["longest"], "sentence")));
  }
  return section;
}

Section PoliciesSection(const json& report) {
  Section section{"policies", "Policies", "Policies in the target", ""};
  const json& policies = ListAt(report, "policies");
  if (policies.empty()) return section;
  const std::optional<double> episodes = NumberAt(report["evaluation"], "episodes");
  const bool has_expert = std::ranges::any_of(policies, [](const json& p) { return TextAt(p, "name") == "expert"; });
  section.html = fmt::format(
      "<p>Returns in the target, the simulator at the true values{}, with the standard deviation over episodes. No "
      "policy was trained there. {}</p>\n",
      episodes ? fmt::format(", over {} episodes", FormatCount(episodes)) : "",
      has_expert ? "The score is 0 for random actions and 100 for the shortest paths."
                 : "The score is D4RL's: 0 for a random policy and 100 for an expert, both in the nominal task.");
  HtmlTable table;
  table.Column("Policy", HtmlTable::Align::kText).Column("Return").Column("Score");
  for (const json& policy : policies) {
    std::string label = TextAt(policy, "label");
    if (label.empty()) label = TextAt(policy, "name");
    const std::optional<double> n_diverged = NumberAt(policy, "n_diverged");
    if (n_diverged && *n_diverged > 0) label += fmt::format(" ({} episodes diverged)", FormatCount(n_diverged));
    table.Row({Escape(label), FormatSpread(NumberAt(policy, "mean_return"), NumberAt(policy, "std_return")),
               FormatPoints(NumberAt(policy, "score"))},
              TextAt(policy, "name").starts_with("oted_"));
  }
  section.html += table.Html();
  return section;
}

}  // namespace oted
