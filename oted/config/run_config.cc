#include "oted/config/run_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/base/toml.h"
#include "oted/config/former_names.h"
#include "oted/config/parameters_toml.h"
#include "oted/config/toml_reader.h"
#include "oted/config/toml_sections.h"
#include "oted/config/toml_text.h"
#include "oted/config/toml_writer.h"
#include "oted/sim/presets.h"
#include "oted/sim/sysid_file.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/prior_source.h"

namespace oted {

using nlohmann::json;

namespace {

constexpr uint64_t kMostTaskBytes = uint64_t{1} << 22;

toml::table Parsed(const std::string& text, const std::string& file_name) {
  CheckTomlCharacters(text, file_name);
  try {
    return toml::parse(text, file_name);
  } catch (const toml::parse_error& e) {
    const std::string what(e.description());
    const char* remedy = what.find("value type") == std::string::npos ? "" : "; text stands in quotes: name = \"text\"";
    throw UsageError(fmt::format("{}:{}: {}{}", file_name, e.source().begin.line, what, remedy));
  }
}

}  // namespace

FieldList DataConfig::Fields() {
  FieldList fields("data");
  fields.Add("path", &path, "logged trajectories: .hdf5 (D4RL or Minari), a Minari folder, .npz, .csv or .csv.gz");
  fields.Add("episodes", &episodes, kEpisodeChoiceHelp);
  fields.AddChoice("format", &format, "the file's format; auto: by path and content", DataFormatNames());
  fields.Add("observations", &columns.observations, "CSV columns with observations; none: those with the prefix obs");
  fields.Add("actions", &columns.actions, "CSV columns with actions; none: those with the prefix act");
  fields.Add("episode", &columns.episode, "CSV column with the episode's number; empty: by the usual names");
  fields.Add(
      "time", &columns.time,
      "CSV column with the time, in seconds or in the unit that ends its name (t_ms); empty: by the usual names");
  fields.Add("reward", &columns.reward, "CSV column with the reward; empty: by the usual names");
  fields.Add("terminal", &columns.terminal, "CSV column that is 1 where the task ended; empty: by the usual names");
  fields.Add("timeout", &columns.timeout, "CSV column that is 1 where the episode was cut; empty: by the usual names");
  fields.Add("action_delay", &action_delay, "control steps from a logged action to its effect", Between(0, 1000));
  fields.Add("scale", &rescaling.scale, "factors of observations and actions, by name or pattern with *: units, signs");
  fields.Add("offset", &rescaling.offset, "what is then added to them: a sensor's zero");
  fields.Add("unwrap", &unwrap, "observations [rad] that the log keeps within one turn: names, or patterns with *");
  fields.AddStructure("recordings");
  return fields;
}

std::vector<std::string> DataConfig::AllFiles() const {
  if (recordings.empty()) return {path};
  std::vector<std::string> files;
  for (const Recording& recording : recordings) files.push_back(recording.path);
  return files;
}

std::string DataConfig::Files() const {
  if (recordings.empty()) return path;
  const std::string& first = recordings.front().path;
  return recordings.size() == 1 ? first : fmt::format("{} and {} more", first, recordings.size() - 1);
}

void DataConfig::Take(const std::string& file) {
  path = file;
  recordings.clear();
}

json DataConfig::RecordingsToJson() const {
  json list = json::array();
  for (const Recording& recording : recordings) {
    list.push_back({{"path", recording.path}});
    if (!recording.constants.empty()) list.back()["constants"] = recording.constants;
  }
  return list;
}

void DataConfig::CheckConstants(const std::vector<std::string>& names) const {
  for (const Recording& recording : recordings) {
    for (const auto& [name, value] : recording.constants) {
      if (!std::isfinite(value)) {
        throw UsageError(
            fmt::format("data.recordings: constant '{}' of '{}' is {}, wanted a finite number; leave it out "
                        "where it is as in the model",
                        name, recording.path, value));
      }
      if (std::ranges::find(names, name) != names.end()) continue;
      throw UsageError(fmt::format(
          "data.recordings: '{}' has constant '{}', which [task.constants] of the task does not name{}; add "
          "{} = {{ field = \"...\" }} there (of a design that is made, to the task file that it was made "
          "from, and design again)",
          recording.path, name, DidYouMean(name, names), name));
    }
  }
}

void DataConfig::CheckNamed() const {
  if (empty()) throw UsageError("no data are named; add --data demos.hdf5, or [data] path to the configuration");
}

EpisodeChoice DataConfig::ChosenEpisodes() const { return {episodes, "data.episodes"}; }

DataOptions DataConfig::Options() const {
  DataOptions options;
  options.format = format;
  options.columns = columns;
  options.action_delay = action_delay;
  options.rescaling = rescaling;
  options.unwrap = unwrap;
  return options;
}

FieldList RunSettings::Fields() {
  FieldList fields("run");
  fields.Add("seed", &seed, "seed of every random stream", AtLeast(0));
  fields.Add("threads", &threads, "maximum number of threads; 0: one for each processor", AtLeast(0));
  fields.Add("strict", &strict, "a parameter without measured effect is an error");
  return fields;
}

FieldList ReportConfig::Fields() {
  FieldList fields("report");
  fields.AddChoice(
      "motion", &motion,
      "films of logged, nominal and designed motion: auto (if OpenGL is there), true (an error without it), or false",
      NamedValues<Motion>{{Motion::kAuto, "auto"}, {Motion::kTrue, "true"}, {Motion::kFalse, "false"}});
  fields.Add("replay_steps", &replay_steps,
             "control steps that a replay of logged actions takes; 0: half a second, and at least 50", AtLeast(0));
  return fields;
}

namespace {

/// Names become keys, folders and names of curves.
void CheckName(const std::string& what, const std::string& name) {
  const auto plain = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-'; };
  if (!name.empty() && std::all_of(name.begin(), name.end(), plain)) return;
  throw UsageError(fmt::format("{} '{}': a name has letters, digits, '_' and '-' only; rename it", what, name));
}

}  // namespace

std::vector<FieldList> PlainSections(RunConfig& config) {
  std::vector<FieldList> sections = {config.task.Fields(),
                                     config.task.grid.Fields(),
                                     config.data.Fields(),
                                     config.run.Fields(),
                                     config.clone.Fields(),
                                     config.selection.Fields(),
                                     config.agents.Fields(),
                                     config.algorithms.sac.Fields(),
                                     config.algorithms.crossq.Fields(),
                                     config.algorithms.ppo.Fields(),
                                     config.baselines.Fields()};
  for (const OfflineEntry& entry : OfflineBaselines()) sections.push_back(entry.fields(config.baselines.offline));
  sections.push_back(config.report.Fields());
  return sections;
}

void RunConfig::Set(const std::string& assignment) {
  const size_t equals = assignment.find('='), dot = assignment.find('.');
  if (equals == std::string::npos || dot == std::string::npos || dot > equals) {
    throw UsageError(
        fmt::format("--set {}: wanted section.key=value, for example --set design.trajectories.window=8", assignment));
  }
  const std::string name = assignment.substr(0, dot), key = assignment.substr(dot + 1, equals - dot - 1);
  const std::string value = assignment.substr(equals + 1), where = "--set " + assignment;
  if (name == "design") {
    if (key == "method" && !settings.empty()) {
      throw UsageError(
          fmt::format("{}: each of design.settings has a method of its own; set method in [design.settings.{}]", where,
                      settings.begin()->first));
    }
    design.SetText(key, value, where);
    // A setting named on the command line holds for every h.
    for (auto& [unused, setting] : settings) setting.SetText(key, value, where);
    return;
  }
  RefuseFormerName(name, key, where);
  std::vector<std::string> names = {"design"};
  for (const FieldList& section : PlainSections(*this)) {
    names.push_back(section.section());
    if (section.section() == name) return section.Find(key, where).FromText(value, where);
  }
  if (name == "parameters") {
    throw UsageError(
        fmt::format("{}: parameters are not set so; give --param NAME=PATH:LOW:HIGH, or change the file", where));
  }
  throw UsageError(fmt::format("{}: [{}] is not a section{}; the sections are {}", where, name, DidYouMean(name, names),
                               fmt::join(names, ", ")));
}

void RunConfig::SetTruth(const std::string& assignment) {
  const size_t equals = assignment.find('=');
  char* end = nullptr;
  const double value = equals == std::string::npos ? 0 : std::strtod(assignment.c_str() + equals + 1, &end);
  if (equals == std::string::npos || equals + 1 == assignment.size() || *end != '\0') {
    throw UsageError(fmt::format("--truth {}: wanted name=value, for example --truth friction=0.6", assignment));
  }
  truth[assignment.substr(0, equals)] = value;
}

void RunConfig::Check() const {
  if (task.name.empty())
    throw UsageError("no task is named; add --task, or [task] with a name or a model to the configuration");
  if (parameters.empty()) {
    throw UsageError(
        fmt::format("no parameter is declared; add --param 'friction=geom/*/friction[0]:0.2:2.0', a [parameters] "
                    "section, or a --preset; 'oted params list' shows what there is{}",
                    task.has_model() ? " (--task takes of a file its [task] alone: for its [parameters] give the file "
                                       "as the configuration, without --task)"
                                     : ""));
  }
  const ParameterSpace space(parameters);
  std::vector<std::string> names;
  for (const ParameterSpec& spec : parameters) {
    CheckName("parameter", spec.name);
    names.push_back(spec.name);
  }
  for (const auto& [name, setting] : settings) CheckName("design setting", name);
  for (const auto& [name, value] : truth) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) {
      throw UsageError(fmt::format("truth.{} names no parameter{}; the parameters are {}", name,
                                   DidYouMean(name, names), fmt::join(names, ", ")));
    }
  }
  if (!truth.empty() && truth.size() != names.size()) {
    throw UsageError(
        fmt::format("the truth names {} of {} parameters; name all of them, or none", truth.size(), names.size()));
  }
  if (!data.path.empty() && !data.recordings.empty()) {
    throw UsageError("both data.path and data.recordings name logs; keep one of them");
  }
  data.CheckConstants(task.ConstantNames());
  for (const ParameterSpec& constant : task.constants) CheckName("constant", constant.name);
  try {
    static_cast<void>(json(data.path).dump());
    static_cast<void>(data.RecordingsToJson().dump());
  } catch (const json::exception&) {
    throw UsageError(
        fmt::format("data.path '{}' is not UTF-8 text, which run.toml cannot hold; rename the file", data.Files()));
  }
  try {
    DataConfig copy = data;
    static_cast<void>(copy.Fields().ToJson().dump());
  } catch (const json::exception&) {
    throw UsageError("a column named in [data] is not UTF-8 text, which run.toml cannot hold; rename it in the file");
  }
  static_cast<void>(data.ChosenEpisodes());
  design.Check();
  for (const auto& [name, setting] : settings) setting.Check();
  baselines.Check();
  const bool used = std::ranges::any_of(DesignSettings(), [](const auto& setting) {
    return PriorSourceOf(setting.second.Assumed().prior) == PriorSource::kBeliefs;
  });
  for (const ParameterSpec& spec : parameters) {
    if (!spec.prior || used) continue;
    throw UsageError(
        fmt::format("parameter '{}' has a prior, but no design uses it; set design.prior to gaussian", spec.name));
  }
}

