#include "oted/run/export.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/config/run_config.h"
#include "oted/run/design_record.h"
#include "oted/run/finished_design.h"
#include "oted/run/provenance.h"
#include "oted/run/run_directory.h"
#include "oted/sim/channel_path.h"
#include "oted/sim/mujoco/export_mjcf.h"
#include "oted/sim/mujoco/joint_friction.h"
#include "oted/sim/mujoco/joint_residual.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/mujoco/task.h"
#include "oted/sim/sysid_file.h"

namespace oted {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

using Member = DesignRecord::Member;

constexpr const char* kExportFolder = "export";
constexpr const char* kExports = "export.json";

struct Members {
  std::vector<Member> chosen;
  bool all = false;  ///< each gets a file with its seed's number
};

Members SelectMembers(const FinishedDesign& design, const std::string& which) {
  if (which == "best") return {{design.record.mixture[design.best]}};
  if (which == "all") return {design.record.mixture, true};
  int seed = 0;
  const char* end = which.data() + which.size();
  const auto [rest, error] = std::from_chars(which.data(), end, seed);
  const auto found = std::ranges::find_if(design.record.mixture, [&](const Member& m) { return m.seed == seed; });
  if (error != std::errc{} || rest != end || found == design.record.mixture.end()) {
    std::vector<int> seeds;
    for (const Member& m : design.record.mixture) seeds.push_back(m.seed);
    throw UsageError(fmt::format("member '{}' is none of the design's: wanted best, all, or a seed, {}", which,
                                 fmt::join(seeds, ", ")));
  }
  return {{*found}};
}

// "friction = 0.549 +- 0.047 x nominal ..." for each parameter, with z as in `mode`.
std::string ParameterLines(const DesignRecord& record, const std::vector<double>& mode) {
  std::string text;
  for (size_t i = 0; i < record.parameters.size(); ++i) {
    const DesignRecord::Parameter& p = record.parameters[i];
    text += fmt::format("  {} = {:.6g} +- {:.2g} [{}], 90 % interval [{:.4g}, {:.4g}], nominal {:.6g}, {}: {}\n",
                        p.name, mode[i], p.std, p.unit, p.interval90_low, p.interval90_high, p.nominal, p.field,
                        ToString(p.verdict));
  }
  return text;
}

// What made a file: of this run, and of no place or time.
std::string Origin(const FinishedDesign& design, const Member& member) {
  const DesignRecord& record = design.record;
  return fmt::format(
      "Made by oted {} with MuJoCo {} for {}: design {}, run.seed {}, setting {}, design seed {} of {}.\n"
      "Logs: {} (sha256 {}).\nVerdict: {}.\nParameters (z +- spread of q over all seeds):\n{}",
      record.oted_version, record.mujoco_version, record.task, record.fingerprint.empty() ? "?" : record.fingerprint,
      design.config.run.seed, record.selected, member.seed, record.mixture.size(),
      fs::path(record.dataset.path).filename().string(), record.dataset.sha256.substr(0, 16), ToString(record.verdict),
      ParameterLines(record, member.mode));
}

constexpr const char* kNotInThisFile = "Not in this file, as they are no fields of the model: ";
constexpr const char* kActionDelay = "action/delay";  // MuJoCo's actuators have a delay, too

// Whether a parameter is one of the model; others act on what the agent sees and does.
bool IsFieldOfModel(const std::string& field) { return !field.starts_with("env/") && !IsChannelPath(field); }

bool IsInModel(const ParameterSpec& spec) { return IsFieldOfModel(spec.field); }

std::string NotInTheModel(const FinishedDesign& design, bool delay_is_in) {
  std::string names;
  for (const ParameterSpec& spec : design.config.parameters) {
    const bool of_model = IsFieldOfModel(spec.field) && !IsFrictionPath(spec.field) && !IsResidualPath(spec.field);
    if (of_model || (delay_is_in && spec.field == kActionDelay)) continue;
    names += (names.empty() ? "" : ", ") + spec.name;
  }
  return names.empty() ? "" : fmt::format("{}{}.\n", kNotInThisFile, names);
}

/// A file that is there and that the run consists of.
bool IsOfRun(const fs::path& target, const fs::path& run_directory) {
  constexpr std::array<const char*, 8> kNames = {"run.toml",    "versions.json",        "dataset.json",
                                                 "design.json", "evaluation.json",      "policy.onnx",
                                                 "report.json", "policy_selection.json"};
  std::error_code error;
  const fs::path folder = fs::weakly_canonical(run_directory, error);
  const fs::path inside = fs::weakly_canonical(target, error).lexically_relative(folder);
  if (inside.empty() || *inside.begin() == ".." || *inside.begin() == kExportFolder) return false;
  return inside.has_parent_path() || std::ranges::find(kNames, inside) != kNames.end();
}

/// Nothing that the design was made from, or that the run consists of, becomes an export.
void CheckTarget(const FinishedDesign& design, const fs::path& target) {
  std::error_code error;
  if (target.empty() || !fs::exists(target, error)) return;
  const auto refuse = [&](const char* what) {
    throw UsageError(fmt::format("'{}' is {}; name another file to write", target.string(), what));
  };
  if (IsOfRun(target, design.folder)) refuse("a file of the run itself");
  for (const std::string& source : {design.config.task.model.model, design.config.data.path}) {
    if (!source.empty() && fs::equivalent(source, target, error)) refuse("what the design was made from");
  }
}

// The task's model with those of the design's parameters that are its fields.
MujocoSimulatorFactory ModelFactory(const RunConfig& config) {
  std::vector<ParameterSpec> in_model;
  std::ranges::copy_if(config.parameters, std::back_inserter(in_model), IsInModel);
  if (!config.task.has_model()) return {config.task.name, in_model};
  // Where episodes begin is no part of the model.
  ModelTask task = config.task.model;
  task.start = "default";
  return {task, in_model};
}

std::vector<double> ModelPart(const RunConfig& config, const std::vector<double>& z) {
  std::vector<double> in_model;
  for (size_t i = 0; i < z.size(); ++i) {
    if (IsInModel(config.parameters[i])) in_model.push_back(z[i]);
  }
  return in_model;
}

// [s], as the design has it
double ActionDelay(const RunConfig& config, const std::vector<double>& z, double period_s) {
  double delay = 0;
  for (size_t i = 0; i < z.size(); ++i) {
    if (config.parameters[i].field == kActionDelay) delay += z[i] * period_s;
  }
  return delay;
}

/// A grid world, a task that a program registered: no other tool could load them.
bool HasMjcf(const TaskConfig& task) {
  const std::vector<std::string> built_in = TaskNames();
  return task.has_model() || std::ranges::find(built_in, task.name) != built_in.end();
}

std::vector<ExportedFile> ExportModels(const FinishedDesign& design, const ExportRequest& request) {
  const Members members = SelectMembers(design, request.member);
  if (!HasMjcf(design.config.task)) {
    throw UsageError(
        fmt::format("task '{}' is no MuJoCo model and has no MJCF; write its q(z) with --q", design.config.task.name));
  }
  const MujocoSimulatorFactory factory = ModelFactory(design.config);
  CheckSameModel(design, factory.model_path(), factory.model_sha256());
  // MuJoCo fills the past of a late actuator with the command 0, at which motors rest; a servo would run to its zero.
  const bool delay_is_in = HasMotorsAlone(factory.model());
  const std::string remarks =
      NotInTheModel(design, delay_is_in) + "Load it with mujoco.MjModel.from_xml_path or MuJoCo's viewer.";
  std::vector<ExportedFile> written;
  for (const Member& member : members.chosen) {
    fs::path path = request.mjcf;
    if (members.all) {
      path.replace_filename(fmt::format("{}-{}{}", path.stem().string(), member.seed, path.extension().string()));
    }
    const double delay = delay_is_in ? ActionDelay(design.config, member.mode, factory.spec().control_period_s) : 0;
    WriteFileAtomically(
        path, DesignedMjcf(factory, ModelPart(design.config, member.mode), Origin(design, member) + remarks, delay));
    written.push_back({fmt::format("designed model, seed {}", member.seed), path});
  }
  return written;
}

// The selected setting's q of every seed, each with the same weight: what stage 4 draws from.
json MixtureJson(const FinishedDesign& design) {
  json mixture = {{"schema", "oted.q/1"}, {"kind", "mixture"}, {"best_seed", design.record.mixture[design.best].seed}};
  const std::string& setting = design.record.selected;
  const RunDirectory directory = RunDirectory::At(design.folder);
  for (const Member& member : design.record.mixture) {
    const fs::path path = directory.design_seed(setting, member.seed) / "q.json";
    json q = ReadSealed(path, true);
    if (q.value("schema", "") != "oted.q/1" || q.value("mode", std::vector<double>{}) != member.mode) {
      throw DataError(
          fmt::format("'{}' is not what design.json was made from; make it again with 'oted design'", path.string()));
    }
    for (const char* own : {"fingerprint", "made_from", "files", "seal"}) q.erase(own);
    q["seed"] = member.seed;
    q["weight"] = 1.0 / static_cast<double>(design.record.mixture.size());
    for (const char* shared : {"parameters", "bounds", "scale"}) mixture[shared] = q.at(shared);
    mixture["components"].push_back(std::move(q));
  }
  for (const DesignRecord::Parameter& p : design.record.parameters) {
    mixture["fields"].push_back(p.field);
    mixture["units"].push_back(p.unit);
    mixture["nominal"].push_back(p.nominal);
  }
  mixture["task"] = design.record.task;
  mixture["model_sha256"] = design.record.model_sha256;
  mixture["verdict"] = ToString(design.record.verdict);
  return mixture;
}

std::string Sysid(const FinishedDesign& design) {
  const Member& best = design.record.mixture[design.best];
  std::vector<SysidParameter> parameters;
  for (size_t i = 0; i < design.config.parameters.size(); ++i) {
    const DesignRecord::Parameter& p = design.record.parameters[i];
    SysidParameter parameter{.spec = design.config.parameters[i], .value = best.mode[i]};
    parameter.spec.nominal = p.nominal;
    parameter.spec.unit = p.unit;
    parameters.push_back(parameter);
  }
  return SysidText(parameters,
                   Origin(design, best) +
                       "For mujoco.sysid: ParameterDict.load_from_disk reads this file; what a parameter does "
                       "is then for a modifier to say,\nand 'field' and 'scale' below say it to oted.");
}

// What speaks for the files of the run's own exports.
void SealExports(const FinishedDesign& design, const std::vector<ExportedFile>& written) {
  std::vector<std::string> names;
  for (const ExportedFile& file : written) names.push_back(file.path.filename().string());
  json record = {{"schema", "oted.export/1"},
                 {"made_from", {{"../design.json", SealOf(ReadSealed(design.folder / "design.json", true))}}}};
  const fs::path folder = design.folder / kExportFolder;
  Seal(record, folder, names);
  WriteJson(folder / kExports, record);
}

}  // namespace

