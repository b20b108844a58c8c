#include "oted/report/sections_behavior.h"

#include <fmt/format.h>

#include "oted/report/figure.h"
#include "oted/report/json_values.h"

namespace oted {

using nlohmann::json;

Section DataSection(const json& report) {
  Section section{"data", "Logs", "The logs", ""};
  if (!report.contains("dataset")) return section;
  const json& data = report["dataset"];
  section.html =
      std::string(
          "<p>The logs are all that is known about the target: what was observed and done, step by step.</p>\n") +
      FactList()
          .Add("Episodes", FormatCount(NumberAt(data, "n_episodes")))
          .Add("Steps", FormatCount(NumberAt(data, "n_transitions")))
          .Add("Observation", FormatCount(NumberAt(data, "obs_dim")) + " numbers")
          .Add("Action", FormatCount(NumberAt(data, "act_dim")) + " numbers")
          .Html();
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
      "<p>A policy that imitates the logs. It acts in the simulator if the design uses the method <em>paper</em> or "
      "<em>images</em>; the other methods replay the logged actions. A trained agent should beat it. The loss says how "
      "much a logged action surprises the clone. On held-out stretches it rises when the clone learns by heart; "
      "behavioural cloning keeps the policy with the lowest held-out loss. ValueDICE matches where the policy leads, "
      "at the price of a higher loss.</p>\n";
  if (clone["result"].is_object()) {
    const json& result = clone["result"];
    const bool valuedice = TextAt(result, "method") == "valuedice";
    section.html += FactList()
                        .Add("Method", valuedice ? "ValueDICE" : "behavioural cloning")
                        .Add("Loss, held-out logs", FormatNumber(NumberAt(result, "held_out_loss")))
                        .Add("Loss, training logs", FormatNumber(NumberAt(result, "train_loss")))
                        .Add("Training steps to there", FormatCount(NumberAt(result, "n_steps")))
                        .Html();
    if (result.contains("choice")) {
      section.html += "<p>Chosen by evidence: " + Escape(TextAt(result["choice"], "reason")) + ".</p>\n";
    }
  }
  Figure figure("Loss over the training steps");
  figure.AddCurve(ListAt(clone["curves"], "clone/train_loss"), "training logs", {.color = "var:--muted"});
  figure.AddCurve(ListAt(clone["curves"], "clone/held_out_loss"), "held-out logs",
                  {.color = "var:--designed", .width = 2});
  figure.SetXTitle("step");
  section.html += WithKey(PlotKey().Add("line", "--designed", "held-out logs").Add("line", "--muted", "training logs"),
                          figure.Html("wide"));
  return section;
}

}  // namespace oted
