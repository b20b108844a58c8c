#include "cli/verbs/sweep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "cli/numbers.h"
#include "cli/options.h"
#include "cli/value_kinds.h"
#include "cli/verbs/plan.h"
#include "cli/verbs/submit.h"
#include "oted/base/error.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/studies/sweep.h"

namespace oted::cli {
namespace {

namespace fs = std::filesystem;

struct SweepOptions {
  std::string command = "design";
  Options run;  ///< what all runs share
  std::vector<std::string> data, vary;
  std::vector<int64_t> seeds;
  PlanTarget target;
  SubmitOptions submit;
};

/// One value of everything that varies.
struct Point {
  std::string data;
  std::vector<std::pair<std::string, std::string>> settings;
  int64_t seed = -1;
};

/// By setting, in the order in which they were first named.
std::vector<std::pair<std::string, std::vector<std::string>>> Axes(const std::vector<std::string>& vary) {
  std::vector<std::pair<std::string, std::vector<std::string>>> axes;
  for (const std::string& assignment : vary) {
    const size_t equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw UsageError(fmt::format("--vary {}: wanted section.key=value", assignment));
    }
    const std::string key = assignment.substr(0, equals);
    const auto same = [&](const auto& axis) { return axis.first == key; };
    auto axis = std::ranges::find_if(axes, same);
    if (axis == axes.end()) axis = axes.insert(axes.end(), {key, {}});
    axis->second.push_back(assignment.substr(equals + 1));
  }
  return axes;
}

/// Every combination; the last axis varies fastest, and seeds before it.
std::vector<Point> Points(const SweepOptions& options) {
  std::vector<Point> points = {{}};
  const auto extend = [&](const auto& values, const auto& set) {
    std::vector<Point> more;
    for (const Point& point : points) {
      for (const auto& value : values) set(more.emplace_back(point), value);
    }
    if (!values.empty()) points = std::move(more);
  };
  extend(options.data, [](Point& point, const std::string& data) { point.data = data; });
  for (const auto& [key, values] : Axes(options.vary)) {
    extend(values,
           [&, &name = key](Point& point, const std::string& value) { point.settings.emplace_back(name, value); });
  }
  extend(options.seeds, [](Point& point, int64_t seed) { point.seed = seed; });
  return points;
}

Options OptionsOf(const SweepOptions& sweep, const Point& point) {
  Options options = sweep.run;
  if (!point.data.empty()) options.data = point.data;
  for (const auto& [key, value] : point.settings) options.assignments.push_back(key + "=" + value);
  options.seed = point.seed;
  return options;
}

/// A path as another folder's process needs it; a task's name stays.
std::string Placed(const std::string& path) {
  return fs::exists(path) ? fs::absolute(path).lexically_normal().string() : path;
}

std::vector<std::string> WordsOf(const std::string& command, const Options& options) {
  std::vector<std::string> words = {command};
  const auto add = [&](const char* flag, const std::vector<std::string>& values) {
    for (const std::string& value : values) words.insert(words.end(), {flag, value});
  };
  if (!options.config.empty()) words.push_back(Placed(options.config));
  if (!options.task.empty()) add("--task", {Placed(options.task)});
  if (!options.data.empty()) add("--data", {Placed(options.data)});
  if (options.seed >= 0) add("--seed", {std::to_string(options.seed)});
  if (!options.parameter_file.empty()) add("--params", {Placed(options.parameter_file)});
  add("--preset", options.presets);
  add("--param", options.parameters);
  add("--truth", options.truth);
  add("--set", options.assignments);
  return words;
}

/// Hashes each file once, and loads each model once.
class Hashes {
 public:
  const PlanInput& Of(const std::string& path) {
    const auto found = known_.find(path);
    return found != known_.end() ? found->second : known_.emplace(path, PlanInput::Of(path)).first->second;
  }
  const std::vector<std::string>& FilesOf(const ModelTask& task) {
    const auto found = files_of_.find(task.model);
    return found != files_of_.end() ? found->second : files_of_.emplace(task.model, ModelFiles(task)).first->second;
  }

