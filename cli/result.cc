// The final tables on the terminal.

#include <fmt/color.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cli/options.h"
#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted::cli {
namespace {

using nlohmann::json;

void PrintParameters(const json& design, const json& evaluation) {
  const bool truth_known = !evaluation.is_null();
  fmt::print("\n{:<14} {:>8} {}{:>18} {:>17}  {:<14}{}\n", "parameter", "nominal",
             truth_known ? fmt::format("{:>8} ", "truth") : "", "designed", "90 % interval", "verdict",
             truth_known ? "  error" : "");
  for (size_t i = 0; i < design.at("parameters").size(); ++i) {
    const json& p = design["parameters"][i];
    const auto number = [&](const char* key) { return p.at(key).get<double>(); };
    std::string truth, error;
    if (truth_known) {
      truth = fmt::format("{:>8.3f} ", evaluation["parameters"][i]["truth"].get<double>());
      error = fmt::format("  {:.3f}", evaluation["parameters"][i]["absolute_error"].get<double>());
    }
    fmt::print("{:<14} {:>8.3f} {}{:>18} {:>17}  {:<14}{}\n", p.at("name").get<std::string>(), number("nominal"), truth,
               fmt::format("{:.3f} +- {:.3f}", number("mode"), number("std")),
               fmt::format("[{:.3f}, {:.3f}]", p["interval90"][0].get<double>(), p["interval90"][1].get<double>()),
               p.at("verdict").get<std::string>(), error);
  }
}

void PrintPolicies(const json& evaluation) {
  fmt::print("\n{:<34} {:>20} {:>10}\n",
             fmt::format("policy in the target ({} episodes)", evaluation["episodes"].get<int>()), "return", "score");
  std::vector<double> returns;
  for (const json& p : evaluation.at("policies")) returns.push_back(p["mean_return"].get<double>());
  const int decimals = ReturnDecimals(returns, 0);
  for (const json& p : evaluation.at("policies")) {
    const std::string score = p["score"].is_null() ? "-" : fmt::format("{:.1f}", p["score"].get<double>());
    fmt::print("{:<34} {:>20} {:>10}\n", p["label"].get<std::string>(),
               fmt::format("{:.{}f} +- {:.{}f}", p["mean_return"].get<double>(), decimals,
                           p["std_return"].get<double>(), decimals),
               score);
  }
}

std::string VerdictSentence(const std::string& verdict) {
  if (verdict == "no_gap") return "no gap: the un-designed simulator already matches the logs";
  if (verdict == "gap_closed") return "gap closed: the designed simulator matches the logs";
  return "outside family: no simulator within these parameters and bounds matches the logs; widen the bounds or free "
         "other parameters";
}

/// Which method of the design was taken where that was left open, and why.
void PrintMethodChoices(const json& design) {
  const json choices = design.value("method_choices", json::array());
  for (const json& choice : choices) {
    const std::string setting =
        choices.size() > 1 ? fmt::format(" for {}", choice.at("setting").get<std::string>()) : "";
    fmt::print("method{}: {}, as {}\n", setting, choice.at("method").get<std::string>(),
               choice.at("reason").get<std::string>());
  }
}

/// What is not searched and would explain what is left; nothing where the fit asks for nothing.
void PrintSuspects(const json& design) {
  if (!design.contains("fit")) return;
  for (const json& suspect : design["fit"].value("suspects", json::array())) {
    fmt::print("not searched, but off by the logs: {}, about {:.2f} times the model's\n",
               suspect.at("field").get<std::string>(), suspect.at("factor").get<double>());
  }
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
  const json design = read("design.json"), evaluation = read("evaluation.json"),
             policies = read("policy_selection.json");
  if (options.json) {
    fmt::print("{}\n", json{{"design", design}, {"policy_selection", policies}, {"evaluation", evaluation}}.dump(2));
  } else {
    if (!design.is_null()) {
      PrintParameters(design, evaluation);
      fmt::print("\nverdict: {}\n", VerdictSentence(design.at("verdict").get<std::string>()));
      PrintSuspects(design);
      PrintMethodChoices(design);
    }
    if (!evaluation.is_null()) PrintPolicies(evaluation);
    const std::filesystem::path designed = run_directory / "export" / "designed.xml";
    if (std::filesystem::exists(designed)) fmt::print("\ndesigned model: {}", designed.string());
    fmt::print("\nreport: {}\n", (run_directory / "report.html").string());
  }
  if (design.is_null()) return static_cast<int>(ExitCode::kDone);
  bool all_identified = true;
  for (const json& p : design.at("parameters")) all_identified = all_identified && p.at("verdict") != "not_identified";
  const bool negative = design.at("verdict") == "outside_family" || (options.require_identified && !all_identified);
  return static_cast<int>(negative ? ExitCode::kNoSimulatorMatches : ExitCode::kDone);
}

}  // namespace oted::cli
