#include "oted/run_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/base/toml.h"
#include "oted/sim/presets.h"
#include "oted/sim/sysid_file.h"
#include "oted/toml_text.h"
#include "oted/toml_writer.h"

namespace oted {

using nlohmann::json;

FieldList DataConfig::Fields() {
  FieldList fields("data");
  fields.Add("path", &path, "logged trajectories: .hdf5 (D4RL or Minari), a Minari folder, .npz, .csv or .csv.gz");
  fields.Add("episodes", &episodes, "how many of them to use, from the first: a number, or all");
  fields.AddChoice("format", &format, "the file's format; auto goes by its path and content",
                   {"auto", "d4rl", "minari", "npz", "csv"});
  fields.Add("observations", &columns.observations, "columns of a CSV that are observations; none: by prefix, obs");
  fields.Add("actions", &columns.actions, "columns of a CSV that are actions; none: by prefix, act");
  fields.Add("episode", &columns.episode, "column of a CSV with the episode's number; empty: by its usual names");
  fields.Add("time", &columns.time, "column of a CSV with the time [s]; empty: by its usual names");
  fields.Add("reward", &columns.reward, "column of a CSV with the reward; empty: by its usual names");
  fields.Add("terminal", &columns.terminal, "column of a CSV, 1 where the task ended; empty: by its usual names");
  fields.Add("timeout", &columns.timeout, "column of a CSV, 1 where the episode was cut; empty: by its usual names");
  fields.Add("action_delay", &action_delay, "control steps from a logged action to its effect", Between(0, 1000));
  return fields;
}

DataOptions DataConfig::Options() const {
  DataOptions options;
  options.format = format;
  options.columns = columns;
  options.action_delay = action_delay;
  return options;
}

FieldList RunSettings::Fields() {
  FieldList fields("run");
  fields.Add("seed", &seed, "names every random stream of the run", AtLeast(0));
  fields.Add("threads", &threads, "threads at most; 0 takes every processor", AtLeast(0));
  fields.Add("strict", &strict, "a parameter without measured effect is an error");
  return fields;
}

FieldList AgentsConfig::Fields() {
  FieldList fields("agents");
  fields.AddChoice(
      "algorithm", &algorithm,
      "how agents learn: crossq, or sac as the paper's, for continuous actions, ppo for discrete ones; auto: "
      "crossq or ppo",
      {"auto", "sac", "crossq", "ppo"});
  fields.Add("n_agents", &n_agents, "seeded agents to choose from (m in the paper)", AtLeast(1));
  fields.AddChoice("train_in", &train_in,
                   "where agents train, drawn anew for each episode: a mode of the seeds' q (Algorithm 2), a sample of "
                   "one of them (Sec. 4, step 3), or always the best-scoring seed's mode",
                   {"modes", "samples", "best"});
  fields.Add("undesigned", &undesigned, "with a known truth, also train in the un-designed simulator, to compare");
  fields.Add("undesigned_at", &undesigned_at,
             "what that simulator's parameters are, in the order of [parameters]; none: nominal");
  fields.Add("selection_episodes", &selection_episodes, "episodes per agent and designed simulator", AtLeast(1));
  fields.Add("target_episodes", &target_episodes, "with a known truth, episodes per policy in the target", AtLeast(1));
  return fields;
}

std::string AgentsConfig::AlgorithmFor(const SimulatorSpec& spec) const {
  const bool discrete = spec.n_discrete_actions > 0;
  if (algorithm == "auto") return discrete ? "ppo" : "crossq";
  if ((algorithm == "ppo") != discrete) {
    throw UsageError(
        fmt::format("agents.algorithm is {}, but task '{}' has {} actions, which it does not take; set it "
                    "to {} or auto",
                    algorithm, spec.task, discrete ? "discrete" : "continuous", discrete ? "ppo" : "crossq, sac"));
  }
  return algorithm;
}

void RunConfig::CheckAgentSettings(const SimulatorSpec& spec) const {
  const std::string algorithm = agents.AlgorithmFor(spec);
  const auto check = [&](auto given, auto defaults) {
    FieldList fields = given.Fields();
    if (fields.section() == algorithm) return;
    const json ours = fields.ToJson(), unset = defaults.Fields().ToJson();
    for (const auto& [key, value] : ours.items()) {
      if (value == unset.at(key)) continue;
      throw UsageError(
          fmt::format("{0}.{1} is set, but the agents of task '{2}' learn by {3} (agents.algorithm = {4}); "
                      "set {3}.{1}, or agents.algorithm = {0}",
                      fields.section(), key, spec.task, algorithm, agents.algorithm));
    }
  };
  check(sac, SacConfig());
  check(crossq, CrossQConfig());
  check(ppo, PpoConfig());
}

FieldList ReportConfig::Fields() {
  FieldList fields("report");
  fields.AddChoice("motion", &motion,
                   "pictures of logged, nominal and designed motion: where OpenGL is there, always (an error without), "
                   "or never",
                   {"auto", "true", "false"});
  fields.Add("replay_steps", &replay_steps, "control steps for which logged actions are replayed from a logged state",
             AtLeast(1));
  return fields;
}

namespace {

/// "file:line" of a key, for errors.
std::string Where(const std::string& file, const toml::node& node) {
  return fmt::format("{}:{}", file, node.source().begin.line);
}

json TomlToJson(const toml::node& node, const std::string& where) {
  if (const auto* table = node.as_table()) {
    json object = json::object();
    for (const auto& [key, value] : *table) object[std::string(key.str())] = TomlToJson(value, where);
    return object;
  }
  if (const auto* array = node.as_array()) {
    json values = json::array();
    for (const auto& value : *array) values.push_back(TomlToJson(value, where));
    return values;
  }
  if (const auto value = node.value_exact<std::string>()) return *value;
  if (const auto value = node.value_exact<int64_t>()) return *value;
  if (const auto value = node.value_exact<double>()) return *value;
  if (const auto value = node.value_exact<bool>()) return *value;
  throw UsageError(fmt::format("{}: dates and times are no settings", where));
}

/// [task.quantities]: name = "path".
void ReadQuantities(const toml::node& node, const std::string& file, std::map<std::string, std::string>& quantities) {
  if (!node.is_table()) {
    throw UsageError(fmt::format(
        "{}: task.quantities is no table; write [task.quantities] and NAME = \"PATH\" below it", Where(file, node)));
  }
  for (const auto& [key, value] : *node.as_table()) {
    const auto path = value.value_exact<std::string>();
    if (!path) {
      throw UsageError(fmt::format("{}: task.quantities.{} is not text, wanted a path such as \"body/torso/xpos[2]\"",
                                   Where(file, value), std::string(key.str())));
    }
    quantities[std::string(key.str())] = *path;
  }
}

DesignConfig FormAt(const std::string& form, const std::string& where) {
  try {
    return DesignConfig::ForForm(form);
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", where, e.what()));
  }
}

double Number(const json& value, const std::string& what, const std::string& where) {
  if (!value.is_number()) throw UsageError(fmt::format("{}: {} is {}, wanted a number", where, what, value.dump()));
  return value.get<double>();
}

/// @param needs_range  of an absolute parameter; false where a parameter file gives it
ParameterSpec ParameterFromJson(const std::string& name, const json& table, const std::string& where,
                                bool needs_range) {
  ParameterSpec spec;
  spec.name = name;
  if (!table.is_object() || !table.contains("field") || !table["field"].is_string()) {
    throw UsageError(
        fmt::format("{}: parameters.{} needs a field, for example field = \"geom/*/friction[0]\"", where, name));
  }
  const std::vector<std::string> keys = {"field", "range", "scale", "log", "unit", "prior"};
  for (const auto& [key, value] : table.items()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      throw UsageError(fmt::format("{}: parameters.{}.{} is not a setting{}; a parameter has {}", where, name, key,
                                   DidYouMean(key, keys), fmt::join(keys, ", ")));
    }
  }
  spec.field = table["field"].get<std::string>();
  const std::string prefix = fmt::format("parameters.{}.", name);
  if (table.contains("scale")) {
    if (table["scale"] != "nominal" && table["scale"] != "absolute") {
      throw UsageError(
          fmt::format("{}: {}scale is {}, wanted \"nominal\" (multiples of the nominal value) or \"absolute\"", where,
                      prefix, table["scale"].dump()));
    }
    if (table["scale"] == "absolute") spec.scale = ParameterScale::kAbsolute;
  }
  if (table.contains("range")) {
    const json& range = table["range"];
    if (!range.is_array() || range.size() != 2) {
      throw UsageError(fmt::format("{}: {}range is {}, wanted [low, high]", where, prefix, range.dump()));
    }
    spec.low = Number(range[0], prefix + "range[0]", where);
    spec.high = Number(range[1], prefix + "range[1]", where);
  } else if (spec.scale == ParameterScale::kAbsolute && needs_range) {
    throw UsageError(
        fmt::format("{}: {}range is missing; an absolute parameter needs range = [low, high]", where, prefix));
  }
  if (table.contains("log")) {
    if (!table["log"].is_boolean())
      throw UsageError(fmt::format("{}: {}log is {}, wanted true|false", where, prefix, table["log"].dump()));
    spec.logarithmic = table["log"].get<bool>();
  }
  if (table.contains("unit")) {
    if (!table["unit"].is_string())
      throw UsageError(fmt::format("{}: {}unit is {}, wanted text", where, prefix, table["unit"].dump()));
    spec.unit = table["unit"].get<std::string>();
  }
  if (table.contains("prior")) {
    const json& prior = table["prior"];
    if (!prior.is_object() || prior.size() != 2 || !prior.contains("mean") || !prior.contains("std")) {
      throw UsageError(
          fmt::format("{}: {}prior is {}, wanted {{ mean = 1.0, std = 0.1 }}", where, prefix, prior.dump()));
    }
    spec.prior = ParameterSpec::Belief{Number(prior["mean"], prefix + "prior.mean", where),
                                       Number(prior["std"], prefix + "prior.std", where)};
  }
  try {
    // A range that a parameter file gives is not known yet: the whole is checked again.
    ParameterSpec known = spec;
    if (!table.contains("range") && !needs_range) known.prior.reset();
    known.Check();
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", where, e.what()));
  }
  return spec;
}

/// preset = "arm", or ["arm", "gripper"].
std::vector<std::string> PresetsFromJson(const json& value, const std::string& where) {
  std::vector<std::string> presets;
  for (const json& name : value.is_array() ? value : json::array({value})) {
    if (!name.is_string()) {
      throw UsageError(fmt::format("{}: parameters.preset is {}, wanted a preset's name or a list of names, of {}",
                                   where, value.dump(), fmt::join(PresetNames(), ", ")));
    }
    presets.push_back(name.get<std::string>());
  }
  return presets;
}

/// A path in a configuration is relative to its folder.
std::string BesideFile(const std::string& path, const std::string& file_name) {
  const std::filesystem::path folder = std::filesystem::path(file_name).parent_path();
  return path.empty() || std::filesystem::path(path).is_absolute() ? path : (folder / path).lexically_normal().string();
}

/// The path among what design.prior can be, likewise.
void PlacePrior(DesignConfig& design, const std::string& file_name) {
  if (design.prior != "uniform" && design.prior != "gaussian") design.prior = BesideFile(design.prior, file_name);
}

/// In the order of the file, which is the order of z; those of a mujoco.sysid file come first.
std::vector<ParameterSpec> ParametersFromToml(const toml::table& table, const std::string& file_name,
                                              std::string parameter_file) {
  const toml::node* named = table.get("sysid");
  const bool names_file = named != nullptr && named->is_string();
  if (names_file && (**named->as_string()).empty()) {
    throw UsageError(
        fmt::format("{}: parameters.sysid names no file; name one, or remove the line", Where(file_name, *named)));
  }
  if (names_file && parameter_file.empty()) parameter_file = BesideFile(**named->as_string(), file_name);
  const std::vector<SysidParameter> given =
      parameter_file.empty() ? std::vector<SysidParameter>{} : ReadSysidFile(parameter_file);
  std::vector<std::pair<toml::source_position, std::string>> order;
  for (const auto& [key, node] : table) {
    if ((key.str() == "sysid" && names_file) || (key.str() == "preset" && !node.is_table())) continue;
    order.push_back({node.source().begin, std::string(key.str())});
  }
  std::sort(order.begin(), order.end());
  std::vector<ParameterSpec> declared;
  std::vector<bool> has_range;
  for (const auto& [position, name] : order) {
    const std::string at = Where(file_name, *table.get(name));
    const json entry = TomlToJson(*table.get(name), at);
    const bool in_file = std::ranges::any_of(given, [&](const auto& p) { return p.spec.name == name; });
    declared.push_back(ParameterFromJson(name, entry, at, !in_file));
    has_range.push_back(entry.contains("range"));
  }
  return parameter_file.empty() ? declared : MergeSysid(given, parameter_file, declared, has_range);
}

json ParameterToJson(const ParameterSpec& spec) {
  json table = {{"field", spec.field},
                {"range", {spec.low, spec.high}},
                {"scale", spec.scale == ParameterScale::kAbsolute ? "absolute" : "nominal"},
                {"log", spec.logarithmic},
                {"unit", spec.unit}};
  if (spec.prior) table["prior"] = {{"mean", spec.prior->mean}, {"std", spec.prior->std}};
  return table;
}

/// Names become keys, folders and names of curves.
void CheckName(const std::string& what, const std::string& name) {
  const auto plain = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-'; };
  if (!name.empty() && std::all_of(name.begin(), name.end(), plain)) return;
  throw UsageError(fmt::format("{} '{}': a name has letters, digits, '_' and '-' only; rename it", what, name));
}

}  // namespace

