#include "oted/proposal/task_proposal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/checks/data_check.h"
#include "oted/config/parameters_toml.h"
#include "oted/config/task_file_schema.h"
#include "oted/data/checks_rates.h"
#include "oted/data/dataset_files.h"
#include "oted/proposal/first_log.h"
#include "oted/proposal/log_facts.h"
#include "oted/proposal/task_text.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/mujoco/model_outline.h"

namespace oted {
namespace {

constexpr double kPeriodSlack = 0.01;  // of the reader (docs/file_formats.md)
constexpr double kRangeSlack = 1.1;    // of actions beyond the logged ones
constexpr double kNoPeriod = 100;      // [s]: nothing is controlled as slowly
constexpr uint64_t kSeed = 1;

class Proposer {
 public:
  Proposer(const ProposalRequest& request, const RunContext& context)
      : request_(request), context_(context), task_(proposal_.config.task.model), data_(proposal_.config.data) {}

  Proposal Propose() {
    CheckRequest();
    model_ = OutlineOf(request_.model);
    task_.model = request_.model;
    MapColumnsOfLog();
    Observe();
    Act();
    task_.control_period = ControlPeriod();
    NameLogs();
    Simulate();
    Look();
    ChooseWhatToDoubt();
    Write();
    return std::move(proposal_);
  }

 private:
  void CheckRequest() const {
    if (request_.logs.empty())
      throw UsageError("no logs are named; give one or more .csv, .npz or .hdf5 after the model");
    if (request_.out.extension() != ".toml") {
      throw UsageError(fmt::format("--out is '{}', wanted a file that ends in .toml", request_.out.string()));
    }
    std::error_code error;
    if (!request_.model.starts_with("package:") && !std::filesystem::exists(request_.model, error)) {
      throw DataError(fmt::format("model '{}' does not exist; check the path", request_.model));
    }
    if (std::filesystem::exists(request_.out, error)) {
      throw UsageError(
          fmt::format("'{}' is there already; remove it, or name another file with --out", request_.out.string()));
    }
  }

  void MapColumnsOfLog() {
    log_.emplace(request_.logs.front());
    ColumnMap& map = proposal_.columns;
    map = log_->Map(model_, request_.model);
    const auto by_order = [](const ColumnMap::Entry& entry) { return entry.by_order; };
    if (std::ranges::any_of(map.observations, by_order) || std::ranges::any_of(map.actions, by_order)) {
      proposal_.guessed.emplace_back("numbered columns are in the model's order");
    }
    for (const ColumnMap::Entry& entry : map.observations) {
      if (!entry.in_degrees) continue;
      proposal_.suspicious.push_back(
          fmt::format("column '{}' is in degrees by its name; multiply it by 0.0174533 in the log", entry.column));
    }
  }

  // ------------------------------------------------------------ [task]

  static std::vector<std::string> Paths(const std::vector<ColumnMap::Entry>& entries) {
    std::vector<std::string> paths;
    for (const ColumnMap::Entry& entry : entries) paths.push_back(entry.path);
    return paths;
  }

  void Observe() {
    const std::vector<std::string> paths = Paths(proposal_.columns.observations);
    std::vector<std::string> all = model_.qpos;
    if (paths == all) {
      task_.observations = {"joint/*/qpos"};
      return;
    }
    all.insert(all.end(), model_.qvel.begin(), model_.qvel.end());
    if (paths != all) task_.observations = paths;
  }

  void Act() {
    task_.motors = proposal_.columns.motors;
    std::vector<std::string> paths;
    bool lacks_range = std::ranges::any_of(model_.joints, [&](const ModelOutline::Joint& joint) {
      return !joint.force_limited && std::ranges::find(task_.motors, "joint/" + joint.name) != task_.motors.end();
    });
    for (const ColumnMap::Entry& entry : proposal_.columns.actions) {
      const std::string path = entry.path.substr(0, entry.path.find('['));
      if (paths.empty() || paths.back() != path) paths.push_back(path);
    }
    std::vector<std::string> unlogged;
    for (const ModelOutline::Actuator& actuator : model_.actuators) {
      const bool logged = std::ranges::find(paths, "actuator/" + actuator.name) != paths.end();
      if (!logged) unlogged.push_back(actuator.name);
      lacks_range = lacks_range || (logged && !actuator.has_range);
    }
    if (!unlogged.empty() || (task_.motors.empty() && !InModelOrder(paths))) task_.actions = paths;
    if (!unlogged.empty()) {
      proposal_.guessed.push_back(
          fmt::format("the control of {} is 0 throughout: no column is its command", Some(unlogged)));
    }
    if (lacks_range) HoldActionsUpTo(log_->LargestAction(proposal_.columns));
  }

