#include "oted/report/gather.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/report/curves.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr size_t kMostPoints = 1000;

// A result file of the given schema, or null when there is none.
json ReadResult(const fs::path& path, const std::string& schema) {
  if (!fs::exists(path)) return nullptr;
  json result = ReadSealed(path, true);
  const std::string got = result.is_object() ? TextAt(result, "schema") : "";
  if (!schema.empty() && got != schema) {
    throw DataError(
        fmt::format("'{}' has schema '{}', wanted '{}'; run the stage that wrote it again with this version",
                    path.string(), got, schema));
  }
  CheckMadeFrom(result, path);
  return result;
}

// The curves beside `record`, which `file` is; null when it is not there yet.
json CurvesOf(const fs::path& file, const json& record) {
  json result = json::object();
  const fs::path folder = file.parent_path();
  if (!fs::exists(folder / "curves.csv")) return result;
  CheckSealedFile(record, file, "curves.csv");
  for (const auto& [key, curve] : ReadCurves(folder / "curves.csv").by_key) {
    const size_t stride = (curve.size() + kMostPoints - 1) / kMostPoints;
    json points = json::array();
    // Counted from the last point, which is the one that matters.
    for (size_t i = (curve.size() - 1) % stride; i < curve.size(); i += stride) {
      const double value = curve[i].second;
      points.push_back({curve[i].first, std::isfinite(value) ? json(value) : json()});
    }
    result[key] = std::move(points);
  }
  return result;
}

// A stage's record as `name`, and the curves beside it.
json WithCurves(const fs::path& file, const std::string& schema, const char* name) {
  json record = ReadResult(file, schema);
  json curves = CurvesOf(file, record);
  return {{name, std::move(record)}, {"curves", std::move(curves)}};
}

// The folders in `parent`, numbers in numerical order.
std::vector<std::string> Folders(const fs::path& parent) {
  std::vector<std::string> names;
  if (!fs::is_directory(parent)) return names;
  for (const auto& entry : fs::directory_iterator(parent)) {
    if (entry.is_directory()) names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) {
    const auto is_number = [](const std::string& s) { return s.find_first_not_of("0123456789") == std::string::npos; };
    if (is_number(a) && is_number(b) && a.size() != b.size()) return a.size() < b.size();
    return a < b;
  });
  return names;
}

json Agents(const fs::path& folder) {
  json agents = json::array();
  for (const std::string& name : Folders(folder)) {
    json agent = WithCurves(folder / name / "agent.json", "oted.agent/1", "result");
    agent["name"] = name;
    if (!agent["result"].is_null() || !agent["curves"].empty()) agents.push_back(std::move(agent));
  }
  return agents;
}

// The agents of every baseline, with its name.
json Baselines(const fs::path& folder) {
  json all = json::array();
  for (const std::string& baseline : Folders(folder)) {
    for (json& agent : Agents(folder / baseline)) {
      agent["baseline"] = baseline;
      all.push_back(std::move(agent));
    }
  }
  return all;
}

void GatherDesignSeeds(const fs::path& run_dir, json* report) {
  const std::vector<std::string> settings = Folders(run_dir / "design");
  if (settings.empty()) return;
  std::string shown = report->contains("design") ? TextAt((*report)["design"], "selected") : "";
  if (std::find(settings.begin(), settings.end(), shown) == settings.end()) shown = settings.front();
  json seeds = json::array();
  for (const std::string& name : Folders(run_dir / "design" / shown)) {
    json seed = WithCurves(run_dir / "design" / shown / name / "q.json", "oted.q/1", "q");
    seed["name"] = name;
    if (!seed["curves"].empty() || !seed["q"].is_null()) seeds.push_back(std::move(seed));
  }
  if (seeds.empty()) return;
  (*report)["shown_setting"] = shown;
  (*report)["design_seeds"] = std::move(seeds);
}

// The modes of the selected setting's seeds for parameter number `index`.
json SeedModes(const json& design, size_t index) {
  json modes = json::array();
  for (const json& member : ListAt(design, "mixture")) {
    const json& mode = ListAt(member, "mode");
    if (index < mode.size()) modes.push_back(mode[index]);
  }
  return modes;
}

