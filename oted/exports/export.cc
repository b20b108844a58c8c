#include "oted/exports/export.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/config/run_config.h"
#include "oted/run/design_record.h"
#include "oted/run/finished_design.h"
#include "oted/run/provenance.h"
#include "oted/run/run_directory.h"
#include "oted/run/run_inputs.h"
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

constexpr const char* kMadeBy = "Made by oted ";
constexpr size_t kMarkWithin = 64;  // [bytes] of a file's beginning

// What made a file: of this run, and of no place or time.
std::string Origin(const FinishedDesign& design, const Member& member) {
  const DesignRecord& record = design.record;
  return fmt::format(
      "{}{} with MuJoCo {} for {}: design {}, run.seed {}, setting {}, design seed {} of {}.\n"
      "Logs: {} (sha256 {}).\nVerdict: {}.\nParameters (z +- spread of q over all seeds), if what was "
      "not searched is as in the model:\n{}",
      kMadeBy, record.oted_version, record.mujoco_version, record.task,
      record.fingerprint.empty() ? "?" : record.fingerprint, design.config.run.seed, record.selected, member.seed,
      record.mixture.size(), fs::path(record.dataset.path).filename().string(), record.dataset.sha256.substr(0, 16),
      ToString(record.verdict), ParameterLines(record, member.mode));
}

constexpr double kNearNominal = 0.005;  // of the range

/// Whether a file is there and is the record of a stage, of this run or another.
bool IsSealedRecord(const fs::path& file) {
  if (file.extension() != ".json" || !fs::is_regular_file(file)) return false;
  const json record = json::parse(ReadFile(file), nullptr, false);
  return !record.is_discarded() && !SealOf(record).empty();
}

/// Whether a file is there and is what an export leaves.
bool IsExport(const fs::path& file) {
  constexpr uint64_t kMost = uint64_t{64} << 20;
  std::error_code error;
  if (!fs::is_regular_file(file, error) || fs::file_size(file, error) > kMost) return false;
  const std::string text = ReadFile(file);
  return text.find(kMadeBy) < kMarkWithin || text.find("\"oted.q/") != std::string::npos;
}

/// Only an earlier export is overwritten: not what the design was made from (logs, a model's parts, a task file), nor a
/// file of a run or of anybody.
void CheckTarget(const FinishedDesign& design, const fs::path& target) {
  std::error_code error;
  const auto refuse = [&](const char* what) {
    throw UsageError(fmt::format("'{}' {}; name another file to write", target.string(), what));
  };
  const fs::path inside = fs::weakly_canonical(target, error).lexically_relative(fs::weakly_canonical(design.folder));
  const bool is_in_run = !inside.empty() && *inside.begin() != "..";
  if (is_in_run && *inside.begin() != kExportFolder) refuse("lies among the files of the run, outside of export/");
  if (!fs::exists(target, error) || fs::is_directory(target, error)) return;
  if (!is_in_run && IsSealedRecord(target)) refuse("is the record of a run");
  std::vector<std::string> sources = design.config.data.AllFiles();
  sources.push_back(design.config.task.model.model);
  for (const std::string& source : sources) {
    if (!source.empty() && fs::equivalent(source, target, error)) refuse("is what the design was made from");
  }
  if (!is_in_run && !IsExport(target)) refuse("is there already and is no export of oted");
}

/// "designed-2.xml" where each seed has a file of its own.
fs::path MjcfPath(const fs::path& mjcf, const Member& member, bool all) {
  if (!all) return mjcf;
  fs::path path = mjcf;
  return path.replace_filename(fmt::format("{}-{}{}", mjcf.stem().string(), member.seed, mjcf.extension().string()));
}

/// All that is to be written.
void CheckTargets(const FinishedDesign& design, const ExportRequest& request) {
  std::vector<fs::path> targets;
  if (!request.mjcf.empty()) {
    const Members members = SelectMembers(design, request.member);
    for (const Member& member : members.chosen) targets.push_back(MjcfPath(request.mjcf, member, members.all));
  }
  for (const fs::path& target : {request.q, request.sysid}) {
    if (!target.empty()) targets.push_back(target);
  }
  std::set<fs::path> places;
  for (const fs::path& target : targets) {
    CheckTarget(design, target);
    std::error_code error;
    if (!places.insert(fs::weakly_canonical(target, error)).second) {
      throw UsageError(fmt::format("'{}' is named for two exports; name a file for each", target.string()));
    }
  }
}

/// The simulator whose model is written. Where episodes begin is no part of it: no logs are needed.
std::unique_ptr<SimulatorFactory> FactoryOf(RunConfig config) {
  config.task.Resolve();
  config.task.model.start = "default";
  return MakeSimulatorFactory(config.task, config.parameters);
}

/// A grid world has none, and a task that another program registered cannot be made here.
bool HasMjcf(const RunConfig& config) {
  try {
    return FactoryOf(config)->NotInMjcf().has_value();
  } catch (const UsageError&) {
    return false;
  }
}

