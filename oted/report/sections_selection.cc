#include "oted/report/sections_selection.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/report/figure.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

std::optional<double> Minus(std::optional<double> value, double offset) {
  return value ? std::optional(*value - offset) : std::nullopt;
}

json OrNull(std::optional<double> value) { return value ? json(*value) : json(); }

std::string Chart(const json& design, double log2) {
  json setting_names = json::array();
  json seed_names = json::array();
  json own = json::array();
  json common = json::array();
  for (const json& setting : ListAt(design, "settings")) {
    for (const json& seed : ListAt(setting, "seeds")) {
      setting_names.push_back(PlotLabel(TextAt(setting, "name")));
      seed_names.push_back("seed " + PlotText(TextAt(seed, "seed")));
      own.push_back(OrNull(Minus(NumberAt(seed, "c"), log2)));
      common.push_back(OrNull(Minus(NumberAt(seed, "common"), log2)));
    }
  }
  if (seed_names.empty()) return "";
  const json x = {setting_names, seed_names};
  Figure figure("Score of every seed, less its value at a perfect match");
  const auto bars = [&](const char* name, const json& y, const char* color) {
    figure.AddTrace({{"type", "bar"}, {"x", x}, {"y", y}, {"name", name}, {"marker", {{"color", color}}}});
  };
  bars("common judge", common, "var:--designed");
  bars("own judge", own, "var:--muted");
  PlotKey key;
  key.Add("band", "--designed", "common judge").Add("band", "--muted", "own judge");
  if (const auto nominal = Minus(NumberAt(design, "nominal_common"), log2)) {
    figure.AddTrace({{"type", "scatter"},
                     {"mode", seed_names.size() == 1 ? "markers" : "lines"},
                     {"x", x},
                     {"y", std::vector<double>(seed_names.size(), *nominal)},
                     {"name", "nominal simulator"},
                     {"line", {{"color", "var:--nominal"}, {"width", 2}}},
                     {"marker", {{"color", "var:--nominal"}, {"symbol", "line-ew-open"}, {"size", 40}}}});
    key.Add("line", "--nominal", "nominal simulator, common judge");
  }
  figure.layout() = {{"barmode", "group"},
                     {"bargap", 0.35},
                     {"xaxis", {{"type", "multicategory"}, {"showgrid", false}}},
                     {"yaxis", {{"zeroline", true}, {"rangemode", "tozero"}}}};
  return key.Html() + figure.Html("wide");
}

// What each method made of held-out logs, where the method was left open and more than one was tried.
std::string TriedMethods(const json& design) {
  std::string html;
  for (const json& choice : ListAt(design, "method_choices")) {
    if (ListAt(choice, "tried").empty()) continue;
    html += fmt::format(
        "<p>Setting <em>{}</em> left the method open, and the first predicts no better than the nominal simulator. "
        "Each method "
        "therefore learned from part of the logs, and its simulator replayed {} windows of {} steps from the rest. "
        "Errors are in units of each channel's noise, or of a hundredth of its spread if that is more.</p>\n",
        Escape(TextAt(choice, "setting")), FormatCount(NumberAt(choice, "n_windows")),
        FormatCount(NumberAt(choice, "n_steps")));
    HtmlTable table;
    table.Column("Method", HtmlTable::Align::kText).Column("Error").Column("Log ratio to the first");
    for (const json& tried : ListAt(choice, "tried")) {
      const bool taken = TextAt(tried, "method") == TextAt(choice, "method");
      table.Row({SelectedName(TextAt(tried, "method"), taken), FormatNumber(NumberAt(tried, "error")),
                 FormatSpread(NumberAt(tried, "gain"), NumberAt(tried, "gain_std"))},
                taken);
    }
    table.Row({"<em>nominal simulator</em>", FormatNumber(NumberAt(choice, "nominal_error")), "–"});
    html += table.Html();
  }
  return html;
}

}  // namespace

Section SelectionSection(const json& report) {
  Section section{"selection", "Settings", "Choosing among settings", ""};
  if (!report.contains("design") || ListAt(report["design"], "settings").empty()) return section;
  const json& design = report["design"];
  const double log2 = NumberAt(design, "log2").value_or(std::log(2.0));
  const json& settings = ListAt(design, "settings");
  // There was nothing to choose.
  const bool alone = settings.size() == 1 && ListAt(settings[0], "seeds").size() <= 1;
  if (alone && design.contains("validation")) {
    section.html = TriedMethods(design);
    return section;
  }
  section.html =
      "<p>Each setting ran with several seeds and was scored on fresh simulations. At a score of 0 the judge cannot "
      "tell simulated samples from logged ones; the lower the score, the easier it can. Only the common judge compares "
      "across settings, because it is trained the same way for all. The own judge can go above 0: it then takes "
      "simulated samples for logged ones.</p>\n";
  HtmlTable table;
  table.Column("Setting", HtmlTable::Align::kText).Column("Method", HtmlTable::Align::kText).Column("Seeds");
  table.Column("Common judge").Column("Own judge").Column("Design deviation").Column("Learning progress");
  const std::string selected = TextAt(design, "selected");
  for (const json& setting : settings) {
    const bool chosen = TextAt(setting, "name") == selected;
    table.Row({SelectedName(TextAt(setting, "name"), chosen), Escape(TextAt(setting, "method")),
               FormatCount(ListAt(setting, "seeds").size()), FormatScore(Minus(NumberAt(setting, "common"), log2)),
               FormatScore(Minus(NumberAt(setting, "c"), log2)), FormatNumber(NumberAt(setting, "design_deviation")),
               FormatNumber(NumberAt(setting, "learning_progress"))},
              chosen);
  }
  if (const auto nominal = NumberAt(design, "nominal_common")) {
    table.Row({"<em>nominal simulator</em>", "", "", FormatScore(Minus(nominal, log2)), "–", "–", "–"});
  }
  section.html += table.Html() +
                  "<p class=\"note\">Own judge: the paper's score E[&minus;log(1&minus;g)] of the discriminator that "
                  "the design was "
                  "trained with. Common judge: half the loss, on held-out samples, of a new discriminator that every "
                  "candidate is given in the same way. Both less log&#8201;2, their value at a perfect match. Design "
                  "deviation: how far the seeds lie apart, as a share of the search range (lower is better). Learning "
                  "progress: mean reward over the design (higher is better). Of settings, or seeds, with the same "
                  "score the first is "
                  "used.</p>\n" +
                  TriedMethods(design) + Chart(design, log2);
  return section;
}

}  // namespace oted