void CheckIsWorthExporting(const fs::path& run_directory) {
  const DesignRecord design = DesignRecord::FromJson(ReadSealed(run_directory / "design.json", true), "design.json");
  const bool has_larger_error =
      design.validation &&
      std::ranges::any_of(design.validation->horizons,
                          [](const DesignRecord::Validation::Horizon& h) { return h.narrowed < -0.1; });
  const bool is_off =
      design.verdict == DesignVerdict::kOutsideFamily || (design.verdict == DesignVerdict::kNoGap && has_larger_error);
  if (!is_off || design.predicts_better) return;
  throw DataError(
      fmt::format("the design does not surely predict better than the nominal model; 'oted export {} --mjcf FILE' "
                  "writes it all the same",
                  run_directory.string()));
}

ExportRequest DefaultExports(const fs::path& run_directory) {
  const fs::path folder = run_directory / kExportFolder;
  const fs::path config = run_directory / "run.toml";
  if (fs::exists(config) && !HasMjcf(ReadKeptConfig(run_directory).task)) {
    return {.mjcf = {}, .q = folder / "q.json", .sysid = {}};
  }
  return {.mjcf = folder / "designed.xml", .q = folder / "q.json", .sysid = folder / "parameters.yaml"};
}

std::string NotInFile(const fs::path& mjcf) {
  const std::string text = ReadFile(mjcf);
  const size_t at = text.find(kNotInThisFile);
  if (at == std::string::npos) return "";
  const size_t begin = at + std::string_view(kNotInThisFile).size();
  return text.substr(begin, text.find(".\n", begin) - begin);
}

