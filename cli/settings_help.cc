#include "cli/settings_help.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "oted/config/run_config.h"
#include "oted/stages/design/design_method.h"

namespace oted::cli {
namespace {

std::string FieldHelp(const Field& field, const std::string& default_value) {
  const std::string range = field.range.ToString();
  return fmt::format("  {:<28} {} ({}{}) [default: {}]\n", field.name, field.help, field.TypeName(),
                     range.empty() ? "" : " in " + range, default_value);
}

/// The methods of the design, and the settings of its sections.
std::string DesignHelp() {
  DesignChoice defaults;
  DesignConfig config = defaults.Assumed();
  std::string text;
  for (const FieldList& section : config.Sections()) {
    text += fmt::format("\n[{}]\n", section.section());
    if (section.section() == "design") text += FieldHelp(defaults.MethodField(), "\"auto\"");
    for (const Field& field : section.fields()) {
      text += FieldHelp(field, DefaultInWords(section.section(), field.name));
    }
  }
  return text;
}

std::string MethodsHelp() {
  std::string text = "Methods of the design (design.method):\n";
  for (const MethodDescription& method : DesignMethods()) {
    std::vector<std::string> sections;
    for (const std::string& name : method.sections) sections.push_back(fmt::format("[design.{}]", name));
    text += fmt::format("  {:<14} {} (needs: {}; settings: {})\n", method.name, method.summary, NeedsInWords(method),
                        fmt::join(sections, ", "));
  }
  return text;
}

}  // namespace

std::string SettingsHelp(const std::vector<std::string>& sections) {
  const auto wanted = [&](const std::string& name) {
    return sections.empty() || std::ranges::find(sections, name) != sections.end();
  };
  RunConfig defaults;
  std::string text = wanted("design") ? MethodsHelp() + "\n" : "";
  text += "Settings (in the configuration file, or with --set section.key=value):\n";
  for (const FieldList& section : PlainSections(defaults)) {
    if (wanted(section.section())) {
      text += fmt::format("\n[{}]\n", section.section());
      for (const Field& field : section.fields()) text += FieldHelp(field, field.ToJson().dump());
    }
    if (section.section() == "clone" && wanted("design")) text += DesignHelp();
  }
  return text;
}

}  // namespace oted::cli
