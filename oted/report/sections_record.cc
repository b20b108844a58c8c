#include "oted/report/sections_record.h"

#include <fmt/format.h>

#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

// One row per value; the names of nested objects are joined with dots.
void AddFacts(const json& object, const std::string& prefix, HtmlTable* table) {
  if (!object.is_object()) return;
  for (const auto& [key, value] : object.items()) {
    if (key == "schema") continue;
    const std::string name = prefix.empty() ? key : prefix + "." + key;
    if (value.is_object()) {
      AddFacts(value, name, table);
    } else {
      const std::string text = value.is_array() ? value.dump() : AsText(value);
      table->Row({Escape(name), text.empty() ? "–" : fmt::format("<code>{}</code>", Escape(text))});
    }
  }
}

HtmlTable FactTable() {
  HtmlTable table;
  table.Column("What", HtmlTable::Align::kText).Column("Value", HtmlTable::Align::kText);
  return table;
}

}  // namespace

Section WarningsSection(const json& report) {
  Section section{"warnings", "Warnings", "Warnings", ""};
  const json& warnings = ListAt(report, "warnings");
  if (warnings.empty()) return section;
  section.html =
      "<p>Warnings of the run. Each affects how far to trust the results.</p>\n"
      "<ul class=\"warnings\">";
  for (const json& warning : warnings) section.html += fmt::format("<li>{}</li>", Escape(AsText(warning)));
  section.html += "</ul>\n";
  return section;
}

Section RunSection(const json& report) {
  Section section{"run", "Run", "What was run", ""};
  HtmlTable table = FactTable();
  bool any = false;
  const auto add = [&](const json& object, const char* prefix) {
    if (!object.is_object() || object.empty()) return;
    AddFacts(object, prefix, &table);
    any = true;
  };
  const json run = report.value("run", json::object());
  if (run.contains("versions")) add(run["versions"], "");
  if (report.contains("dataset")) {
    const json& data = report["dataset"];
    add({{"path", TextAt(data, "path")}, {"sha256", TextAt(data, "sha256")}}, "dataset");
  }
  if (report.contains("design")) {
    for (const auto& [key, prefix] : {std::pair("model", "model"), std::pair("versions", "design.versions")}) {
      if (report["design"].contains(key)) add(report["design"][key], prefix);
    }
  }
  if (!any && !run.contains("config")) return section;
  section.html =
      "<p>What a repetition needs. The same data, configuration and seeds give the same results to the last digit on "
      "this machine, at any number of threads.</p>\n";
  if (any) section.html += table.Html();
  if (run.contains("config")) {
    section.html += fmt::format("<details><summary>Configuration (run.toml)</summary><pre>{}</pre></details>\n",
                                Escape(AsText(run["config"])));
  }
  return section;
}

}  // namespace oted
