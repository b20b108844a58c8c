#include "cli/result.h"

#include <fmt/color.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/console.h"
#include "cli/options.h"
#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/base/words.h"
#include "oted/config/parameters_toml.h"
#include "oted/exports/export.h"
#include "oted/matching/verdict.h"
#include "oted/run/design_record.h"
#include "oted/run/policy_records.h"
#include "oted/run/prediction_words.h"
#include "oted/run/verdict_sentence.h"
#include "oted/stages/design/design_method.h"

namespace oted::cli {
namespace {

using nlohmann::json;

/// Decimals of a parameter's row: three; more where its interval is narrower than that, or its values are small.
int DecimalsOf(const DesignRecord::Parameter& p) {
  constexpr int kFewest = 3, kMost = 6, kMostOfSmall = 9;
  const double half_width = std::abs(p.interval90_high - p.interval90_low) / 2;
  const double size = std::max({std::abs(p.mode), std::abs(p.nominal), half_width});
  const auto decimals = [](int digits, double x) {
    return x > 0 ? digits + static_cast<int>(std::floor(-std::log10(x))) : kFewest;
  };
  const int of_interval = std::clamp(decimals(2, half_width), kFewest, kMost);
  return size < 0.05 ? std::clamp(decimals(3, size), of_interval, kMostOfSmall) : of_interval;
}

/// With so many decimals; what they do not show, with one digit and its power of ten.
std::string Small(double x, int decimals) {
  return x > 0 && x < 0.5 * std::pow(10.0, -decimals) ? fmt::format("{:.0e}", x) : fmt::format("{:.{}f}", x, decimals);
}

bool HasOne(const DesignRecord& design, ParameterVerdict verdict) {
  return std::ranges::find(design.parameters, verdict, &DesignRecord::Parameter::verdict) != design.parameters.end();
}

/// The verdict's meaning, and what values of that verdict rest on.
void PrintMeaning(const DesignRecord& design, ParameterVerdict verdict, const std::string& meaning) {
  std::vector<std::string> conditions;  // in the order that they come in
  std::map<std::string, std::vector<std::string>> moved;
  for (const DesignRecord::Parameter& p : design.parameters) {
    if (p.verdict != verdict) continue;
    for (const DesignRecord::RestsOn& of : p.rests_on) {
      if (!moved.contains(of.condition)) conditions.push_back(of.condition);
      moved[of.condition].push_back(fmt::format("{} would be {:.{}f}", p.name, of.value, DecimalsOf(p)));
    }
  }
  Print("{}: {}{}\n", ToString(verdict), meaning, conditions.empty() ? "" : "; the logs do not show whether it is:");
  for (const std::string& condition : conditions) {
    Print("  if {}, {}\n", condition, fmt::join(moved[condition], ", "));
  }
}

/// Whether freeing it surely bought something.
bool IsKept(const DesignRecord::Suspected& suspected) {
  return suspected.suspect.trial && suspected.suspect.trial->kept;
}

/// @param truth  of each parameter, where that is known
void PrintParameters(const DesignRecord& design, const std::vector<double>& truth) {
  const auto named = [](const DesignRecord::Parameter& p) {
    return p.unit.empty() ? p.name : fmt::format("{} [{}]", p.name, p.unit);
  };
  size_t width = 14;
  for (const DesignRecord::Parameter& p : design.parameters) width = std::max(width, named(p).size());
  Print("\n{:<{}} {:>8} {}{:>20} {:>21}  {:<14}{}\n", "parameter", width, "nominal",
        truth.empty() ? "" : fmt::format("{:>8} ", "truth"), "designed", "90 % interval", "verdict",
        truth.empty() ? "" : "  error");
  for (size_t i = 0; i < design.parameters.size(); ++i) {
    const DesignRecord::Parameter& p = design.parameters[i];
    const int decimals = DecimalsOf(p);
    std::string known, error;
    if (!truth.empty()) {
      known = fmt::format("{:>8.{}f} ", truth.at(i), decimals);
      error = "  " + Small(std::abs(p.mode - truth[i]), decimals);
    }
    Print("{:<{}} {:>8.{}f} {}{:>20} {:>21}  {:<14}{}\n", named(p), width, p.nominal, decimals, known,
          fmt::format("{:.{}f} +- {}", p.mode, decimals, Small(p.std, decimals)),
          fmt::format("[{:.{}f}, {:.{}f}]", p.interval90_low, decimals, p.interval90_high, decimals),
          ToString(p.verdict), error);
  }
  if (HasOne(design, ParameterVerdict::kIdentified)) {
    PrintMeaning(design, ParameterVerdict::kIdentified, "if what is not among the parameters is as in the model");
  }
  const auto is_doubted = [&](const DesignRecord::Parameter& p) {
    return p.verdict == ParameterVerdict::kWeak && (design.WasGrown(p.name) || !p.rests_on.empty());
  };
  if (std::ranges::any_of(design.parameters, is_doubted)) {
    const bool is_of_body =
        std::ranges::any_of(design.grown, [](const auto& g) { return g.spec.field.starts_with("body/"); });
    PrintMeaning(
        design, ParameterVerdict::kWeak,
        fmt::format("{} may be off{}",
                    design.grown.empty() ? "what is not searched" : "in place of what --grow added something else",
                    is_of_body ? " (a body's mass, inertia, length and centre of mass imitate each other)" : ""));
  }
  for (const DesignRecord::Parameter& p : design.parameters) {
    if (p.either_side) Print("{}: the logs do not tell on which side of 0 it lies\n", p.name);
  }
  if (!design.period_sentence.empty()) Print("{}\n", design.period_sentence);
  if (design.fit && design.fit->own_logs) Print("{}\n", design.fit->own_logs->sentence);
  const bool may_be_right = FloorIsReached(design.verdict) || design.verdict == DesignVerdict::kUndecided;
  if (!may_be_right && design.validation) {
    // That more is left than the floor is no proof: sensors may be other than the floor takes them to be.
    const bool is_known = design.fit && std::ranges::any_of(design.fit->suspects, IsKept);
    Print("something that is not searched {}: any value may be farther off than its interval says\n",
          is_known ? "is off as well" : "may be off as well, or the method has not found the values exactly");
  }
}

void PrintPolicies(const EvaluationRecord& evaluation) {
  Print("\n{:<34} {:>20} {:>10}\n", fmt::format("policy in the target ({} episodes)", evaluation.episodes), "return",
        "score");
  std::vector<double> returns;
  for (const EvaluationRecord::PolicyResult& p : evaluation.policies) returns.push_back(p.mean_return);
  const int decimals = ReturnDecimals(returns, 0);
  for (const EvaluationRecord::PolicyResult& p : evaluation.policies) {
    Print("{:<34} {:>20} {:>10}{}\n", p.label,
          fmt::format("{:.{}f} +- {:.{}f}", p.mean_return, decimals, p.std_return, decimals),
          p.score ? fmt::format("{:.1f}", *p.score) : "-",
          p.n_diverged > 0 ? fmt::format("  {} of {} diverged", p.n_diverged, evaluation.episodes) : "");
  }
}

/// The agent that was picked, and what its return does not tell.
void PrintPick(const PolicySelectionRecord& picked, const DesignRecord& design, const std::filesystem::path& folder) {
  const PolicySelectionRecord::Agent& agent = picked.agents.at(static_cast<size_t>(picked.selected - 1));
  Print("\npolicy: {}, agent {} of {}: return {:.{}f} in the designed simulator{}\n", (folder / "policy.onnx").string(),
        picked.selected, picked.agents.size(), agent.mean_return, ReturnDecimals({agent.mean_return}, 0),
        picked.simulators.size() == 1 ? "" : "s");
  if (!design.validation || design.validation->horizons.empty()) return;
  std::vector<std::string> starred;
  for (const auto& channel : design.validation->horizons.front().channels) {
    if (!channel.judged) starred.push_back(channel.name);
  }
  if (!starred.empty()) Print("  {}\n", StarredForPolicies(starred));
}

using Channels = std::vector<DesignRecord::Validation::Channel>;

/// Those that verdicts may name, in the order of the model.
Channels FarthestFromFloor(Channels channels, size_t most) {
  if (channels.size() <= most) return channels;
  std::vector<double> excess;
  for (const auto& c : channels) excess.push_back(c.judged && c.floor > 0 ? c.designed / c.floor : 0);
  std::vector<double> largest = excess;
  std::ranges::nth_element(largest, largest.begin() + static_cast<ptrdiff_t>(most) - 1, std::ranges::greater());
  const double least = largest[most - 1];
  Channels shown;
  for (size_t i = 0; i < channels.size(); ++i) {
    if (excess[i] >= least && shown.size() < most) shown.push_back(channels[i]);
  }
  return shown;
}

/// How the design predicts logs that it did not see.
void PrintValidation(const DesignRecord& design) {
  constexpr size_t kMostChannels = 8;
  if (!design.validation || design.validation->horizons.empty()) return;
  const auto& shown = ShownHorizon(*design.validation);
  Print("\n{:<34} {:>10} {:>10} {:>10}\n",
        fmt::format("{} over {}", shown.learned ? "error" : "held-out error", InWords(shown)), "nominal", "designed",
        "sensors");
  for (const auto& c : FarthestFromFloor(shown.channels, kMostChannels)) {
    Print("{:<34} {:>10.2g} {:>10.2g} {:>10.2g}\n", InWords(c), c.nominal, c.designed, c.floor);
  }
  if (shown.channels.size() > kMostChannels) {
    Print("... {} more channels and other horizons in the report\n", shown.channels.size() - kMostChannels);
  }
  Print("{}", NotesOf(shown));
  if (shown.learned) Print("(on logs that the design learned from: none were kept aside)\n");
  if (design.validation->longest) Print("{}\n", LongestInWords(*design.validation));
}

/// Which method of the design was taken where that was left open, and why.
void PrintMethodChoices(const DesignRecord& design) {
  for (const MethodChoice& choice : design.method_choices) {
    const std::string setting = design.method_choices.size() > 1 ? fmt::format(" for {}", choice.setting) : "";
    Print("method{}: {}, as {}\n", setting, Describe(choice.method).name, choice.reason);
  }
}

/// Whether another suspect that is kept surely leads this one: the two may stand for one cause.
bool IsLed(const DesignRecord::Fit& fit, const FreedTrial& trial) {
  return std::ranges::any_of(fit.suspects, [&](const DesignRecord::Suspected& other) {
    return IsKept(other) && std::ranges::count(trial.led_by, other.suspect.spec.name) > 0;
  });
}

/// What is not searched and would explain what is left, and what was added to the parameters; nothing where the fit
/// asks for nothing.
void PrintSuspects(const DesignRecord& design) {
  for (const Suspect& grown : design.grown) {
    Print("added to the parameters: {}, by --grow\n", ParameterLine(grown.spec));
  }
  if (!design.fit) return;
  const bool leaves_nothing = std::ranges::none_of(design.fit->channels, &DesignRecord::Channel::disagrees);
  if (design.columns_seem_wrong && !design.fit->suspects.empty()) {
    Print("look first at the columns that a warning names: a suspect may only stand in for them, or they for it\n");
  }
  bool has_line = false;
  int n_lines = 0;
  std::string of_no_use;
  for (const DesignRecord::Suspected& suspected : design.fit->suspects) {
    const std::optional<FreedTrial>& trial = suspected.suspect.trial;
    const bool is_kept = IsKept(suspected);
    has_line = has_line || is_kept;
    // Where predictions leave nothing to gain, what the windows ask counts alone.
    const bool is_asked = leaves_nothing && suspected.suspect.IsLikely();
    if (trial && !is_kept && !is_asked && !(IsSure(trial->gain) && trial->gain.value > 0)) {
      of_no_use += (of_no_use.empty() ? "" : ", ") + suspected.suspect.spec.field;
      continue;
    }
    const bool is_offered = (is_kept && !IsLed(*design.fit, *trial)) || is_asked;
    n_lines += is_offered ? 1 : 0;
    Print("suspect, not among the parameters: {}{}\n", suspected.sentence,
          is_offered ? "; add this line: " + suspected.line : "");
  }
  const bool may_grow =
      design.grown.empty() && std::ranges::none_of(design.parameters, [](const auto& p) { return EndsAtBound(p); });
  if (has_line && may_grow && !design.columns_seem_wrong) {
    Print("  ({} and design again; then see what is left. --grow does so by itself: give it an --out of its own)\n",
          n_lines > 1 ? "these may stand for one cause: add the first line alone, or one that you know to be off,"
                      : "add this line");
  }
  if (!of_no_use.empty()) Print("suspects that were freed and do not surely help: {}\n", of_no_use);
  if (FloorIsReached(design.verdict) || !design.validation) return;
  if (design.fit->suspects.empty() && design.verdict != DesignVerdict::kUndecided)
    Print("suspects: none was found that explains what remains\n");
  if (!has_line) {
    if (HasOne(design, ParameterVerdict::kAtBound))
      Print("a value is at its bound, whatever is freed: widen its range, if it may be beyond\n");
    return;
  }
  for (const DesignRecord::Parameter& p : design.parameters) {
    if (!EndsAtBound(p)) continue;
    Print(
        "'{}' is at the end of its range [{:g}, {:g}]: that range is too narrow, or a suspect is off; widen the one or "
        "free the other\n",
        p.name, p.low, p.high);
  }
}

template <class Record>
std::optional<Record> Read(const json& record, const char* name) {
  return record.is_null() ? std::nullopt : std::optional<Record>(Record::FromJson(record, name));
}

}  // namespace

int ReturnDecimals(const std::vector<double>& returns, int otherwise) {
  return std::ranges::all_of(returns, [](double r) { return std::abs(r) < 10; }) ? 3 : otherwise;
}

void PrintDesign(const DesignRecord& design, const Options& options, const std::vector<double>& truth) {
  if (options.json) return;
  PrintParameters(design, truth);
  PrintValidation(design);
  Print("\nverdict: {}\n", design.sentence);
  PrintSuspects(design);
  PrintMethodChoices(design);
  std::fflush(stdout);  // films take seconds, and a pipe shows nothing yet; what fails is told at the end
}

std::string UnjudgedInWords(const std::vector<Design>& designs, const Options& options) {
  std::string words;
  if (options.json) return words;
  for (const Design& design : designs) {
    const ParameterSpace& space = design.record.q.space();
    const std::vector<double> mode = design.record.q.Mode(), std = design.record.q.Std();
    const std::string which = designs.size() == 1 ? "" : fmt::format(" ({}, seed {})", design.setting, design.seed);
    words += fmt::format("\nfound so far{}; there is no verdict yet, and intervals may still widen\n", which);
    for (size_t i = 0; i < mode.size(); ++i) {
      words += fmt::format("  {} {:.4g} +- {:.2g}\n", space[static_cast<int>(i)].name, mode[i], std[i]);
    }
  }
  return words;
}

int PrintResult(const std::filesystem::path& run_directory, const Options& options) {
  return PrintResult(run_directory, options, run_directory);
}

int PrintResult(const std::filesystem::path& run_directory, const Options& options,
                const std::filesystem::path& report) {
  const auto read = [&](const char* name) {
    const std::filesystem::path path = run_directory / name;
    return std::filesystem::exists(path) ? ReadSealed(path, true) : json();
  };
  const json design_json = read("design.json"), evaluation_json = read("evaluation.json");
  const auto design = Read<DesignRecord>(design_json, "design.json");
  const auto evaluation = Read<EvaluationRecord>(evaluation_json, "evaluation.json");
  const json picked_json = read("policy_selection.json");
  if (evaluation && (!design || evaluation->parameters.size() != design->parameters.size())) {
    throw DataError(fmt::format("'{}' has other parameters than 'design.json'; run 'oted evaluate' again",
                                (run_directory / "evaluation.json").string()));
  }
  if (options.json) {
    const json all = {{"design", design_json}, {"policy_selection", picked_json}, {"evaluation", evaluation_json}};
    Print("{}\n", all.dump(2));
  } else {
    if (evaluation) {
      std::vector<double> truth;
      for (const EvaluationRecord::Parameter& p : evaluation->parameters) truth.push_back(p.truth);
      PrintParameters(*design, truth);
      PrintPolicies(*evaluation);
    }
    const auto picked = Read<PolicySelectionRecord>(picked_json, "policy_selection.json");
    if (picked && design) PrintPick(*picked, *design, run_directory);
    const std::filesystem::path designed = run_directory / "export" / "designed.xml";
    if (std::filesystem::exists(designed)) {
      Print("\ndesigned model: {}", designed.string());
      if (const std::string lacks = WhatExportedModelLacks(run_directory); !lacks.empty()) {
        Print("\n  {}\n  (oted.make_env in Python steps it with all; docs/file_formats.md, Exports, has the reasons)",
              lacks);
      }
    }
    Print("\nreport: {}\n", (report / "report.html").string());
  }
  if (!design) return static_cast<int>(ExitCode::kDone);
  const bool all_identified = std::ranges::none_of(design->parameters, [](const DesignRecord::Parameter& p) {
    return p.verdict == ParameterVerdict::kNotIdentified || p.verdict == ParameterVerdict::kAtBound;
  });
  const bool negative = IsNegative(design->verdict) || (options.require_identified && !all_identified);
  return static_cast<int>(negative ? ExitCode::kNoSimulatorMatches : ExitCode::kDone);
}

}  // namespace oted::cli
