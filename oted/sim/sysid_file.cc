#include "oted/sim/sysid_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

constexpr std::uintmax_t kLargest = 1 << 20;

// YAML 1.1, which PyYAML reads, takes 1e-05 for text: a number with an exponent needs a point.
std::string Number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find('.') != std::string::npos) return text;
  const size_t exponent = text.find('e');
  return exponent == std::string::npos ? text + ".0" : text.insert(exponent, ".0");
}

// JSON's quoted text is YAML's.
std::string Quoted(const std::string& text) { return nlohmann::json(text).dump(); }

// What one entry's errors begin with.
struct Entry {
  std::string where;
  YAML::Node node;

  YAML::Node Get(const char* key) const {
    const YAML::Node value = node[key];
    if (!value.IsDefined()) {
      throw DataError(
          fmt::format("{} has no '{}'; write name, nominal, min_value, max_value, value and frozen for "
                      "each parameter, as mujoco.sysid's save_to_disk does",
                      where, key));
    }
    return value;
  }
  // mujoco.sysid writes every number as a list of one.
  double GetNumber(const char* key) const {
    YAML::Node value = Get(key);
    if (value.IsSequence() && value.size() != 1) {
      throw DataError(
          fmt::format("{} has {} numbers in '{}', wanted one; write one parameter for each number, each with "
                      "its own field",
                      where, value.size(), key));
    }
    if (value.IsSequence()) value = value[0];
    double number = 0;
    if (!value.IsScalar() || !YAML::convert<double>::decode(value, number) || !std::isfinite(number)) {
      throw DataError(fmt::format("{}: '{}' is no finite number; correct it", where, key));
    }
    return number;
  }
  bool GetFlag(const char* key) const {
    bool flag = false;
    const YAML::Node value = Get(key);
    if (!value.IsScalar() || !YAML::convert<bool>::decode(value, flag)) {
      throw DataError(fmt::format("{}: '{}' is neither true nor false; correct it", where, key));
    }
    return flag;
  }
  std::string GetText(const char* key) const {
    const YAML::Node value = Get(key);
    if (!value.IsScalar()) throw DataError(fmt::format("{}: '{}' is no text; correct it", where, key));
    return value.Scalar();
  }
};

SysidParameter ReadEntry(const Entry& entry, const std::string& name) {
  if (!entry.node.IsMap()) throw DataError(fmt::format("{} is no table of name, nominal, min_value, ...", entry.where));
  SysidParameter parameter;
  ParameterSpec& spec = parameter.spec;
  spec.name = name;
  spec.nominal = entry.GetNumber("nominal");
  spec.low = entry.GetNumber("min_value");
  spec.high = entry.GetNumber("max_value");
  if (!(spec.low < spec.high)) {
    throw DataError(fmt::format("{}: min_value is {} and max_value {}, wanted min_value < max_value", entry.where,
                                spec.low, spec.high));
  }
  parameter.value = entry.GetNumber("value");
  parameter.frozen = entry.GetFlag("frozen");
  if (!entry.node["field"].IsDefined()) return parameter;
  parameter.has_ours = true;
  spec.field = entry.GetText("field");
  const std::string scale = entry.GetText("scale");
  if (scale != "nominal" && scale != "absolute") {
    throw DataError(fmt::format("{}: scale is '{}', wanted nominal or absolute", entry.where, scale));
  }
  if (scale == "absolute") spec.scale = ParameterScale::kAbsolute;
  spec.logarithmic = entry.GetFlag("log");
  if (entry.node["unit"].IsDefined()) spec.unit = entry.GetText("unit");
  return parameter;
}

bool Near(double a, double b) { return std::abs(a - b) <= 1e-9 * std::max(1.0, std::abs(b)); }

}  // namespace