std::optional<std::string> RunConfig::UnreadSetting() const {
  std::vector<DesignMethod> methods;
  std::vector<std::string> names;
  for (const auto& [unused, choice] : DesignSettings()) {
    std::ranges::copy(choice.Possible(), std::back_inserter(methods));
    names.push_back(NameOf(MethodNames(), choice.method));
  }
  std::set<std::string> unread;
  for (const auto& [unused, choice] : DesignSettings()) {
    for (const std::string& key : choice.UnreadBy(methods)) unread.insert("design." + key);
  }
  if (unread.empty()) return std::nullopt;
  return fmt::format("{} {} set, but no design reads {}: design.method is {}", fmt::join(unread, ", "),
                     unread.size() == 1 ? "is" : "are", unread.size() == 1 ? "it" : "them", fmt::join(names, ", "));
}

std::vector<double> RunConfig::TruthVector() const {
  std::vector<double> values;
  if (truth.empty()) return values;
  for (const ParameterSpec& spec : parameters) values.push_back(truth.at(spec.name));
  return values;
}

int RunConfig::Threads() const { return run.threads > 0 ? run.threads : AvailableThreads(); }

std::map<std::string, DesignChoice> RunConfig::DesignSettings() const {
  if (!settings.empty()) return settings;
  return {{"default", design}};
}