  /// Actions of this size lie in the task's range.
  void HoldActionsUpTo(double largest) {
    const double most = RoundedUp(std::max(1e-6, kRangeSlack * largest));
    if (task_.action_range.empty() || most > task_.action_range.back()) task_.action_range = {-most, most};
  }

  bool InModelOrder(const std::vector<std::string>& paths) const {
    for (size_t i = 0; i < paths.size(); ++i) {
      if (paths[i] != "actuator/" + model_.actuators[i].name) return false;
    }
    return true;
  }

  /// The rows' own, as a multiple of the model's time step. [s]
  double ControlPeriod() {
    const double rows = request_.control_period > 0 ? request_.control_period : RowPeriod();
    const double step = model_.time_step;
    if (!std::isfinite(rows / step)) return rows;  // refused, with the model
    double n = std::max(1.0, std::round(rows / step));
    if (std::abs(n * step - rows) <= kPeriodSlack * rows) return n * step;
    n = std::max(1.0, std::ceil(rows / step - kPeriodSlack));
    proposal_.guessed.push_back(fmt::format(
        "rows lie {:.6g} s apart, which is no multiple of the model's time step {:.6g} s: they are resampled "
        "to {:.6g} s; a time step that divides the rows' is better",
        rows, step, n * step));
    return n * step;
  }

  double RowPeriod() {
    if (log_->arrays()) return ArrayPeriod(*log_->arrays());
    return log_->RowPeriod(proposal_.columns);
  }

  double ArrayPeriod(const Dataset& arrays) {
    if (arrays.period_s > 0) return arrays.period_s;
    // Where velocities are there, positions tell the time.
    ModelTask task = task_;
    task.control_period = model_.time_step;
    TaskConfig config;
    config.model = task;
    config.Resolve();
    const double rows = PeriodByRates(CompareRates(arrays, SpecOf(config).rate_of, 0));
    if (rows <= 0) log_->FailPeriod();
    const double n = std::max(1.0, std::round(rows / model_.time_step));
    proposal_.guessed.push_back(
        fmt::format("rows lie {:.6g} s apart, as positions and velocities say ({:.4g} s)", n * model_.time_step, rows));
    return n * model_.time_step;
  }

  // ------------------------------------------------------------ [data]

  void NameLogs() {
    data_.path = log_->path();
    if (log_->is_csv()) {
      const auto names = [](const std::vector<ColumnMap::Entry>& entries) {
        std::vector<std::string> columns;
        for (const ColumnMap::Entry& entry : entries) columns.push_back(entry.column);
        return columns;
      };
      data_.columns.observations = names(proposal_.columns.observations);
      data_.columns.actions = names(proposal_.columns.actions);
      data_.columns.episode = proposal_.columns.episode;
      data_.columns.time = proposal_.columns.time;
    }
    if (request_.logs.size() == 1) return;
    data_.path.clear();
    for (const std::string& path : request_.logs) data_.recordings.push_back({path, {}});
    CompareLogs();
  }

  /// What the first log told must hold for the others.
  void CompareLogs() {
    DataOptions options = data_.Options();
    if (request_.control_period > 0) options.control_period_s = task_.control_period;
    double largest = 0;
    std::optional<double> period;
    std::vector<std::string> unused;  // what the first log's reader says, of columns among others
    for (const std::string& path : request_.logs) {
      if (IsCsv(path) != log_->is_csv()) {
        throw UsageError(fmt::format("'{}' and '{}' are of different formats; convert one ('oted data convert')",
                                     log_->path(), path));
      }
      const Dataset one = ReadDataset(path, options);
      if (one.period_s == 0) {
        proposal_.guessed.push_back(
            fmt::format("'{}' has no times: its rows count as {:.6g} s apart", path, task_.control_period));
      } else if (period && PeriodsDiffer(one.period_s, *period)) {
        const double longer = std::max(one.period_s, *period);
        throw DataError(fmt::format(
            "rows of '{}' lie {:.3g} s apart, and those of '{}' {:.3g} s: no control period is that of both; "
            "{}give --period {:.3g} to read all at that, or make a task file for each",
            path, one.period_s, log_->path(), *period,
            longer >= kNoPeriod ? "if times are no seconds, call their column t_ms, t_us or t_ns; or " : "", longer));
      }
      if (one.period_s > 0) period = one.period_s;
      if (unused.empty() && path == log_->path()) unused = one.remarks;
      Tell(path, one);
      for (const std::string& remark : one.remarks) {
        const bool is_new = remark.starts_with("columns not used") && std::ranges::find(unused, remark) == unused.end();
        if (is_new) proposal_.guessed.push_back(fmt::format("'{}': {}", path, remark));
      }
      for (const double action : one.actions.values()) largest = std::max(largest, std::abs(action));
    }
    if (!task_.action_range.empty()) HoldActionsUpTo(largest);  // of the first log alone until now
  }

