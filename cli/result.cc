// The final tables on the terminal.

#include <fmt/color.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/options.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/run/records.h"
#include "oted/stages/design/design_method.h"

namespace oted::cli {
namespace {

using nlohmann::json;

void PrintParameters(const DesignRecord& design, const std::optional<EvaluationRecord>& evaluation) {
  fmt::print("\n{:<14} {:>8} {}{:>18} {:>17}  {:<14}{}\n", "parameter", "nominal",
             evaluation ? fmt::format("{:>8} ", "truth") : "", "designed", "90 % interval", "verdict",
             evaluation ? "  error" : "");
  for (size_t i = 0; i < design.parameters.size(); ++i) {
    const DesignRecord::Parameter& p = design.parameters[i];
    std::string truth, error;
    if (evaluation) {
      truth = fmt::format("{:>8.3f} ", evaluation->parameters.at(i).truth);
      error = fmt::format("  {:.3f}", evaluation->parameters.at(i).absolute_error);
    }
    fmt::print("{:<14} {:>8.3f} {}{:>18} {:>17}  {:<14}{}\n", p.name, p.nominal, truth,
               fmt::format("{:.3f} +- {:.3f}", p.mode, p.std),
               fmt::format("[{:.3f}, {:.3f}]", p.interval90_low, p.interval90_high), ToString(p.verdict), error);
  }
}

void PrintPolicies(const EvaluationRecord& evaluation) {
  fmt::print("\n{:<34} {:>20} {:>10}\n", fmt::format("policy in the target ({} episodes)", evaluation.episodes),
             "return", "score");
  std::vector<double> returns;
  for (const EvaluationRecord::PolicyResult& p : evaluation.policies) returns.push_back(p.mean_return);
  const int decimals = ReturnDecimals(returns, 0);
  for (const EvaluationRecord::PolicyResult& p : evaluation.policies) {
    fmt::print("{:<34} {:>20} {:>10}\n", p.label,
               fmt::format("{:.{}f} +- {:.{}f}", p.mean_return, decimals, p.std_return, decimals),
               p.score ? fmt::format("{:.1f}", *p.score) : "-");
  }
}

std::string VerdictSentence(DesignVerdict verdict) {
  switch (verdict) {
    case DesignVerdict::kNoGap:
      return "no gap: the nominal simulator matches the logs";
    case DesignVerdict::kGapClosed:
      return "gap closed: the designed simulator matches the logs";
    case DesignVerdict::kOutsideFamily:
      break;
  }
  return "outside family: no simulator with these parameters and bounds matches the logs; widen the bounds or free "
         "other parameters";
}

/// How the design predicts logs that it did not see, at the longest horizon up to half a second.
void PrintValidation(const DesignRecord& design) {
  constexpr double kShown = 0.5;
  constexpr size_t kMostChannels = 8;
  if (!design.validation || design.validation->horizons.empty()) return;
  const auto* shown = &design.validation->horizons.front();
  for (const auto& horizon : design.validation->horizons) {
    if (horizon.seconds <= kShown + 1e-9) shown = &horizon;
  }
  fmt::print("\n{:<34} {:>10} {:>10} {:>10}\n", fmt::format("held-out error over {:.2g} s", shown->seconds), "nominal",
             "designed", "sensors");
  for (size_t i = 0; i < std::min(kMostChannels, shown->channels.size()); ++i) {
    const auto& c = shown->channels[i];
    fmt::print("{:<34} {:>10.2g} {:>10.2g} {:>10.2g}\n",
               c.unit.empty() ? c.name : fmt::format("{} [{}]", c.name, c.unit), c.nominal, c.designed, c.floor);
  }
  if (shown->channels.size() > kMostChannels) {
    fmt::print("... {} more channels and other horizons in the report\n", shown->channels.size() - kMostChannels);
  }
}

/// Which method of the design was taken where that was left open, and why.
void PrintMethodChoices(const DesignRecord& design) {
  for (const MethodChoice& choice : design.method_choices) {
    const std::string setting = design.method_choices.size() > 1 ? fmt::format(" for {}", choice.setting) : "";
    fmt::print("method{}: {}, as {}\n", setting, Describe(choice.method).name, choice.reason);
  }
}

/// What is not searched and would explain what is left; nothing where the fit asks for nothing.
void PrintSuspects(const DesignRecord& design) {
  if (!design.fit) return;
  for (const Suspect& suspect : design.fit->suspects) {
    fmt::print("suspect, not among the parameters: {}, by the logs about {:.2f} times the model's value\n",
               suspect.field, suspect.factor);
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

int PrintResult(const std::filesystem::path& run_directory, const Options& options) {
  const auto read = [&](const char* name) {
    const std::filesystem::path path = run_directory / name;
    return std::filesystem::exists(path) ? ReadJson(path) : json();
  };
  const json design_json = read("design.json"), evaluation_json = read("evaluation.json");
  const auto design = Read<DesignRecord>(design_json, "design.json");
  const auto evaluation = Read<EvaluationRecord>(evaluation_json, "evaluation.json");
  if (options.json) {
    const json all = {
        {"design", design_json}, {"policy_selection", read("policy_selection.json")}, {"evaluation", evaluation_json}};
    fmt::print("{}\n", all.dump(2));
  } else {
    if (design) {
      PrintParameters(*design, evaluation);
      PrintValidation(*design);
      fmt::print("\nverdict: {}\n", VerdictSentence(design->verdict));
      PrintSuspects(*design);
      PrintMethodChoices(*design);
    }
    if (evaluation) PrintPolicies(*evaluation);
    const std::filesystem::path designed = run_directory / "export" / "designed.xml";
    if (std::filesystem::exists(designed)) fmt::print("\ndesigned model: {}", designed.string());
    fmt::print("\nreport: {}\n", (run_directory / "report.html").string());
  }
  if (!design) return static_cast<int>(ExitCode::kDone);
  const bool all_identified = std::ranges::none_of(design->parameters, [](const DesignRecord::Parameter& p) {
    return p.verdict == ParameterVerdict::kNotIdentified;
  });
  const bool negative =
      design->verdict == DesignVerdict::kOutsideFamily || (options.require_identified && !all_identified);
  return static_cast<int>(negative ? ExitCode::kNoSimulatorMatches : ExitCode::kDone);
}

}  // namespace oted::cli