RunConfig RunConfig::FromToml(const std::string& text, const std::string& file_name,
                              const std::string& parameter_file) {
  const toml::table document = Parsed(text, file_name);
  RunConfig config;
  std::vector<FieldList> sections = PlainSections(config);
  std::vector<std::string> names = {"parameters", "truth", "design"};
  for (const FieldList& section : sections) names.push_back(section.section());
  for (const auto& [key, node] : document) {
    const std::string name(key.str());
    const std::string where = TomlPlace(file_name, node);
    if (!node.is_table()) {
      throw UsageError(fmt::format("{}: '{}' stands outside of a section{}; the sections are {}", where, name,
                                   DidYouMean(name, names), fmt::join(names, ", ")));
    }
    const toml::table& table = *node.as_table();
    if (name == "parameters") {
      config.presets = PresetsFromToml(table, file_name);
      config.parameter_file = parameter_file.empty() ? SysidFileOf(table, file_name) : parameter_file;
      config.parameters = ParametersFromToml(table, file_name, config.parameter_file);
    } else if (name == "design") {
      ReadDesign(table, file_name, config.design);
    } else if (name == "truth") {
      for (const auto& [parameter, value] : table) {
        const std::string at = TomlPlace(file_name, value), what(parameter.str());
        config.truth[what] = NumberAt(TomlToJson(value, at), "truth." + what, at);
      }
    } else {
      const auto section = std::ranges::find(sections, name, &FieldList::section);
      if (section == sections.end()) {
        throw UsageError(fmt::format("{}: [{}] is not a section{}; the sections are {}", where, name,
                                     DidYouMean(name, names), fmt::join(names, ", ")));
      }
      ReadSection(table, file_name, *section);
    }
  }
  if (const toml::node* quantities = document["task"]["quantities"].node()) {
    ReadQuantities(*quantities, file_name, config.task.model.quantities);
  }
  if (const toml::node* constants = document["task"]["constants"].node()) {
    config.task.constants = ConstantsFromToml(*constants, file_name);
  }
  if (const toml::node* recordings = document["data"]["recordings"].node()) {
    config.data.recordings = ReadRecordings(*recordings, file_name);
  }
  if (const toml::node* settings = document["design"]["settings"].node()) {
    config.settings = ReadDesignSettings(*settings, config.design, file_name);
  }
  // Without a [parameters] section there is nothing to add to the file.
  if (!parameter_file.empty() && !document.contains("parameters")) {
    config.parameter_file = parameter_file;
    config.parameters = ParametersFromToml({}, file_name, parameter_file);
  }
  config.data.path = BesideFile(config.data.path, file_name);
  std::string& model = config.task.model.model;
  if (!model.starts_with("package:")) model = BesideFile(model, file_name);
  try {
    config.task.Resolve();
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", file_name, e.what()));
  }
  return config;
}

