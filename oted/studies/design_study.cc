#include "oted/studies/design_study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/statistics.h"

namespace oted {
namespace {

using nlohmann::json;

const std::map<std::string, std::string> kTasks = {
    {"halfcheetah", "HalfCheetah-v5"}, {"hopper", "Hopper-v5"}, {"walker2d", "Walker2d-v5"}};
const std::vector<std::string> kDatasets = {"medium", "medium-expert", "expert"};
const std::vector<std::string> kAlone = {"friction", "gain", "gravity"};
const std::map<std::string, std::string> kFields = {
    {"friction", "geom/*/friction[0]"}, {"gain", "actuator/*/gainprm[0]"}, {"gravity", "opt/gravity[2]"}};

/// The ways of selecting, and whether the highest score wins.
struct Ranking {
  const char* key;   // of a setting in design.json
  const char* name;  // in tables
  bool highest;
  bool needs_seeds = false;  ///< one seed deviates from nothing
};
constexpr Ranking kRankings[] = {{"design_deviation", "design deviation", false, true},
                                 {"learning_progress", "learning progress", true},
                                 {"c", "log ratios c(h)", true},
                                 {"common", "common judge", true}};

/// The paper's Table 2: errors of the setting picked by design deviation, learning progress, log ratios; (spread). In
/// what unit is not said.
const std::map<std::string, std::vector<const char*>> kPaperTable2 = {
    {"halfcheetah-expert", {"0.064 (0.003)", "0.064 (0.003)", "0.064 (0.003)"}},
    {"halfcheetah-medium-expert", {"0.061 (0.016)", "0.061 (0.016)", "0.061 (0.016)"}},
    {"halfcheetah-medium", {"0.073 (0.005)", "0.071 (0.007)", "0.071 (0.007)"}},
    {"hopper-expert", {"0.419 (0.024)", "0.196 (0.03)", "0.196 (0.03)"}},
    {"hopper-medium-expert", {"0.158 (0.044)", "0.621 (0.455)", "0.621 (0.455)"}},
    {"hopper-medium", {"0.203 (0.025)", "0.235 (0.034)", "0.203 (0.025)"}},
    {"walker2d-expert", {"0.127 (0.021)", "2.607 (0.856)", "0.101 (0.02)"}},
    {"walker2d-medium-expert", {"0.144 (0.03)", "0.421 (0.141)", "0.144 (0.03)"}},
    {"walker2d-medium", {"0.37 (0.037)", "1.416 (0.667)", "0.287 (0.038)"}}};

constexpr double kLow = 0.2, kHigh = 2.0;  // of every parameter

/// Of a record's parameter; the nominal one where the record does not say.
double TargetIn(const json& record, const std::string& name) {
  return record.contains("target") ? record.at("target").at(name).get<double>() : 1.0;
}

double ErrorOfMiddle(double target) { return std::abs(0.5 * (kLow + kHigh) - target); }

/// "0.026 (0.009)"; one seed has no spread.
std::string WithSpread(double mean, double std, size_t n_seeds) {
  return n_seeds > 1 ? fmt::format("{:.3f} ({:.3f})", mean, std) : fmt::format("{:.3f}", mean);
}

void CheckKnown(const char* what, const std::vector<std::string>& asked, const std::vector<std::string>& known) {
  for (const std::string& name : asked) {
    if (std::ranges::find(known, name) == known.end()) {
      throw UsageError(
          fmt::format("{} '{}', wanted some of {}{}", what, name, fmt::join(known, "|"), DidYouMean(name, known)));
    }
  }
}

}  // namespace

void SetNamedValue(std::map<std::string, double>& values, const std::string& option, const std::string& assignment) {
  const size_t equals = assignment.find('=');
  char* end = nullptr;
  const double value = equals == std::string::npos ? 0 : std::strtod(assignment.c_str() + equals + 1, &end);
  const std::string name = assignment.substr(0, equals);
  if (equals == std::string::npos || equals + 1 == assignment.size() || *end != '\0' || !values.contains(name)) {
    throw UsageError(fmt::format("{} {}: wanted friction=, gain= or gravity= and a number", option, assignment));
  }
  values[name] = value;
}

DesignStudy DesignStudy::Named(const std::string& name) {
  DesignStudy study;
  if (name == "table2") return study;
  if (name != "figure2") throw UsageError(fmt::format("reproduce '{}', wanted table2|figure2", name));
  study.parameters = {"friction", "gain", "gravity", "all"};
  study.grid = false;
  study.n_seeds = 5;
  return study;
}

std::vector<StudyCell> DesignStudy::Cells() const {
  std::vector<std::string> known_tasks, known_parameters = kAlone;
  for (const auto& [task, unused] : kTasks) known_tasks.push_back(task);
  known_parameters.push_back("all");
  CheckKnown("task", tasks, known_tasks);
  CheckKnown("dataset", datasets, kDatasets);
  CheckKnown("parameters", parameters, known_parameters);
  std::vector<StudyCell> cells;
  for (const std::string& task : tasks) {
    for (const std::string& dataset : datasets) {
      for (const std::string& which : parameters) cells.push_back({task, dataset, which});
    }
  }
  return cells;
}

RunConfig DesignStudy::ConfigOf(const StudyCell& cell) const {
  RunConfig config;
  config.task.name = kTasks.at(cell.task);
  config.data.path = fmt::format("{}/{}-{}.hdf5", data_folder, cell.task, cell.dataset);
  for (const std::string& name : kAlone) {
    if (cell.parameters != "all" && cell.parameters != name) continue;
    config.parameters.push_back({.name = name, .field = kFields.at(name), .low = kLow, .high = kHigh});
    config.truth[name] = target.at(name);
  }
  config.run.seed = seed;
  config.run.threads = threads;
  config.selection.n_seeds = n_seeds;
  config.report.motion = Motion::kFalse;
  config.Set("design.method=" + design_method);
  for (const std::string& assignment : assignments) config.Set(assignment);
  if (grid) {
    // The paper does not tell its grid. A third of the rollouts' length, a third of g's steps, the other reward.
    const DesignConfig usual = config.design.Assumed();
    for (const int horizon : {usual.adversarial.horizon, usual.adversarial.horizon / 3}) {
      for (const int steps : {usual.discriminator.steps, usual.discriminator.steps / 3}) {
        for (const char* reward : {"paper", "log_ratio"}) {
          DesignChoice& setting = config.settings[fmt::format("h{}-g{}-{}", horizon, steps, reward)];
          setting = config.design;
          setting.Set("adversarial.horizon", horizon, "the study's pool");
          setting.Set("discriminator.steps", steps, "the study's pool");
          setting.Set("adversarial.reward", reward, "the study's pool");
        }
      }
    }
  }
  return config;
}

json DesignStudy::IdentityOf(const StudyCell& cell) const {
  return {{"task", cell.task},
          {"dataset", cell.dataset},
          {"parameters", cell.parameters},
          {"target", target},
          {"design_method", design_method},
          {"assignments", assignments},
          {"n_seeds", n_seeds},
          {"seed", seed}};
}

void DesignStudy::CheckIsOfThis(const StudyCell& cell, const json& record) const {
  const json identity = IdentityOf(cell);
  for (const auto& [name, value] : identity.items()) {
    // Records that lack it are older than it.
    if (!record.contains(name) || record.at(name) == value) continue;
    throw UsageError(fmt::format("{} was run with {} = {} and this study has {}; take another --out", cell.Name(), name,
                                 record.at(name).dump(), value.dump()));
  }
}

json ScoreCell(const DesignStudy& study, const StudyCell& cell, const json& design) {
  json record = study.IdentityOf(cell);
  record.update({{"schema", "oted.cell/1"},
                 {"n_transitions", design.at("dataset").at("n_transitions")},
                 {"verdict", design.at("verdict")},
                 {"names", json::array()},
                 {"settings", json::array()}});
  std::vector<double> truth, middle;
  for (const json& parameter : design.at("parameters")) {
    record["names"].push_back(parameter.at("name"));
    truth.push_back(TargetIn(record, parameter.at("name")));
    middle.push_back(ErrorOfMiddle(truth.back()));
  }
  record["middle_error"] = Mean(middle);
  std::vector<double> errors;
  for (const json& setting : design.at("settings")) {
    std::vector<double> of_seeds;
    json modes = json::array();
    for (const json& seed : setting.at("seeds")) {
      const auto mode = seed.at("mode").get<std::vector<double>>();
      double sum = 0;
      for (size_t i = 0; i < truth.size(); ++i) sum += std::abs(mode.at(i) - truth[i]);
      of_seeds.push_back(sum / static_cast<double>(truth.size()));
      modes.push_back(seed.at("mode"));
    }
    errors.push_back(Mean(of_seeds));
    json entry = {{"name", setting.at("name")},
                  {"method", setting.at("method")},
                  {"error", errors.back()},
                  {"error_std", StandardDeviation(of_seeds)},
                  {"modes", modes}};
    for (const Ranking& ranking : kRankings) {
      if (setting.contains(ranking.key)) entry[ranking.key] = setting.at(ranking.key);
    }
    record["settings"].push_back(entry);
  }
  const auto [best, worst] = std::ranges::minmax(errors);
  record["best_error"] = best;
  record["worst_error"] = worst;
  record["counts"] = worst >= 3 * best;
  record["picks"]["random"] = {{"error", Mean(errors)}, {"regret", Mean(errors) - best}};
  for (const Ranking& ranking : kRankings) {
    const auto has = [&](const json& setting) { return setting.contains(ranking.key); };
    if (!std::ranges::all_of(record["settings"], has)) continue;  // what only Algorithm 1 leaves
    if (ranking.needs_seeds && study.n_seeds < 2) continue;
    size_t pick = 0;
    const auto score = [&](size_t i) { return record["settings"][i].at(ranking.key).get<double>(); };
    for (size_t i = 1; i < errors.size(); ++i) {
      if (ranking.highest ? score(i) > score(pick) : score(i) < score(pick)) pick = i;
    }
    record["picks"][ranking.key] = {{"setting", record["settings"][pick].at("name")},
                                    {"error", errors[pick]},
                                    {"error_std", record["settings"][pick].at("error_std")},
                                    {"regret", errors[pick] - best}};
  }
  return record;
}

std::string Table2(const std::vector<json>& cells) {
  std::string text = "| cell | middle of the range | best, worst of the pool | random |";
  for (const Ranking& ranking : kRankings) text += fmt::format(" {} |", ranking.name);
  text += " paper: deviation, progress, log ratios (unit unknown) |\n|---|---|---|---|";
  for ([[maybe_unused]] const Ranking& ranking : kRankings) text += "---|";
  text += "---|\n";
  std::map<std::string, int> zero_regret;
  int n_count = 0;
  for (const json& cell : cells) {
    const std::string name =
        fmt::format("{}-{}", cell.at("task").get<std::string>(), cell.at("dataset").get<std::string>());
    const bool counts = cell.at("counts");
    n_count += counts;
    text += fmt::format("| {}{} | {:.3f} | {:.3f}, {:.3f} | {:.3f} |", name, counts ? "" : " (pool too even)",
                        cell.value("middle_error", ErrorOfMiddle(1)), cell.at("best_error").get<double>(),
                        cell.at("worst_error").get<double>(), cell.at("picks").at("random").at("error").get<double>());
    for (const Ranking& ranking : kRankings) {
      if (!cell.at("picks").contains(ranking.key)) {
        text += " – |";
        continue;
      }
      const json& pick = cell.at("picks").at(ranking.key);
      const double regret = pick.at("regret");
      zero_regret[ranking.key] += counts && regret == 0;
      const size_t n_seeds = cell.at("settings").at(0).at("modes").size();
      text += fmt::format(" {}{} |", WithSpread(pick.at("error"), pick.at("error_std"), n_seeds),
                          regret == 0 ? "" : fmt::format(", regret {:.3f}", regret));
    }
    const auto paper = kPaperTable2.find(name);
    text += paper == kPaperTable2.end() ? " |\n" : fmt::format(" {} |\n", fmt::join(paper->second, ", "));
  }
  text += fmt::format("\nZero regret, of {} pools whose worst error is at least three times the best:", n_count);
  for (const Ranking& ranking : kRankings) {
    if (zero_regret.contains(ranking.key)) text += fmt::format(" {} {};", ranking.name, zero_regret[ranking.key]);
  }
  text.back() = '.';
  return text + "\n";
}

std::string Figure2(const std::vector<json>& cells) {
  std::string text =
      "| cell | friction | gain | gravity | jointly: friction | gain | gravity | middle of the range: each |\n"
      "|---|---|---|---|---|---|---|---|\n";
  // Mean absolute error over seeds of one parameter, "" where the cell is missing.
  const auto error = [&](const std::string& task, const std::string& dataset, const std::string& which,
                         const std::string& name) -> std::string {
    for (const json& cell : cells) {
      if (cell.at("task") != task || cell.at("dataset") != dataset || cell.at("parameters") != which) continue;
      const auto names = cell.at("names").get<std::vector<std::string>>();
      if (std::ranges::find(names, name) == names.end()) return "";
      const size_t at = static_cast<size_t>(std::ranges::find(names, name) - names.begin());
      std::vector<double> errors;
      for (const json& mode : cell.at("settings").at(0).at("modes")) {
        errors.push_back(std::abs(mode.at(at).get<double>() - TargetIn(cell, name)));
      }
      return WithSpread(Mean(errors), StandardDeviation(errors), errors.size());
    }
    return "";
  };
  const auto middle = [&](const std::string& task, const std::string& dataset, const std::string& name) {
    for (const json& cell : cells) {
      if (cell.at("task") == task && cell.at("dataset") == dataset) return ErrorOfMiddle(TargetIn(cell, name));
    }
    return 0.0;
  };
  std::vector<std::pair<std::string, std::string>> rows;
  for (const json& cell : cells) {
    const std::pair<std::string, std::string> row = {cell.at("task"), cell.at("dataset")};
    if (std::ranges::find(rows, row) == rows.end()) rows.push_back(row);
  }
  for (const auto& [task, dataset] : rows) {
    text += fmt::format("| {}-{} |", task, dataset);
    for (const std::string& name : kAlone) text += fmt::format(" {} |", error(task, dataset, name, name));
    for (const std::string& name : kAlone) text += fmt::format(" {} |", error(task, dataset, "all", name));
    for (size_t i = 0; i < kAlone.size(); ++i) {
      text += fmt::format("{}{:.3f}", i == 0 ? " " : ", ", middle(task, dataset, kAlone[i]));
    }
    text += " |\n";
  }
  return text;
}

}  // namespace oted
