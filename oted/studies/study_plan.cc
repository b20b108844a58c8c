#include "oted/studies/study_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "oted/base/error.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;
using Words = std::vector<std::string>;

void Append(Words& words, const char* flag, const Words& values) {
  words.push_back(flag);
  words.insert(words.end(), values.begin(), values.end());
}

void AppendAssignments(Words& words, const Words& assignments) {
  for (const std::string& assignment : assignments) Append(words, "--set", {assignment});
}

/// Hashes each dataset once.
class Inputs {
 public:
  explicit Inputs(const std::string& folder) : folder_(folder) {}
  std::string folder() const { return fs::absolute(folder_).lexically_normal().string(); }
  const PlanInput& Of(const std::string& task, const std::string& dataset) {
    const std::string name = fmt::format("{}-{}.hdf5", task, dataset);
    const auto found = known_.find(name);
    if (found != known_.end()) return found->second;
    const fs::path path = fs::path(folder()) / name;
    if (!fs::exists(path)) {
      throw DataError(
          fmt::format("'{}' does not exist; name the folder with TASK-DATASET.hdf5 by --data", path.string()));
    }
    return known_.emplace(name, PlanInput::Of(path)).first->second;
  }

 private:
  fs::path folder_;
  std::map<std::string, PlanInput> known_;
};

/// The folder as somebody else may have it: from where the plan is made, if it lies there.
std::string FromHere(const std::string& folder) {
  const fs::path near = fs::path(folder).lexically_proximate(fs::current_path());
  return fs::path(folder).is_relative() || *near.begin() == ".." ? folder : near.string();
}

/// @param words  all that determines the unit but for its inputs' content and place
PlanLine LineOf(std::string name, Words words, std::vector<PlanInput> inputs, const UnitNeeds& needs) {
  json hashes = json::object();
  for (const PlanInput& input : inputs) hashes[fs::path(input.path).filename().string()] = input.sha256;
  PlanLine line;
  line.key = UnitKey({{"words", words}, {"inputs", hashes}});
  line.name = std::move(name);
  line.words = std::move(words);
  line.inputs = std::move(inputs);
  line.needs = needs;
  return line;
}

void AppendValues(Words& words, const char* option, const std::map<std::string, double>& values) {
  for (const auto& [name, value] : values) Append(words, option, {fmt::format("{}={}", name, value)});
}

Words Table1Words(const Table1Study& study) {
  Words words = {"reproduce", "table1"};
  Append(words, "--task", study.tasks);
  Append(words, "--dataset", study.datasets);
  Append(words, "--parameters", study.parameters);
  Append(words, "--methods", study.methods);
  Append(words, "--design-method", {study.design_method});
  Append(words, "--algorithm", {study.algorithm});
  Append(words, "--steps", {std::to_string(study.steps)});
  Append(words, "--seed", {std::to_string(study.first_seed)});
  Append(words, "--seeds", {std::to_string(study.n_seeds)});
  AppendValues(words, "--guess", study.guess);
  AppendAssignments(words, study.assignments);
  return words;
}

void AddOnce(Words& list, const std::string& word) {
  if (!word.empty() && std::ranges::find(list, word) == list.end()) list.push_back(word);
}

/// Cells that one unit runs.
struct CellGroup {
  std::string name;
  Table1Study study;  ///< of these cells alone
};

/// A cell that collects for others comes with them (Table1Study::Cells).
std::vector<CellGroup> GroupsOf(const Table1Study& study) {
  std::vector<CellGroup> groups;
  for (const Table1Cell& cell : study.Cells()) {
    Table1Study alone = study;
    alone.tasks = {cell.task};
    alone.datasets = {cell.dataset.empty() ? "medium" : cell.dataset};
    alone.parameters = {cell.parameters.empty() ? "all" : cell.parameters};
    alone.methods = {NameOf(Table1MethodNames(), cell.method)};
    // The collector stands first in the cells of a study of bc_dr.
    const std::string name = alone.Cells().front().Name();
    const auto group = std::ranges::find(groups, name, &CellGroup::name);
    if (group == groups.end()) {
      if (cell.dataset.empty()) alone.datasets.clear();
      if (cell.parameters.empty()) alone.parameters.clear();
      groups.push_back({name, std::move(alone)});
    } else {
      AddOnce(group->study.datasets, cell.dataset);
      AddOnce(group->study.parameters, cell.parameters);
      AddOnce(group->study.methods, NameOf(Table1MethodNames(), cell.method));
    }
  }
  for (CellGroup& group : groups) {
    // Of no consequence, and the same in every plan.
    if (group.study.datasets.empty()) group.study.datasets = {"medium"};
    if (group.study.parameters.empty()) group.study.parameters = {"all"};
  }
  return groups;
}

