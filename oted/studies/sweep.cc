#include "oted/studies/sweep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/seal.h"
#include "oted/run/design_record.h"
#include "oted/run/policy_records.h"
#include "oted/run/run_inputs.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// Of the compiled model, once for each task of this process.
std::string ModelHash(TaskConfig task) {
  static std::map<std::string, std::string> known;
  const std::string text = task.ToToml();
  const auto found = known.find(text);
  if (found != known.end()) return found->second;
  task.model.start = "default";  // as SpecOf
  return known[text] = MakeSimulatorFactory(task, {})->model_sha256();
}

using SweepRow = std::map<std::string, std::string>;

std::string Number(double value) { return fmt::format("{}", value); }

/// Adds a column where it is new, behind those that are there.
void Put(std::vector<std::string>& columns, SweepRow& row, const std::string& column, const std::string& value) {
  if (std::ranges::find(columns, column) == columns.end()) columns.push_back(column);
  row[column] = value;
}

void AddDesign(const DesignRecord& design, std::vector<std::string>& columns, SweepRow& row) {
  Put(columns, row, "verdict", ToString(design.verdict));
  for (const DesignRecord::Parameter& p : design.parameters) {
    Put(columns, row, p.name, Number(p.mode));
    Put(columns, row, p.name + ".low90", Number(p.interval90_low));
    Put(columns, row, p.name + ".high90", Number(p.interval90_high));
    Put(columns, row, p.name + ".verdict", ToString(p.verdict));
  }
}

void AddEvaluation(const EvaluationRecord& evaluation, std::vector<std::string>& columns, SweepRow& row) {
  for (const EvaluationRecord::Parameter& p : evaluation.parameters) {
    Put(columns, row, p.name + ".error", Number(p.absolute_error));
  }
  for (const EvaluationRecord::PolicyResult& p : evaluation.policies) {
    Put(columns, row, "return." + p.name, Number(p.mean_return));
  }
}

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// Four significant digits of what is a number, and no bar that would end the cell.
std::string TextCell(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (!text.empty() && *end == '\0' && text.find('.') != std::string::npos) return fmt::format("{:.4g}", value);
  std::string cell;
  for (const char c : text) cell += c == '|' ? std::string("\\|") : std::string(1, c);
  return cell;
}

}  // namespace

json SweepIdentity(const RunConfig& config, const std::string& command, const std::string& data_sha256) {
  RunConfig same = config;
  same.data.path.clear();
  for (DataConfig::Recording& recording : same.data.recordings) recording.path.clear();
  same.run.threads = 0;
  json settings = same.ToJson();
  // A built-in task's model comes with MuJoCo or Gymnasium; one of a file may include others.
  if (settings.contains("task")) settings["task"].erase("model");
  return {{"command", command}, {"settings", settings}, {"data", data_sha256}, {"model", ModelHash(config.task)}};
}

SweepTable SweepTable::Of(const std::vector<CollectedUnit>& units) {
  SweepTable table;
  std::vector<SweepRow> rows;
  for (const CollectedUnit& unit : units) {
    SweepRow& row = rows.emplace_back();
    for (const auto& [label, value] : unit.line.labels) Put(table.columns, row, label, value);
    const fs::path run = unit.folder / "result", design = run / "design.json", evaluation = run / "evaluation.json";
    AddDesign(DesignRecord::FromJson(ReadSealed(design), design.string()), table.columns, row);
    if (!fs::exists(evaluation)) continue;
    AddEvaluation(EvaluationRecord::FromJson(ReadSealed(evaluation), evaluation.string()), table.columns, row);
  }
  for (SweepRow& row : rows) {
    std::vector<std::string>& cells = table.rows.emplace_back();
    for (const std::string& column : table.columns) cells.push_back(row[column]);
  }
  return table;
}

std::string SweepTable::Csv() const {
  const auto line = [](const std::vector<std::string>& cells) {
    std::vector<std::string> quoted;
    for (const std::string& cell : cells) quoted.push_back(CsvCell(cell));
    return fmt::format("{}\n", fmt::join(quoted, ","));
  };
  std::string text = line(columns);
  for (const std::vector<std::string>& row : rows) text += line(row);
  return text;
}

std::string SweepTable::Text() const {
  const auto line = [](const std::vector<std::string>& cells) {
    std::string text = "|";
    for (const std::string& cell : cells) text += fmt::format(" {} |", TextCell(cell));
    return text + "\n";
  };
  std::string text = line(columns) + "|";
  for (size_t i = 0; i < columns.size(); ++i) text += "---|";
  text += "\n";
  for (const std::vector<std::string>& row : rows) text += line(row);
  return text;
}

}  // namespace oted