std::vector<FieldList> AllFields(RunConfig& config) {
  return {config.task.Fields(),     config.task.grid.Fields(), config.data.Fields(),      config.run.Fields(),
          config.clone.Fields(),    config.design.Fields(),    config.selection.Fields(), config.agents.Fields(),
          config.sac.Fields("sac"), config.crossq.Fields(),    config.ppo.Fields(),       config.baselines.Fields(),
          config.report.Fields()};
}

RunConfig RunConfig::FromToml(const std::string& text, const std::string& file_name,
                              const std::string& parameter_file) {
  CheckTomlCharacters(text, file_name);
  toml::table document;
  try {
    document = toml::parse(text, file_name);
  } catch (const toml::parse_error& e) {
    throw UsageError(fmt::format("{}:{}: {}", file_name, e.source().begin.line, std::string(e.description())));
  }
  RunConfig config;
  // The form of the design sets other defaults, so it is read before them.
  if (const toml::value<std::string>* form = document["design"]["form"].as_string()) {
    config.design = FormAt(form->get(), Where(file_name, *form));
  }

  std::vector<FieldList> sections = AllFields(config);
  std::vector<std::string> names = {"parameters", "truth"};
  for (const FieldList& section : sections) names.push_back(section.section());
  for (const auto& [key, node] : document) {
    const std::string name(key.str());
    const std::string where = Where(file_name, node);
    if (!node.is_table()) {
      throw UsageError(fmt::format("{}: '{}' stands outside of a section{}; the sections are {}", where, name,
                                   DidYouMean(name, names), fmt::join(names, ", ")));
    }
    const toml::table& table = *node.as_table();
    if (name == "parameters") {
      // The order of the file is the order of z.
      if (const toml::node* preset = table.get("preset"); preset != nullptr && !preset->is_table()) {
        const std::string at = Where(file_name, *preset);
        config.presets = PresetsFromJson(TomlToJson(*preset, at), at);
      }
      config.parameters = ParametersFromToml(table, file_name, parameter_file);
    } else if (name == "truth") {
      for (const auto& [k, n] : table) {
        config.truth[std::string(k.str())] =
            Number(TomlToJson(n, where), "truth." + std::string(k.str()), Where(file_name, n));
      }
    } else {
      const auto section =
          std::find_if(sections.begin(), sections.end(), [&](const FieldList& s) { return s.section() == name; });
      if (section == sections.end()) {
        throw UsageError(fmt::format("{}: [{}] is not a section{}; the sections are {}", where, name,
                                     DidYouMean(name, names), fmt::join(names, ", ")));
      }
      for (const auto& [k, n] : table) {
        const std::string setting(k.str()), at = Where(file_name, n);
        if (name == "design" && setting == "settings") continue;
        if (name == "task" && setting == "quantities") {
          ReadQuantities(n, file_name, config.task.model.quantities);
          continue;
        }
        json value = TomlToJson(n, at);
        // A count or a word: the field is text.
        if (name == "data" && setting == "episodes" && value.is_number_integer()) value = value.dump();
        if (name == "report" && setting == "motion" && value.is_boolean()) value = value.dump();
        section->Find(setting, at).FromJson(value, at);
      }
    }
  }
  PlacePrior(config.design, file_name);
  // The settings h start from [design] and change what they name.
  if (const toml::node* node = document["design"]["settings"].node(); node != nullptr && !node->is_table()) {
    throw UsageError(fmt::format("{}: design.settings is no table; write [design.settings.NAME] for each setting",
                                 Where(file_name, *node)));
  }
  if (const toml::table* settings = document["design"]["settings"].as_table()) {
    for (const auto& [key, node] : *settings) {
      const std::string at = Where(file_name, node);
      const json changes = TomlToJson(node, at);
      DesignConfig setting = config.design;
      if (changes.is_object() && changes.contains("form") && changes["form"].is_string()) {
        setting = FormAt(changes["form"].get<std::string>(), at);
      }
      setting.Fields().FromJson(changes, at);
      if (changes.contains("prior")) PlacePrior(setting, file_name);
      config.settings[std::string(key.str())] = setting;
    }
  }
  // Without a [parameters] section there is nothing to add to the file.
  if (!parameter_file.empty() && !document.contains("parameters")) {
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
  return FromToml(ReadFile(path), path, parameter_file);
}

json RunConfig::ToJson() const {
  RunConfig copy = *this;
  json object;
  for (const FieldList& section : AllFields(copy)) object[section.section()] = section.ToJson();
  object["task"] = task.ToJson();
  if (!task.is_grid()) object.erase("grid");
  for (auto& [name, setting] : copy.settings) object["design"]["settings"][name] = setting.Fields().ToJson();
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
  for (const FieldList& section : AllFields(copy)) {
    if (section.section() == "grid") continue;  // with the task
    if (section.section() == "task") {
      out << "\n" << task.ToToml();
      continue;
    }
    out << "\n[" << section.section() << "]\n";
    for (const Field& field : section.fields()) {
      out << field.name << " = ";
      WriteTomlValue(out, field.ToJson());
      out << "  # " << field.help << "\n";
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
    if (section.section() == "design") {
      for (auto& [name, setting] : copy.settings) {
        out << "\n[design.settings." << name << "]\n";
        const FieldList fields = setting.Fields();
        for (const Field& field : fields.fields()) {
          out << field.name << " = ";
          WriteTomlValue(out, field.ToJson());
          out << "\n";
        }
      }
    }
  }
  if (!truth.empty()) {
    out << "\n[truth]  # read by the evaluation and the report only\n";
    for (const auto& [name, value] : truth) out << name << " = " << json(value).dump() << "\n";
  }
  return out.str();
}

void RunConfig::Set(const std::string& assignment) {
  const size_t equals = assignment.find('='), dot = assignment.find('.');
  if (equals == std::string::npos || dot == std::string::npos || dot > equals) {
    throw UsageError(
        fmt::format("--set {}: wanted section.key=value, for example --set design.n_iterations=50", assignment));
  }
  const std::string name = assignment.substr(0, dot), key = assignment.substr(dot + 1, equals - dot - 1);
  const std::string value = assignment.substr(equals + 1), where = "--set " + assignment;
  if (name == "design" && key == "form") {
    if (!settings.empty()) {
      throw UsageError(fmt::format("{}: each of design.settings has its own form; set form in [design.settings.{}]",
                                   where, settings.begin()->first));
    }
    design = DesignConfig::ForForm(value);
  }
  std::vector<std::string> names;
  for (const FieldList& section : AllFields(*this)) {
    names.push_back(section.section());
    if (section.section() != name) continue;
    section.Find(key, where).FromText(value, where);
    // A setting named on the command line holds for every h.
    if (name == "design") {
      for (auto& [unused, setting] : settings) setting.Fields().Find(key, where).FromText(value, where);
    }
    return;
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
        "no parameter is declared; add --param 'friction=geom/*/friction[0]:0.2:2.0', a [parameters] section, or a "
        "--preset; 'oted params list' shows what there is");
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
  try {
    static_cast<void>(json(data.path).dump());
  } catch (const json::exception&) {
    throw UsageError(
        fmt::format("data.path '{}' is not UTF-8 text, which run.toml cannot hold; rename the file", data.path));
  }
  try {
    DataConfig copy = data;
    static_cast<void>(copy.Fields().ToJson().dump());
  } catch (const json::exception&) {
    throw UsageError("a column named in [data] is not UTF-8 text, which run.toml cannot hold; rename it in the file");
  }
  if (data.episodes != "all") {
    int n = 0;
    const char *begin = data.episodes.data(), *end = begin + data.episodes.size();
    const auto [rest, error] = std::from_chars(begin, end, n);
    if (error != std::errc{} || rest != end || n < 1) {
      throw UsageError(fmt::format("data.episodes is '{}', wanted a number of at least 1, or all", data.episodes));
    }
  }
  design.Check();
  for (const auto& [name, setting] : settings) setting.Check();
  baselines.Check();
  const bool used = settings.empty()
                        ? design.prior == "gaussian"
                        : std::ranges::any_of(settings, [](const auto& s) { return s.second.prior == "gaussian"; });
  for (const ParameterSpec& spec : parameters) {
    if (!spec.prior || used) continue;
    throw UsageError(
        fmt::format("parameter '{}' has a prior, but no design uses it; set design.prior to gaussian", spec.name));
  }
}

std::vector<double> RunConfig::TruthVector() const {
  std::vector<double> values;
  if (truth.empty()) return values;
  for (const ParameterSpec& spec : parameters) values.push_back(truth.at(spec.name));
  return values;
}

int RunConfig::Threads() const { return run.threads > 0 ? run.threads : AvailableThreads(); }

std::map<std::string, DesignConfig> RunConfig::DesignSettings() const {
  if (!settings.empty()) return settings;
  return {{"default", design}};
}

}  // namespace oted