void CheckCanRun(const Table1Study& study, const Table1Cell& cell) {
  const RunConfig config = study.ConfigOf(cell, study.first_seed);
  config.baselines.Check();
  ParameterSpace(config.parameters).CheckInside(config.agents.nominal_at);
}

}  // namespace

Plan PlanTable1(const Table1Study& study, const UnitNeeds& needs) {
  Inputs inputs(study.data_folder);
  Plan plan;
  plan.kind = PlanKind::kStudy;
  plan.command = Table1Words(study);
  Append(plan.command, "--data", {FromHere(study.data_folder)});
  const std::vector<CellGroup> groups = GroupsOf(study);
  for (int64_t seed = study.first_seed; seed < study.first_seed + study.n_seeds; ++seed) {
    for (CellGroup group : groups) {
      group.study.first_seed = seed;
      group.study.n_seeds = 1;
      std::map<std::string, PlanInput> read;
      for (const Table1Cell& cell : group.study.Cells()) {
        CheckCanRun(group.study, cell);
        if (!cell.dataset.empty()) read[cell.dataset] = inputs.Of(cell.task, cell.dataset);
      }
      std::vector<PlanInput> of_unit;
      for (auto& [unused, input] : read) of_unit.push_back(std::move(input));
      const std::string name =
          fmt::format("{}{} seed {}", group.name, group.study.methods.size() > 1 ? " and bc_dr" : "", seed);
      plan.lines.push_back(LineOf(name, Table1Words(group.study), std::move(of_unit), needs));
      Append(plan.lines.back().words, "--data", {inputs.folder()});
    }
  }
  return plan;
}

Plan PlanDesignStudy(const std::string& name, const DesignStudy& study, const UnitNeeds& needs) {
  Inputs inputs(study.data_folder);
  const auto words_of = [&](const Words& tasks, const Words& datasets, const Words& parameters) {
    Words words = {"reproduce", name};
    Append(words, "--task", tasks);
    Append(words, "--dataset", datasets);
    Append(words, "--parameters", parameters);
    AppendValues(words, "--target", study.target);
    Append(words, "--design-method", {study.design_method});
    Append(words, "--seeds", {std::to_string(study.n_seeds)});
    Append(words, "--seed", {std::to_string(study.seed)});
    AppendAssignments(words, study.assignments);
    return words;
  };
  Plan plan;
  plan.kind = PlanKind::kStudy;
  plan.command = words_of(study.tasks, study.datasets, study.parameters);
  Append(plan.command, "--data", {FromHere(study.data_folder)});
  for (const StudyCell& cell : study.Cells()) {
    plan.lines.push_back(LineOf(cell.Name(), words_of({cell.task}, {cell.dataset}, {cell.parameters}),
                                {inputs.Of(cell.task, cell.dataset)}, needs));
    Append(plan.lines.back().words, "--data", {inputs.folder()});
  }
  return plan;
}

Plan PlanDensityStudy(const DensityStudy& study, const UnitNeeds& needs) {
  const auto words_of = [](const DensityStudy& part) {
    Words words = {"reproduce", "figure3"}, targets, demonstrations;
    for (const double target : part.targets) targets.push_back(fmt::format("{}", target));
    for (const int n : part.demonstrations) demonstrations.push_back(std::to_string(n));
    Append(words, "--density", targets);
    Append(words, "--demonstrations", demonstrations);
    Append(words, "--designer", part.designers);
    Append(words, "--policy", {part.policy});
    Append(words, "--seeds", {std::to_string(part.n_seeds)});
    Append(words, "--seed", {std::to_string(part.first_seed)});
    AppendAssignments(words, part.assignments);
    return words;
  };
  Plan plan;
  plan.kind = PlanKind::kStudy;
  plan.command = words_of(study);
  for (int64_t seed = study.first_seed; seed < study.first_seed + study.n_seeds; ++seed) {
    for (const DensityCell& cell : study.Cells()) {
      DensityStudy part = study;
      part.targets = {cell.target};
      part.demonstrations = {cell.n_demonstrations};
      part.designers = {cell.designer};
      part.first_seed = seed;
      part.n_seeds = 1;
      plan.lines.push_back(LineOf(fmt::format("{} seed {}", cell.Name(), seed), words_of(part), {}, needs));
    }
  }
  return plan;
}

}  // namespace oted