/// Whether a parameter is where it makes no difference, in every member.
bool IsAtNominal(const DesignRecord& record, const std::vector<Member>& members, const std::string& name) {
  const auto found = std::ranges::find(record.parameters, name, &DesignRecord::Parameter::name);
  if (found == record.parameters.end()) return false;
  const auto at = static_cast<size_t>(found - record.parameters.begin());
  const double near = kNearNominal * (found->high - found->low);
  return std::ranges::all_of(members,
                             [&](const Member& member) { return std::abs(member.mode[at] - found->nominal) < near; });
}

struct ExportedModels {
  std::vector<ExportedFile> files;
  std::vector<std::string> left_out;  ///< names of the parameters that the files cannot hold
};

ExportedModels ExportModels(const FinishedDesign& design, const ExportRequest& request) {
  const Members members = SelectMembers(design, request.member);
  const auto factory = FactoryOf(design.config);
  CheckSameModel(design, *factory);
  std::string remarks = "Load it with mujoco.MjModel.from_xml_path or MuJoCo's viewer.";
  ExportedModels models{{}, factory->NotInMjcf().value_or(std::vector<std::string>{})};
  std::erase_if(models.left_out,
                [&](const std::string& name) { return IsAtNominal(design.record, members.chosen, name); });
  if (!models.left_out.empty()) {
    remarks = fmt::format("Not in this file, as they are no fields of the model: {}.\n{}",
                          fmt::join(models.left_out, ", "), remarks);
  }
  for (const Member& member : members.chosen) {
    const fs::path path = MjcfPath(request.mjcf, member, members.all);
    WriteFileAtomically(path, factory->Mjcf(member.mode, Origin(design, member) + remarks));
    models.files.push_back({fmt::format("designed model, seed {}", member.seed), path});
  }
  return models;
}

/// What a designed model's file lacks, and what that means for its user.
std::string WhatItLacks(const DesignRecord& design, const std::vector<std::string>& left_out) {
  bool are_sensors = true, may_be_none = true;
  for (const DesignRecord::Parameter& p : design.parameters) {
    if (std::ranges::find(left_out, p.name) == left_out.end()) continue;
    are_sensors = are_sensors && p.field.starts_with("obs/");
    may_be_none = may_be_none && p.interval90_low <= p.nominal && p.nominal <= p.interval90_high;
  }
  const char* meaning =
      may_be_none ? "but its interval holds the nominal value, which the file has"
      : are_sensors
          ? "the file moves as the robot does; shift or delay what it shows by these to get the sensors' readings"
          : "alone the file predicts worse";
  return fmt::format("without {}, which this file cannot hold. The errors above are with it; {}",
                     fmt::join(left_out, ", "), meaning);
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
/// @param lacks  of the designed model's file: WhatItLacks; empty where it lacks nothing
void SealExports(const FinishedDesign& design, const std::vector<ExportedFile>& written, const std::string& lacks) {
  std::vector<std::string> names;
  for (const ExportedFile& file : written) names.push_back(file.path.filename().string());
  json record = {{"schema", "oted.export/1"},
                 {"made_from", {{"../design.json", SealOf(ReadSealed(design.folder / "design.json", true))}}}};
  if (!lacks.empty()) record["lacks"] = lacks;
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
  const bool is_off = IsNegative(design.verdict) || (design.verdict == DesignVerdict::kNoGap && has_larger_error);
  if (!is_off || design.predicts_better) return;
  throw DataError(
      fmt::format("the design does not surely predict better than the nominal model; 'oted export {} --mjcf FILE' "
                  "writes it all the same",
                  run_directory.string()));
}

ExportRequest DefaultExports(const fs::path& run_directory) {
  const fs::path folder = run_directory / kExportFolder;
  const fs::path config = run_directory / "run.toml";
  if (fs::exists(config) && !HasMjcf(ReadKeptConfig(run_directory))) {
    return {.mjcf = {}, .q = folder / "q.json", .sysid = {}};
  }
  return {.mjcf = folder / "designed.xml", .q = folder / "q.json", .sysid = folder / "parameters.yaml"};
}

std::string WhatExportedModelLacks(const fs::path& run_directory) {
  const fs::path record = run_directory / kExportFolder / kExports;
  return fs::exists(record) ? ReadSealed(record, true).value("lacks", "") : "";
}

void RemoveExports(const fs::path& run_directory) {
  for (const char* name : {"designed.xml", "q.json", "parameters.yaml", kExports}) {
    std::error_code ignored;
    fs::remove(run_directory / kExportFolder / name, ignored);
  }
}

std::vector<ExportedFile> Export(const fs::path& run_directory, const ExportRequest& request) {
  const FinishedDesign design = ReadDesign(run_directory);
  CheckTargets(design, request);
  std::vector<ExportedFile> written;
  std::string lacks;
  try {
    if (!request.mjcf.empty()) {
      ExportedModels models = ExportModels(design, request);
      written = std::move(models.files);
      if (!models.left_out.empty()) lacks = WhatItLacks(design.record, models.left_out);
    }
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
  if (request.q == run_directory / kExportFolder / "q.json") SealExports(design, written, lacks);
  return written;
}

}  // namespace oted
