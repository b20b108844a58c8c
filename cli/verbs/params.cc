#include "cli/verbs/params.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/options.h"
#include "cli/value_kinds.h"
#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/checks/parameter_check.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/channel_path.h"
#include "oted/sim/presets.h"

namespace oted::cli {
namespace {

using nlohmann::json;

struct ParamsOptions : Options {
  bool values = false;
};

void AddModelOptions(CLI::App& verb, ParamsOptions& options) {
  verb.add_option("CONFIG,--config", options.config, "configuration file (TOML)");
  verb.add_option("--task", options.task, "simulator: Hopper-v5, ...")->type_name(value_kind::kTask);
  verb.add_option("--set", options.assignments, "section.key=value, any setting of the configuration; repeatable")
      ->type_name(value_kind::kSetting)
      ->allow_extra_args(false);
  verb.add_flag("--json", options.json, "print JSON");
}

RunConfig ResolveWithTask(const Options& options) {
  RunConfig config = ResolveConfig(options);
  config.task.Resolve();
  if (config.task.name.empty())
    throw UsageError("no task is named; add --task, or [task] name = \"Hopper-v5\" to the configuration");
  return config;
}

std::string UnitInBrackets(const std::string& unit) { return unit.empty() ? "" : fmt::format(" [{}]", unit); }

/// "1", or "0.9 .. 2".
std::string NominalRange(const std::vector<ParameterPlace>& places) {
  const auto [low, high] = std::minmax_element(places.begin(), places.end(),
                                               [](const auto& a, const auto& b) { return a.nominal < b.nominal; });
  return low->nominal == high->nominal ? fmt::format("{:g}", low->nominal)
                                       : fmt::format("{:g} .. {:g}", low->nominal, high->nominal);
}

// ---------------------------------------------------------------- list

/// The second words of an owner's places, each once: the objects' names.
std::vector<std::string> ObjectNames(const std::vector<ParameterOffer>& offers, const std::string& owner) {
  std::vector<std::string> names;
  for (const ParameterOffer& offer : offers) {
    if (offer.owner != owner) continue;
    for (const ParameterPlace& place : offer.places) {
      const size_t first = place.path.find('/'), last = place.path.rfind('/');
      if (first == last) continue;
      std::string name = place.path.substr(first + 1, last - first - 1);
      name = name.substr(0, name.find(" (dof"));
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  return names;
}

std::string PresetRange(const PresetEntry& entry) {
  std::string text;
  if (entry.multiple) {
    text = fmt::format("{:g} .. {:g} x nominal{}", entry.multiple->low, entry.multiple->high,
                       entry.logarithmic ? ", logarithmic" : "");
  }
  if (entry.absolute) {
    text += fmt::format("{}{:g} .. {:g}{}", text.empty() ? "" : "; ", entry.absolute->low, entry.absolute->high,
                        entry.multiple ? " where nominal is 0" : "");
  }
  return text;
}

void PrintOffers(const std::string& task, const std::vector<ParameterOffer>& offers, bool values) {
  Print("{}: what can be a parameter. NAME takes * and ?, or #number; a field without [k] sets all its numbers.\n",
        task);
  std::string owner;
  for (const ParameterOffer& offer : offers) {
    if (offer.owner != owner) {
      owner = offer.owner;
      const std::vector<std::string> names = ObjectNames(offers, owner);
      Print("\n{}{}{}\n", owner, names.empty() ? "" : ": ", fmt::join(names, ", "));
    }
    Print("  {:<30} {:<18} {}{}\n", offer.path, NominalRange(offer.places), offer.meaning, UnitInBrackets(offer.unit));
    if (!values || IsChannelPath(offer.path)) continue;
    for (const ParameterPlace& place : offer.places) Print("      {:<40} {:g}\n", place.path, place.nominal);
  }
}

void PrintPresets(const SimulatorFactory& factory) {
  for (const Preset& preset : Presets()) {
    Print("\npreset {}: {}\n", preset.name, preset.purpose);
    for (const PresetEntry& entry : preset.entries) {
      Print("  {:<18} {:<28} {}\n", entry.name, entry.field, PresetRange(entry));
    }
    for (const std::string& note : ExpandPresets({preset.name}, {}, factory).skipped) Print("  not here: {}\n", note);
  }
}

json OffersJson(const std::vector<ParameterOffer>& offers, const SimulatorFactory& factory) {
  json document = {{"schema", "oted.params/1"},
                   {"task", factory.spec().task},
                   {"parameters", json::array()},
                   {"presets", json::array()}};
  for (const ParameterOffer& offer : offers) {
    json places = json::array();
    for (const ParameterPlace& place : offer.places)
      places.push_back({{"path", place.path}, {"nominal", place.nominal}});
    document["parameters"].push_back({{"owner", offer.owner},
                                      {"path", offer.path},
                                      {"unit", offer.unit},
                                      {"meaning", offer.meaning},
                                      {"values", places}});
  }
  for (const Preset& preset : Presets()) {
    const ExpandedPresets expanded = ExpandPresets({preset.name}, {}, factory);
    json entries = json::array();
    for (const ParameterSpec& spec : expanded.parameters) {
      entries.push_back({{"name", spec.name},
                         {"field", spec.field},
                         {"range", {spec.low, spec.high}},
                         {"scale", spec.scale == ParameterScale::kAbsolute ? "absolute" : "nominal"},
                         {"log", spec.logarithmic}});
    }
    document["presets"].push_back(
        {{"name", preset.name}, {"purpose", preset.purpose}, {"parameters", entries}, {"skipped", expanded.skipped}});
  }
  return document;
}

void List(const ParamsOptions& options) {
  RunConfig config = ResolveWithTask(options);
  config.task.model.start = "default";  // where episodes begin says nothing of what can be a parameter
  const auto factory = MakeSimulatorFactory(config.task, {});
  std::vector<ParameterOffer> offers = factory->Offers();
  for (ParameterOffer& offer : ChannelOffers(factory->spec())) offers.push_back(std::move(offer));
  if (options.json) {
    Print("{}\n", OffersJson(offers, *factory).dump(2));
    return;
  }
  PrintOffers(config.task.name, offers, options.values);
  PrintPresets(*factory);
}

// ---------------------------------------------------------------- check

void PrintMeanings(const ParameterCheck& check) {
  constexpr size_t kShown = 6;
  for (const CheckedParameter& p : check.parameters) {
    const ParameterSpec& spec = p.spec;
    Print("\n{}: {}{}\n  {} in [{:g}, {:g}] {}{}, nominal {:g}\n", spec.name, p.info.meaning,
          UnitInBrackets(p.info.unit), spec.field, spec.low, spec.high, spec.unit,
          spec.logarithmic ? ", logarithmic" : "", spec.nominal);
    std::vector<std::string> values;
    for (size_t i = 0; i < std::min(p.info.places.size(), kShown); ++i) {
      values.push_back(fmt::format("{} = {:g}", p.info.places[i].path, p.info.places[i].nominal));
    }
    const size_t more = p.info.places.size() - values.size();
    Print("  sets {}{}\n", fmt::join(values, ", "), more > 0 ? fmt::format(" and {} more", more) : "");
  }
}

std::string Change(double change) {
  // Below what a reader could tell from nothing, but not nothing.
  return change == 0 ? "-" : change < 1e-3 ? fmt::format("{:.0e}", change) : fmt::format("{:.3g}", change);
}

void PrintEffects(const ParameterCheck& check) {
  Print(
      "\nLargest change from one bound over the nominal value to the other, in standard deviations of each observation "
      "({} {} episodes, {} transitions)\n\n",
      check.n_episodes, check.logged ? "logged" : "random", check.n_transitions);
  size_t width = 11;
  for (const std::string& name : check.simulator.observation_names) width = std::max(width, name.size());
  Print("{:<{}}", "observation", width);
  for (const CheckedParameter& p : check.parameters) {
    Print("  {:>{}}", p.spec.name, std::max<size_t>(9, p.spec.name.size()));
  }
  Print("\n");
  for (int j = 0; j < check.simulator.obs_dim(); ++j) {
    const std::string name = check.simulator.observation_names.empty()
                                 ? fmt::format("#{}", j)
                                 : check.simulator.observation_names[static_cast<size_t>(j)];
    Print("{:<{}}", name, width);
    for (const CheckedParameter& p : check.parameters) {
      const std::string mark = p.most_affected() == j ? "*" : "";
      Print("  {:>{}}", mark + Change(p.effect.by_observation[static_cast<size_t>(j)]),
            std::max<size_t>(9, p.spec.name.size()));
    }
    Print("\n");
  }
  Print("* reacts most\n");
}

void PrintFindings(const ParameterCheck& check) {
  for (const CheckedParameter& p : check.parameters) {
    if (p.has_effect()) continue;
    Print("\nno effect: '{}' changes nothing in these episodes; check the path and the range, or leave it out\n",
          p.spec.name);
  }
  for (const TradeOff& pair : check.trade_offs) {
    Print(
        "\ntrade-off: '{}' and '{}' move the observations {} (cosine {:.3f}): the noisier the logs, the less they tell "
        "one from the other. The design's intervals say how well they do; if you know one of the two, fix it\n",
        check.parameters[static_cast<size_t>(pair.first)].spec.name,
        check.parameters[static_cast<size_t>(pair.second)].spec.name,
        pair.cosine > 0 ? "alike" : "alike, but for the sign", pair.cosine);
  }
  if (check.all_have_effect() && check.trade_offs.empty()) {
    Print(
        "\nEvery parameter has an effect, and no two act alike. Whether the logs tell all of them at once, the design "
        "says.\n");
  }
}

int Check(const ParamsOptions& options) {
  std::vector<std::string> notes;
  const RunConfig config = ExpandPresets(ResolveWithTask(options), &notes);
  config.Check();
  Dataset logs;
  const bool logged = !config.data.empty();
  if (logged) logs = ReadEpisodes(config.data, SpecOf(config.task));
  const auto factory = MakeSimulatorFactory(config.task, config.parameters, logs.EpisodeStarts());
  const ParameterCheck check =
      CheckParameters(*factory, logged ? &logs : nullptr,
                      RngKey(static_cast<uint64_t>(config.run.seed)).Stage("params check"), config.Threads());
  if (options.json) {
    json document = check.ToJson();
    document["skipped"] = notes;
    Print("{}\n", document.dump(2));
  } else {
    Print("{}: {} parameter{}\n", config.task.name, check.parameters.size(), check.parameters.size() == 1 ? "" : "s");
    for (const std::string& note : notes) Print("left out: {}\n", note);
    PrintMeanings(check);
    PrintEffects(check);
    PrintFindings(check);
  }
  const bool negative = config.run.strict && !check.all_have_effect();
  return static_cast<int>(negative ? ExitCode::kNoSimulatorMatches : ExitCode::kDone);
}

}  // namespace

void AddParamsVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand("params", "list what can be a parameter; check what the chosen ones do");
  verb->require_subcommand(1);

  CLI::App* list = verb->add_subcommand("list", "list every parameter of a task's simulator, and the presets");
  auto listed = std::make_shared<ParamsOptions>();
  AddModelOptions(*list, *listed);
  list->add_flag("--values", listed->values, "list the nominal value of every number");
  list->callback([listed] { List(*listed); });

  CLI::App* check = verb->add_subcommand(
      "check", "show meaning, nominal values and measured effect of parameters, and which trade off");
  auto checked = std::make_shared<ParamsOptions>();
  AddModelOptions(*check, *checked);
  AddParameterOptions(*check, *checked);
  check->add_option("--data", checked->data, "logged trajectories; without them, episodes with random actions");
  check->add_option("--episodes", checked->episodes, "episodes of the data to use, from the first: a number, or all");
  AddSeed(*check, checked->seed);
  AddThreads(*check, checked->threads);
  check->add_flag("--strict", checked->strict, "exit with 4 when a parameter has no measured effect");
  check->callback([&program, checked] { program.exit_code = Check(*checked); });
}

}  // namespace oted::cli