  /// What the reader changed.
  void Tell(const std::string& path, const Dataset& read) {
    for (const std::string& remark : read.remarks) {
      const bool is_usual = remark.starts_with("the last row of") || remark.starts_with("columns not used");
      if (!is_usual) proposal_.guessed.push_back(fmt::format("'{}': {}", path, remark));
    }
    for (const std::string& warning : read.warnings) {
      proposal_.suspicious.push_back(fmt::format("'{}': {}", path, warning));
    }
  }

  static bool PeriodsDiffer(double a, double b) { return std::abs(a - b) > kPeriodSlack * std::max(a, b); }

  // ------------------------------------------------------------ trying it

  void Simulate() {
    TaskConfig& config = proposal_.config.task;
    config.Resolve();
    Unobserve();
    dataset_ = ReadEpisodes(data_, SpecOf(config));
    UnwrapAngles(SpecOf(config));
    if (data_.recordings.empty()) Tell(data_.path, dataset_);
    if (log_->is_csv()) {
      int longest = 1;
      for (const Episode& episode : dataset_.Episodes()) longest = std::max(longest, episode.size());
      task_.max_episode_steps = longest;
    }
    if (SpecOf(config).can_replay()) {
      task_.start = "logs";
    } else if (!model_.keyframes.empty()) {
      task_.start = "keyframe/" + model_.keyframes.front();
      proposal_.guessed.push_back(fmt::format("episodes begin at {}", task_.start));
    }
    factory_ = MakeSimulatorFactory(config, {}, dataset_.EpisodeStarts());
  }

  void UnwrapAngles(const SimulatorSpec& spec) {
    std::vector<Finding> wrapped;
    if (dataset_.qpos.empty()) CheckWraps(dataset_, FactsOf(spec), wrapped);
    for (const Finding& finding : wrapped) {
      data_.unwrap.push_back(finding.channels.front());
      proposal_.guessed.push_back(fmt::format("{}, which data.unwrap takes out", finding.what));
    }
    if (!wrapped.empty()) dataset_ = ReadEpisodes(data_, spec);
  }

  /// Lists what no column shows as unobserved, where the model allows that.
  void Unobserve() {
    const std::vector<std::string> seen = Paths(proposal_.columns.observations);
    std::vector<std::string> hidden;
    for (const std::string& path : model_.qpos) {
      if (std::ranges::find(seen, path) == seen.end()) hidden.push_back(path);
    }
    const bool has_velocities = std::ranges::find(seen, model_.qvel.front()) != seen.end();
    for (const std::string& path : model_.qvel) {
      const bool alone = has_velocities || std::ranges::find(hidden, PositionOf(path)) != hidden.end();
      if (alone && std::ranges::find(seen, path) == seen.end()) hidden.push_back(path);
    }
    // Not activations: those of filters follow the commands, and the fit finds the others.
    if (hidden.empty()) return;
    task_.unobserved = hidden;
    try {
      SpecOf(proposal_.config.task);
    } catch (const UsageError&) {
      task_.unobserved.clear();
      const SimulatorSpec spec = SpecOf(proposal_.config.task);
      if (spec.can_replay()) return;
      proposal_.suspicious.push_back(
          fmt::format("the logs do not show {}, and the rest depends on some of it: states cannot be set, and the "
                      "design falls back to the method paper, which is weaker; log it (of a floating base all but "
                      "where on the floor it stands), or take it out of the model",
                      Some(hidden)));
    }
  }

  static std::string PositionOf(std::string velocity_path) {
    const size_t at = velocity_path.rfind("/qvel");
    return velocity_path.replace(at, 5, "/qpos");
  }