RunConfig RunConfig::FromTomlFile(const std::string& path, const std::string& parameter_file) {
  return FromToml(ReadFile(path, kMostTaskBytes), path, parameter_file);
}

json RunConfig::ToJson() const {
  RunConfig copy = *this;
  json object;
  for (const FieldList& section : PlainSections(copy)) object[section.section()] = section.ToJson();
  object["task"] = task.ToJson();
  if (!data.recordings.empty()) object["data"]["recordings"] = data.RecordingsToJson();
  if (!task.is_grid()) object.erase("grid");
  object["design"] = design.ToJson();
  for (const auto& [name, setting] : settings) object["design"]["settings"][name] = setting.ToJson();
  object["parameters"] = json::object();
  if (!presets.empty()) object["parameters"]["preset"] = presets;
  for (const ParameterSpec& spec : parameters) object["parameters"][spec.name] = ParameterToJson(spec);
  if (!truth.empty()) object["truth"] = truth;
  return object;
}

std::string RunConfig::ToToml() const {
  RunConfig copy = *this;
  std::ostringstream out;
  out << "# The resolved configuration of this run: every setting, defaults included.\n";
  for (const FieldList& section : PlainSections(copy)) {
    if (section.section() == "grid") continue;  // with the task
    if (section.section() == "task") {
      out << "\n" << task.ToToml();
      continue;
    }
    out << "\n[" << section.section() << "]\n";
    WriteFields(out, section.fields(), true);
    if (section.section() == "data" && !data.recordings.empty()) {
      out << "recordings = ";
      WriteTomlValue(out, data.RecordingsToJson());
      out << "\n";
    }
    if (section.section() == "run") {
      out << "\n[parameters]\n";
      if (!presets.empty()) out << "preset = " << json(presets).dump() << "\n";
      for (const ParameterSpec& spec : parameters) {
        out << spec.name << " = ";
        WriteTomlValue(out, ParameterToJson(spec));
        out << "\n";
      }
    }
    if (section.section() == "clone") {
      WriteDesign(out, "design", design, true);
      for (const auto& [name, setting] : settings) WriteDesign(out, "design.settings." + name, setting, false);
    }
  }
  if (!truth.empty()) {
    out << "\n[truth]  # read by the evaluation and the report only\n";
    for (const auto& [name, value] : truth) out << name << " = " << json(value).dump() << "\n";
  }
  return out.str();
}

}  // namespace oted