void RemoveExports(const fs::path& run_directory) {
  for (const char* name : {"designed.xml", "q.json", "parameters.yaml", kExports}) {
    std::error_code ignored;
    fs::remove(run_directory / kExportFolder / name, ignored);
  }
}

std::vector<ExportedFile> Export(const fs::path& run_directory, const ExportRequest& request) {
  const FinishedDesign design = ReadDesign(run_directory);
  for (const fs::path& target : {request.mjcf, request.q, request.sysid}) CheckTarget(design, target);
  std::vector<ExportedFile> written;
  try {
    if (!request.mjcf.empty()) written = ExportModels(design, request);
    if (!request.q.empty()) {
      WriteJson(request.q, MixtureJson(design));
      written.push_back({"q(z), mixture of all seeds", request.q});
    }
    if (!request.sysid.empty()) {
      WriteFileAtomically(request.sysid, Sysid(design));
      written.push_back({"parameters for mujoco.sysid", request.sysid});
    }
  } catch (const json::exception& e) {
    throw DataError(fmt::format("'{}' lacks what a design records ({}); make it again with 'oted design'",
                                (run_directory / "design.json").string(), e.what()));
  }
  if (request.q == run_directory / kExportFolder / "q.json") SealExports(design, written);
  return written;
}

}  // namespace oted
