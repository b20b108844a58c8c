// Stage 1: the logs and the clone.
#include <fmt/format.h>

#include "oted/report/figure.h"
#include "oted/report/json_values.h"
#include "oted/report/sections.h"

namespace oted {

using nlohmann::json;

Section DataSection(const json& report) {
  Section section{"data", "Logs", "The logs", ""};
  if (!report.contains("dataset")) return section;
  const json& data = report["dataset"];
  section.html = "<p>All that is known about the target: what was observed and done there, step by step.</p>\n<dl>";
  const auto fact = [&](const char* name, const std::string& html) {
    if (!html.empty() && html != "–") section.html += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", name, html);
  };
  fact("Episodes", FormatCount(NumberAt(data, "n_episodes")));
  fact("Steps", FormatCount(NumberAt(data, "n_transitions")));
  fact("Observation", FormatCount(NumberAt(data, "obs_dim")) + " numbers");
  fact("Action", FormatCount(NumberAt(data, "act_dim")) + " numbers");
  section.html += "</dl>\n";
  const json& returns = ListAt(data, "episode_returns");
  if (returns.empty()) return section;
  json episodes = json::array();
  for (size_t i = 0; i < returns.size(); ++i) episodes.push_back(i + 1);
  Figure figure("Return of each logged episode");
  figure.AddTrace({{"type", "bar"},
                   {"x", episodes},
                   {"y", returns},
                   {"name", "return"},
                   {"marker", {{"color", "var:--designed"}}},
                   {"width", 0.55}});
  figure.layout() = {{"xaxis", {{"title", {{"text", "episode"}}}, {"tickformat", "d"}, {"showgrid", false}}},
                     {"yaxis", {{"rangemode", "tozero"}}}};
  if (returns.size() <= 12) figure.layout()["xaxis"]["dtick"] = 1;
  section.html += figure.Html("wide short");
  return section;
}

Section CloneSection(const json& report) {
  Section section{"clone", "Clone", "The cloned behaviour", ""};
  if (!report.contains("clone")) return section;
  const json& clone = report["clone"];
  section.html =
      "<p>A policy that imitates the logs. It acts in the simulator during a design in the form <em>paper</em>; a "
      "design in the form <em>transitions</em> repeats the logged actions instead and does not need it. It is also the "
      "least that a trained agent has to beat. The loss is how surprised it is by a logged action; on stretches of the "
      "logs held out from its training it shows when imitation turns into learning by heart. The policy is kept as it "
      "was where that loss is lowest.</p>\n";
  if (clone["result"].is_object()) {
    section.html += "<dl>";
    for (const auto& [key, name] :
         {std::pair("held_out_loss", "Loss, held-out logs"), std::pair("train_loss", "Loss, training logs")}) {
      section.html +=
          fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", name, FormatNumber(NumberAt(clone["result"], key)));
    }
    section.html += fmt::format("<div><dt>Training steps to there</dt><dd>{}</dd></div></dl>\n",
                                FormatCount(NumberAt(clone["result"], "n_steps")));
  }
  Figure figure("Loss over the training steps");
  figure.AddCurve(ListAt(clone["curves"], "clone/train_loss"), "training logs", {.color = "var:--muted"});
  figure.AddCurve(ListAt(clone["curves"], "clone/held_out_loss"), "held-out logs",
                  {.color = "var:--designed", .width = 2});
  figure.layout() = {{"xaxis", {{"title", {{"text", "step"}}}}}};
  if (!figure.empty()) {
    section.html += PlotKey().Add("line", "--designed", "held-out logs").Add("line", "--muted", "training logs").Html();
    section.html += figure.Html("wide");
  }
  return section;
}

}  // namespace oted
