#include "oted/report/sections_agents.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/report/figure.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

// Evaluations where there are any, else the returns of the training episodes.
const json& ReturnCurve(const json& agent) {
  const json& evaluations = ListAt(agent["curves"], "eval/mean_reward");
  return evaluations.empty() ? ListAt(agent["curves"], "rollout/ep_rew_mean") : evaluations;
}

// Whether an agent earned most at its last evaluation, of at least three.
bool StillRises(const json& agent) {
  const json& curve = ReturnCurve(agent);
  if (curve.size() < 3) return false;
  const auto value = [](const json& point) { return AsNumber(point.at(1)).value_or(-INFINITY); };
  const double last = value(curve.back());
  return std::all_of(curve.begin(), curve.end(), [&](const json& point) { return value(point) <= last; });
}

std::string BaselineName(const std::string& name) {
  if (name == "dr") return "domain randomisation";
  return name == "is" ? "interval search" : name;
}

std::string ReturnMatrix(const json& selection) {
  json agents = json::array();
  json simulators = json::array();
  json returns = json::array();
  for (const json& simulator : ListAt(selection, "simulators")) {
    simulators.push_back("simulator " + PlotText(TextAt(simulator, "seed")));
  }
  for (const json& agent : ListAt(selection, "agents")) {
    agents.push_back("agent " + PlotText(TextAt(agent, "agent")));
    returns.push_back(ListAt(agent, "returns"));
  }
  if (agents.empty() || simulators.empty()) return "";
  bool small = true;  // as a grid world's returns are
  for (const json& row : returns) {
    for (const json& value : row) small = small && std::abs(AsNumber(value).value_or(0)) < 10;
  }
  return MatrixFigure("Return of every agent in every designed simulator", simulators, agents, returns,
                      {{0, "var:--surface"}, {1, "var:--heat"}}, small ? "%{z:.3f}" : "%{z:,.0f}")
      .Html("wide");
}

}  // namespace

Section AgentsSection(const json& report) {
  Section section{"agents", "Agents", "Training the agents", ""};
  const json& agents = ListAt(report, "agents");
  const json& nominal = ListAt(report, "nominal");
  const json& baselines = ListAt(report, "baselines");
  if (agents.empty() && nominal.empty() && baselines.empty()) return section;
  const bool one = report.contains("policy_selection") &&
                   ListAt(report["policy_selection"], "simulators").size() == 1 &&
                   std::ranges::none_of(agents, [](const json& a) { return a["result"].contains("train_in"); });
  section.html = fmt::format(
      "<p>Agents learn in {}. Each return comes from the agent's own training simulators, not from the target, and is "
      "the best of many evaluations of a few episodes: fresh episodes give less. Returns of different simulators do "
      "not "
      "compare.",
      one ? "the designed simulator, which is one: nothing is drawn (<code>agents.train_in = \"samples\"</code> draws "
            "its parameters for each episode, <code>selection.n_seeds</code> makes more)"
          : "the designed simulators, in a newly drawn one for each episode");
  if (!nominal.empty()) section.html += " For comparison: the same training in the nominal simulator.";
  if (!baselines.empty()) {
    section.html +=
        " Baselines learn by the same algorithm without the logs. Domain randomisation draws parameters from their "
        "whole ranges; interval search draws from intervals that grow where the agent does well.";
  }
  section.html += "</p>\n";
  HtmlTable table;
  table.Column("Agent", HtmlTable::Align::kText).Column("Trained in", HtmlTable::Align::kText);
  table.Column("Steps").Column("Return of the kept policy");
  Figure figure("Return over the training steps");
  int n_agents = 0, n_rising = 0;
  const auto add_agent = [&](const json& agent, const std::string& where, const char* color, const char* dash) {
    const std::string name = TextAt(agent, "name");
    const json& result = agent["result"];
    ++n_agents;
    n_rising += StillRises(agent) ? 1 : 0;
    figure.AddCurve(ReturnCurve(agent), fmt::format("agent {}, {}", name, where),
                    {.color = color, .width = 1.8, .dash = dash});
    table.Row({Escape(name), Escape(where), FormatCount(NumberAt(result, "n_steps")),
               FormatNumber(NumberAt(result, "eval_return"))});
  };
  for (const json& agent : agents) add_agent(agent, "designed simulators", "var:--designed", "solid");
  for (const json& agent : nominal) add_agent(agent, "nominal simulator", "var:--nominal", "solid");
  for (const json& agent : baselines) {
    const std::string name = TextAt(agent, "baseline");
    add_agent(agent, BaselineName(name), "var:--low", name == "is" ? "dot" : "solid");
  }
  figure.SetXTitle("step");
  PlotKey key;
  if (!agents.empty()) key.Add("line", "--designed", "in the designed simulators");
  if (!nominal.empty()) key.Add("line", "--nominal", "in the nominal simulator");
  if (!baselines.empty()) key.Add("line", "--low", "baselines");
  section.html += WithKey(key, figure.Html("wide")) + table.Html();
  if (n_rising > 0) {
    section.html += fmt::format(
        "<p>{} of {} agents earned most at the last evaluation: more steps may earn more.</p>\n", n_rising, n_agents);
  }
  return section;
}

Section PolicySelectionSection(const json& report) {
  Section section{"policy-selection", "Policy choice", "Choosing the policy", ""};
  if (!report.contains("policy_selection")) return section;
  const json& selection = report["policy_selection"];
  section.html =
      ListAt(selection, "simulators").size() == 1
          ? "<p>Every agent runs in the designed simulator. The highest mean return wins. The target is not used.</p>\n"
          : "<p>Every agent runs in every designed simulator. The highest mean return wins. The target is not "
            "used.</p>\n";
  HtmlTable table;
  table.Column("Agent", HtmlTable::Align::kText).Column("Mean return");
  const std::string selected = TextAt(selection, "selected");
  for (const json& agent : ListAt(selection, "agents")) {
    const bool chosen = TextAt(agent, "agent") == selected;
    table.Row({SelectedName(TextAt(agent, "agent"), chosen), FormatNumber(NumberAt(agent, "mean_return"))}, chosen);
  }
  section.html += ReturnMatrix(selection) + table.Html();
  return section;
}

}  // namespace oted