std::string SysidText(const std::vector<SysidParameter>& parameters, const std::string& comment) {
  std::string text = "# ";
  for (const char c : comment) text += c == '\n' ? std::string("\n# ") : std::string(1, c);
  text += "\n";
  for (const SysidParameter& parameter : parameters) {
    const ParameterSpec& spec = parameter.spec;
    text += fmt::format("{}:\n", Quoted(spec.name));
    text += fmt::format("  name: {}\n", Quoted(spec.name));
    text += fmt::format("  nominal: [{}]\n", Number(spec.nominal));
    text += fmt::format("  min_value: [{}]\n", Number(spec.low));
    text += fmt::format("  max_value: [{}]\n", Number(spec.high));
    text += fmt::format("  value: [{}]\n", Number(parameter.value));
    text += fmt::format("  frozen: {}\n", parameter.frozen);
    text += fmt::format("  field: {}\n", Quoted(spec.field));
    text += fmt::format("  scale: {}\n", spec.scale == ParameterScale::kAbsolute ? "absolute" : "nominal");
    text += fmt::format("  log: {}\n", spec.logarithmic);
    text += fmt::format("  unit: {}\n", Quoted(spec.unit));
  }
  return text;
}

std::vector<SysidParameter> ReadSysidFile(const std::filesystem::path& path) {
  std::error_code error;
  if (const auto size = std::filesystem::file_size(path, error); !error && size > kLargest) {
    throw DataError(
        fmt::format("'{}' has {} bytes, a parameter file at most {}; name the file that mujoco.sysid's "
                    "save_to_disk wrote",
                    path.string(), size, kLargest));
  }
  std::vector<SysidParameter> parameters;
  try {
    const YAML::Node document = YAML::Load(ReadFile(path));
    if (!document.IsMap() || document.size() == 0) {
      throw DataError(
          fmt::format("'{}' is no table of parameters; name a file that mujoco.sysid's save_to_disk or 'oted export "
                      "--sysid' wrote",
                      path.string()));
    }
    for (const auto& item : document) {
      const std::string name = item.first.IsScalar() ? item.first.Scalar() : "";
      if (name.empty()) throw DataError(fmt::format("'{}' has a parameter without a name; name it", path.string()));
      parameters.push_back(ReadEntry({fmt::format("'{}': parameter '{}'", path.string(), name), item.second}, name));
    }
  } catch (const YAML::Exception& e) {
    throw DataError(fmt::format("'{}' is not YAML: {}; correct it or write it again", path.string(), e.what()));
  }
  return parameters;
}

std::vector<ParameterSpec> MergeSysid(const std::vector<SysidParameter>& file, const std::string& file_name,
                                      const std::vector<ParameterSpec>& declared, const std::vector<bool>& has_range) {
  OTED_CHECK(declared.size() == has_range.size());
  std::vector<ParameterSpec> merged;
  std::vector<bool> used(declared.size(), false);
  for (const SysidParameter& parameter : file) {
    ParameterSpec spec = parameter.spec;
    const auto found =
        std::find_if(declared.begin(), declared.end(), [&](const auto& d) { return d.name == spec.name; });
    if (found != declared.end()) {
      const size_t i = static_cast<size_t>(found - declared.begin());
      used[i] = true;
      spec = *found;
      if (!has_range[i]) {
        spec.low = parameter.spec.low;
        spec.high = parameter.spec.high;
      }
      spec.nominal = parameter.spec.nominal;
    }
    if (parameter.frozen) {
      if (Near(parameter.value, parameter.spec.nominal)) continue;
      throw UsageError(
          fmt::format("'{}': parameter '{}' is frozen at {}, but a parameter that is not searched stays at the model's "
                      "own value, {}; change the model, or set frozen: false",
                      file_name, spec.name, parameter.value, parameter.spec.nominal));
    }
    if (spec.field.empty()) {
      throw UsageError(fmt::format(
          "'{}' does not say what parameter '{}' changes, as mujoco.sysid keeps that in Python; add {} = {{ "
          "field = \"geom/*/friction[0]\" }} (with its own path) to [parameters], or a line 'field:' to the "
          "file",
          file_name, spec.name, spec.name));
    }
    if (spec.IsMultiple() && !Near(spec.nominal, 1)) {
      throw UsageError(
          fmt::format("'{}': the nominal value of parameter '{}' is {}, but that of a multiple of the model's value is "
                      "1; set scale = \"absolute\" for it",
                      file_name, spec.name, spec.nominal));
    }
    if (spec.scale == ParameterScale::kAbsolute) spec.wanted_nominal = spec.nominal;
    merged.push_back(spec);
  }
  for (size_t i = 0; i < declared.size(); ++i) {
    if (used[i]) continue;
    merged.push_back(declared[i]);
  }
  return merged;
}

}  // namespace oted
