#include "oted/report/sections_design.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/report/figure.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

// The parameters' names; before design.json is there, those that the curves name.
std::vector<std::string> ParameterNames(const json& report) {
  std::vector<std::string> names;
  for (const json& parameter : ListAt(report, "parameters")) names.push_back(TextAt(parameter, "name"));
  if (!names.empty()) return names;
  constexpr std::string_view kPrefix = "design/mode/";
  for (const auto& [key, curve] : report["design_seeds"].front()["curves"].items()) {
    if (key.starts_with(kPrefix)) names.push_back(key.substr(kPrefix.size()));
  }
  return names;
}

// The name of the seed whose mode is the designed value: the best-scoring one of the selected setting.
std::string BestSeed(const json& report) {
  if (!report.contains("design")) return "";
  std::optional<double> best;
  std::string name;
  for (const json& setting : ListAt(report["design"], "settings")) {
    if (TextAt(setting, "name") != TextAt(report, "shown_setting")) continue;
    const char* score = TextAt(report["design"], "score_name") == "paper" ? "c" : "common";
    for (const json& seed : ListAt(setting, "seeds")) {
      const std::optional<double> value = NumberAt(seed, score);
      if (name.empty() || (value && (!best || *value > *best))) {
        best = value;
        name = TextAt(seed, "seed");
      }
    }
  }
  return name;
}

LineStyle SeedStyle(bool emphasised) {
  return {.color = "var:--designed", .width = emphasised ? 2.4 : 1.2, .opacity = emphasised ? 1.0 : 0.55};
}

// One curve per seed, the best one on top of the others.
void AddSeedCurves(const json& seeds, const std::string& key, const std::string& best, Figure* figure) {
  for (const bool emphasised : {false, true}) {
    for (const json& seed : seeds) {
      if ((seed["name"] == best || seeds.size() == 1) != emphasised) continue;
      figure->AddCurve(ListAt(seed["curves"], key.c_str()), "seed " + TextAt(seed, "name"), SeedStyle(emphasised));
    }
  }
}

std::string ParameterFigure(const json& report, size_t index, const std::string& name, const std::string& best) {
  const json& parameters = ListAt(report, "parameters");
  const json parameter = index < parameters.size() ? parameters[index] : json::object();
  Figure figure("<b>" + Escape(name) + "</b>" + UnitHtml(TextAt(parameter, "unit")));
  const json& seeds = report["design_seeds"];
  for (const json& seed : seeds) {
    figure.AddBand(ListAt(seed["curves"], ("design/mode/" + name).c_str()),
                   ListAt(seed["curves"], ("design/std/" + name).c_str()), "var:--band");
  }
  AddSeedCurves(seeds, "design/mode/" + name, best, &figure);
  if (const auto nominal = NumberAt(parameter, "nominal")) {
    figure.AddLevel(*nominal, "nominal", {.color = "var:--nominal", .width = 1.6});
  }
  if (const auto truth = NumberAt(parameter, "truth")) {
    figure.AddLevel(*truth, "truth", {.color = "var:--truth", .width = 1.6, .dash = "dash"});
  }
  figure.SetXTitle("iteration");
  return figure.Html();
}

std::string CorrelationFigure(const json& report) {
  if (!report.contains("design")) return "";
  const json& correlation = ListAt(report["design"], "correlation");
  bool any = false;
  for (size_t i = 0; i < correlation.size(); ++i) {
    for (size_t j = 0; j < i; ++j) any = any || AsNumber(correlation[i].at(j)).value_or(0) != 0;
  }
  if (!any) return "";  // one parameter, or a distribution in which they are independent by construction
  json names = json::array();
  for (const std::string& name : ParameterNames(report)) names.push_back(PlotLabel(name));
  Figure figure = MatrixFigure("How the parameters trade off against each other", names, names, correlation,
                               {{0, "var:--cold"}, {0.5, "var:--surface"}, {1, "var:--heat"}}, "%{z:.2f}");
  figure.SetValueRange(-1, 1);
  return "<p>Correlation of the parameters under q. Near +1 or &minus;1, the logs show a combination of two parameters "
         "better than each alone.</p>\n" +
         figure.Html("matrix");
}

}  // namespace

Section DesignSection(const json& report) {
  Section section{"design", "Design", "The design", ""};
  if (!report.contains("design_seeds")) {
    section.html = CorrelationFigure(report);
    return section;
  }
  const std::string best = BestSeed(report);
  std::string figures;
  const std::vector<std::string> names = ParameterNames(report);
  for (size_t i = 0; i < names.size(); ++i) figures += ParameterFigure(report, i, names[i], best);
  const size_t n_seeds = report["design_seeds"].size();
  section.html = fmt::format(
      "<p>Mode and spread of q over the iterations. {}</p>\n",
      n_seeds > 1 ? fmt::format("The {} lines are independent seeds of setting <em>{}</em>. Where they end at the same "
                                "value, chance mattered little.",
                                n_seeds, Escape(TextAt(report, "shown_setting")))
                  : fmt::format("One repetition of setting <em>{}</em>.", Escape(TextAt(report, "shown_setting"))));
  const auto any_has = [&](const char* what) {
    const json& parameters = ListAt(report, "parameters");
    return std::any_of(parameters.begin(), parameters.end(),
                       [&](const json& parameter) { return NumberAt(parameter, what).has_value(); });
  };
  PlotKey key;
  key.Add("line", "--designed", best.empty() ? "designed value" : "designed value, best seed in bold");
  key.Add("band", "--band", "spread (&plusmn; one standard deviation)");
  if (any_has("nominal")) key.Add("line", "--nominal", "nominal value");
  if (any_has("truth")) key.Add("dash", "--truth", "truth");
  section.html += WithKey(key, FigureGrid(figures)) + CorrelationFigure(report);
  return section;
}

Section DiscriminatorSection(const json& report) {
  Section section{"discriminator", "Judge", "The judge", ""};
  if (!report.contains("design_seeds")) return section;
  const std::string best = BestSeed(report);
  const auto plot = [&](const char* title, const char* key, double level, const char* level_name) {
    Figure figure(title);
    AddSeedCurves(report["design_seeds"], key, best, &figure);
    figure.AddLevel(level, level_name, {.color = "var:--truth", .width = 1.4, .dash = "dash"});
    figure.SetXTitle("iteration");
    return figure.Html();
  };
  const std::string figures = plot("Share it tells apart correctly", "design/discriminator_accuracy", 0.5, "guessing") +
                              plot("Its loss", "design/discriminator_loss", 2 * std::log(2.0), "guessing");
  if (figures.empty()) return section;
  section.html =
      "<p>The discriminator learns to tell simulated samples from logged ones; the design learns to fool it. At the "
      "dashed line it can only guess: it is right half the time, with a loss of 2&#8201;log&#8201;2. It need not get "
      "there, because it is measured on its own training samples, also those of earlier iterations.</p>\n" +
      WithKey(PlotKey().Add("line", "--designed", "each seed").Add("dash", "--truth", "guessing"), FigureGrid(figures));
  return section;
}

}  // namespace oted