  void Look() {
    context_.log->Progress("check", "", 0, 1, "whether something is wrong with the logs");
    for (const Finding& finding : CheckDataset(dataset_, FactsOf(factory_->spec()))) {
      if (finding.severity == Severity::kNote || finding.concern != Concern::kEveryMethod) continue;
      proposal_.suspicious.push_back(fmt::format("{}: {}; {}", finding.check, finding.what, finding.remedy));
    }
    for (std::string& fact : SuspiciousFacts(*factory_, dataset_, model_, context_)) {
      proposal_.suspicious.push_back(std::move(fact));
    }
    context_.log->Progress("check", "", 1, 1, "");
  }

  void ChooseWhatToDoubt() {
    // What parameters do is seen from states in motion, so velocities that the logs lack are made.
    TaskConfig config = proposal_.config.task;
    Dataset logs = dataset_;
    const SimulatorSpec& spec = factory_->spec();
    if (!spec.can_set_state && spec.can_replay()) {
      TaskConfig full = config;
      for (const HiddenCoordinate& hidden : spec.hidden) full.model.observations.push_back(hidden.name);
      const SimulatorSpec its = SpecOf(full);
      std::optional<Dataset> made =
          WithVelocities(dataset_, spec.observation_names, its.observation_names, spec.control_period_s);
      if (made && its.can_set_state) {
        config = std::move(full);
        logs = *std::move(made);
      }
    }
    const auto make = [&](const std::vector<ParameterSpec>& specs) {
      return MakeSimulatorFactory(config, specs, logs.EpisodeStarts());
    };
    const RngKey key = RngKey(kSeed).Stage("proposal");
    ParameterChoice choice = ChooseParameters(*make({}), logs, model_, key, context_, make);
    proposal_.config.parameters = std::move(choice.chosen);
    proposal_.left_out = std::move(choice.left_out);
    if (proposal_.config.parameters.empty()) {
      proposal_.suspicious.emplace_back("no parameter moves what the logs show: a design has nothing to find");
    }
  }

  /// What stands in the file is tried once more: it must mean what was tried.
  void Write() {
    if (request_.with_schema) proposal_.text = fmt::format("#:schema ./{}\n", kTaskFileSchemaName);
    proposal_.text += TaskText(proposal_, request_.out);
    const RunConfig written = RunConfig::FromToml(proposal_.text, request_.out.string());
    const Dataset logs = ReadEpisodes(written.data, SpecOf(written.task));
    MakeSimulatorFactory(written.task, written.parameters, logs.EpisodeStarts());
    OTED_CHECK(logs.size() == dataset_.size());
    if (request_.with_schema) {
      WriteFileAtomically(request_.out.parent_path() / kTaskFileSchemaName, TaskFileSchemaText());
    }
    WriteFileAtomically(request_.out, proposal_.text);
  }

  const ProposalRequest& request_;
  const RunContext& context_;
  Proposal proposal_;
  ModelTask& task_;
  DataConfig& data_;
  ModelOutline model_;
  std::optional<FirstLog> log_;
  Dataset dataset_;
  std::unique_ptr<SimulatorFactory> factory_;
};

}  // namespace

bool Proposal::NamesActuated() const {
  return std::ranges::any_of(config.parameters,
                             [](const auto& spec) { return spec.field.find("@actuated") != std::string::npos; });
}

std::vector<std::string> Proposal::NotFreed() const {
  std::vector<std::string> lines;
  for (const ParameterChoice::LeftOut& of : left_out) lines.push_back(of.why);
  return lines;
}

nlohmann::json Proposal::ToJson(const std::filesystem::path& out) const {
  nlohmann::json record = {{"schema", "oted.init/1"},
                           {"task_file", out.string()},
                           {"columns", nlohmann::json::array()},
                           {"parameters", nlohmann::json::object()},
                           {"unused", columns.unused},
                           {"guessed", guessed},
                           {"suspicious", suspicious},
                           {"not_freed", NotFreed()}};
  for (const auto* entries : {&columns.observations, &columns.actions}) {
    for (const ColumnMap::Entry& entry : *entries) {
      record["columns"].push_back({{"column", entry.column}, {"path", entry.path}, {"by_order", entry.by_order}});
    }
  }
  for (const ParameterSpec& spec : config.parameters) record["parameters"][spec.name] = ParameterToJson(spec);
  return record;
}

Proposal ProposeTask(const ProposalRequest& request, const RunContext& context) {
  return Proposer(request, context).Propose();
}

}  // namespace oted