// design.json's parameters, with what the evaluation knows of each; the evaluation's own when nothing was designed.
json Parameters(const json& report) {
  const json& known = report.contains("evaluation") ? ListAt(report["evaluation"], "parameters") : EmptyList();
  if (!report.contains("design")) return known;
  json parameters = ListAt(report["design"], "parameters");
  for (size_t i = 0; i < parameters.size(); ++i) {
    parameters[i]["seed_modes"] = SeedModes(report["design"], i);
    for (const json& other : known) {
      if (TextAt(other, "name") != TextAt(parameters[i], "name")) continue;
      for (const char* key : {"truth", "absolute_error"}) {
        if (other.contains(key)) parameters[i][key] = other[key];
      }
    }
  }
  return parameters;
}

std::string Title(const json& report, const fs::path& run_dir) {
  for (const char* file : {"evaluation", "design"}) {
    if (report.contains(file) && !TextAt(report[file], "task").empty()) return TextAt(report[file], "task");
  }
  if (report.contains("design") && report["design"].contains("model")) {
    const std::string task = TextAt(report["design"]["model"], "task");
    if (!task.empty()) return task;
  }
  return fs::absolute(run_dir).lexically_normal().filename().string();
}

/// A dataset.json of another run would stand beside this run's results.
void CheckSameData(const json& report, const fs::path& run_dir) {
  if (!report.contains("dataset") || !report.contains("design") || !report["design"].contains("dataset")) return;
  if (TextAt(report["dataset"], "sha256") == TextAt(report["design"]["dataset"], "sha256")) return;
  throw DataError(
      fmt::format("'{}' is of other data than 'design.json' there; restore it, or repeat the command that made the run",
                  (run_dir / "dataset.json").string()));
}

json Gather(const fs::path& run_dir) {
  json report = {{"schema", "oted.report/1"}};
  const auto add = [&](const char* key, json value) {
    if (!value.empty()) report[key] = std::move(value);
  };
  add("dataset", ReadResult(run_dir / "dataset.json", "oted.dataset/1"));
  add("design", ReadResult(run_dir / "design.json", "oted.design/1"));
  CheckSameData(report, run_dir);
  add("export", ReadResult(run_dir / "export" / "export.json", "oted.export/1"));
  add("policy_selection", ReadResult(run_dir / "policy_selection.json", "oted.policy_selection/1"));
  add("replay", ReadResult(run_dir / "motion" / "replay.json", "oted.replay/1"));
  add("motion", ReadResult(run_dir / "motion" / "motion.json", "oted.motion/1"));
  add("evaluation", ReadResult(run_dir / "evaluation.json", "oted.evaluation/1"));
  json clone = WithCurves(run_dir / "clone" / "clone.json", "oted.clone/1", "result");
  if (!clone["result"].is_null() || !clone["curves"].empty()) report["clone"] = std::move(clone);
  GatherDesignSeeds(run_dir, &report);
  add("agents", Agents(run_dir / "agents"));
  add("nominal", Agents(run_dir / "nominal"));
  add("baselines", Baselines(run_dir / "baselines"));
  add("parameters", Parameters(report));
  if (report.contains("evaluation")) add("policies", ListAt(report["evaluation"], "policies"));
  if (report.contains("design")) add("warnings", ListAt(report["design"], "warnings"));
  if (report.size() == 1) {
    throw UsageError(fmt::format(
        "'{}' holds no results to report; name the folder that was given as --out to 'oted run'", run_dir.string()));
  }
  json run;
  if (fs::exists(run_dir / "run.toml")) {
    run["config"] = ReadSealedText(run_dir / "run.toml", "or write it anew with the command that made the run");
  }
  const json versions = ReadResult(run_dir / "versions.json", "");
  if (!versions.is_null()) run["versions"] = versions;
  add("run", std::move(run));
  report["title"] = Title(report, run_dir);
  return report;
}

}  // namespace

nlohmann::json GatherReport(const fs::path& run_dir) {
  if (!fs::is_directory(run_dir)) {
    throw UsageError(
        fmt::format("'{}' is no folder; name the folder that was given as --out to 'oted run'", run_dir.string()));
  }
  try {
    return Gather(run_dir);
  } catch (const json::exception& error) {
    throw DataError(
        fmt::format("a result file in '{}' does not have the layout of its schema ({}); run the stage that "
                    "wrote it again",
                    run_dir.string(), error.what()));
  }
}

}  // namespace oted