 private:
  std::map<std::string, PlanInput> known_;
  std::map<std::string, std::vector<std::string>> files_of_;
};

PlanLine LineOf(const SweepOptions& sweep, const Point& point, Hashes& hashes) {
  const Options options = OptionsOf(sweep, point);
  const RunConfig config = ResolveConfig(options);
  config.data.CheckNamed();
  PlanLine line;
  std::string data;
  for (const std::string& file : config.data.AllFiles()) {
    line.inputs.push_back(hashes.Of(file));
    data += (data.empty() ? "" : " ") + line.inputs.back().sha256;
  }
  std::vector<std::string> files = {options.config, options.task, config.parameter_file};
  if (config.task.has_model()) std::ranges::copy(hashes.FilesOf(config.task.model), std::back_inserter(files));
  for (const std::string& file : files) {
    if (!file.empty() && fs::exists(file)) line.inputs.push_back(hashes.Of(file));
  }
  nlohmann::json identity = SweepIdentity(config, sweep.command, data);
  if (const std::string prior = config.design.Assumed().prior; fs::exists(prior)) {
    line.inputs.push_back(hashes.Of(prior));
    identity["prior"] = line.inputs.back().sha256;
  }
  line.key = UnitKey(identity);
  line.words = WordsOf(sweep.command, options);
  if (sweep.data.size() > 1) line.labels.emplace_back("data", point.data);
  line.labels.insert(line.labels.end(), point.settings.begin(), point.settings.end());
  line.labels.emplace_back("seed", std::to_string(config.run.seed));
  std::vector<std::string> parts;
  for (const auto& [label, value] : line.labels) parts.push_back(label + "=" + value);
  line.name = fmt::format("{}", fmt::join(parts, " "));
  line.needs = sweep.target.needs;
  return line;
}

void AddSweepOptions(CLI::App& verb, SweepOptions& options) {
  Options& run = options.run;
  verb.add_option("CONFIG,--config", run.config, "configuration file (TOML) that the runs share");
  verb.add_option("--command", options.command, "what each run does: design, or run (all stages)")
      ->check(CLI::IsMember({"design", "run"}))
      ->capture_default_str();
  verb.add_option("--vary", options.vary,
                  "section.key=value; values of one key are runs of their own, keys make a grid; repeatable")
      ->type_name(value_kind::kSetting);
  verb.add_option("--data", options.data, "logged trajectories; each file is a run of its own");
  verb.add_option("--seed", options.seeds, "seeds; each is a run of its own")->check(NonNegativeNumber());
  verb.add_option("--task", run.task, kTaskHelp)->type_name(value_kind::kTask);
  AddParameterOptions(verb, run);
  verb.add_option("--truth", run.truth, "name=value, if the truth is known; repeatable")->allow_extra_args(false);
  verb.add_option("--set", run.assignments, "section.key=value, any setting, in every run; repeatable")
      ->type_name(value_kind::kSetting)
      ->allow_extra_args(false);
}

}  // namespace

void AddSweepVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "sweep", "plan runs that differ in settings, data and seeds; with --engine run them, and print one table");
  auto options = std::make_shared<SweepOptions>();
  AddSweepOptions(*verb, *options);
  AddPlanTarget(*verb, options->target);
  AddSubmitOptions(*verb, options->submit, false);
  verb->callback([&program, options] {
    Plan plan;
    plan.kind = PlanKind::kSweep;
    Hashes hashes;
    for (const Point& point : Points(*options)) plan.lines.push_back(LineOf(*options, point, hashes));
    WritePlan(plan, options->target);
    if (!options->submit.engine) return;
    PlanPlace place{options->target.file, {}};
    place.Resolve();
    program.exit_code = SubmitPlan(place, options->submit);
  });
}

}  // namespace oted::cli
