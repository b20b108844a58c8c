// How near the design from images comes to a known density, beside the maximum-likelihood yardstick, on fresh
// demonstrations for every seed. One JSON file per cell; what is there is not made again.
//
//   minigrid_design OUT [--seeds N] [--first-seed N] [--demos 5,50] [--targets 0.10,0.26,0.40]
//                   [--set design.KEY=VALUE ...] [--table]

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/base/log.h"
#include "oted/run_config.h"
#include "oted/sim/minigrid/density_likelihood.h"
#include "oted/sim/minigrid/expert.h"
#include "oted/stages/design/design.h"

namespace {

using namespace oted;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kHigh = 0.6;  // densities are searched in [0, kHigh]

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

json RunCell(const RunConfig& config, int n_demos, double target, int seed, const fs::path& scratch) {
  const MinigridTask task = config.task.grid.ApplyTo(FindMinigridTask("MiniGrid-Obstacles-10x10"));
  const MinigridSimulatorFactory factory(
      task, {{.name = "density", .field = "env/density", .low = 0, .high = kHigh, .scale = ParameterScale::kAbsolute}});
  const RngKey key = RngKey(static_cast<uint64_t>(seed)).Stage("minigrid design");
  const Dataset logs =
      CollectMinigridDemonstrations(factory, {target}, MinigridExpert(), n_demos, key.Stage("demonstrations"), 1);
  DensityLikelihood likelihood(task);
  likelihood.Add(logs);
  NullSink log;
  const RunContext context{&log, nullptr, 1};
  const double start = CpuSeconds();
  const CloneResult clone = CloneBehavior(logs, factory.spec(), config.clone, key.Stage("clone"), "clone", context);
  const DesignConfig design = config.design.Resolved(factory.parameters(), factory.spec());
  const DesignResult result =
      LearnDesign(factory, logs, clone.policy.get(), design, key.Stage("design"), scratch, "design", context);
  return {{"schema", "oted.minigrid_design/1"},
          {"demonstrations", n_demos},
          {"target", target},
          {"seed", seed},
          {"designer", design.designer},
          {"observation", task.observation},
          {"mode", result.q.Mode()[0]},
          {"std", result.q.Std()[0]},
          {"yardstick", likelihood.Maximum(0, kHigh).density},
          {"yardstick_grid", likelihood.MaximumOnGrid(0, kHigh).density},
          {"cpu_s", CpuSeconds() - start}};
}

void PrintTable(const std::vector<json>& cells, const std::vector<int>& demos, const std::vector<double>& targets) {
  fmt::print(
      "| demonstrations | target | seeds | error (root mean square) | bias | yardstick | ratio | nearest grid value | "
      "yardstick's | within 0.02 | cpu s |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int n : demos) {
    for (const double target : targets) {
      double square = 0, bias = 0, yard = 0, near = 0, yard_near = 0, within = 0, cpu = 0, count = 0;
      const double nearest = 0.05 * std::round(target / 0.05);
      for (const json& cell : cells) {
        if (cell.at("demonstrations") != n || std::abs(cell.at("target").get<double>() - target) > 1e-9) continue;
        const double error = cell.at("mode").get<double>() - target;
        const double yard_error = cell.at("yardstick").get<double>() - target;
        square += error * error;
        bias += error;
        yard += yard_error * yard_error;
        near += std::abs(0.05 * std::round(cell.at("mode").get<double>() / 0.05) - nearest) < 1e-9;
        yard_near += std::abs(cell.at("yardstick_grid").get<double>() - nearest) < 1e-9;
        within += std::abs(error) <= 0.02;
        cpu += cell.at("cpu_s").get<double>();
        ++count;
      }
      if (count == 0) continue;
      fmt::print(
          "| {} | {:.2f} | {:.0f} | {:.4f} | {:+.4f} | {:.4f} | {:.2f} | {:.0f} % | {:.0f} % | {:.0f} % | {:.0f} |\n",
          n, target, count, std::sqrt(square / count), bias / count, std::sqrt(yard / count), std::sqrt(square / yard),
          100 * near / count, 100 * yard_near / count, 100 * within / count, cpu / count);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string out;
  int n_seeds = 40, first_seed = 1;
  std::vector<int> demos = {5, 50};
  std::vector<double> targets = {0.10, 0.26, 0.40};
  std::vector<std::string> settings;
  bool table_only = false;
  CLI::App app("design error of MiniGrid's density beside the maximum-likelihood yardstick");
  app.add_option("out", out, "folder of the cells' JSON files")->required();
  app.add_option("--seeds", n_seeds, "fresh datasets per cell");
  app.add_option("--first-seed", first_seed, "the lowest seed");
  app.add_option("--demos", demos, "demonstrations")->delimiter(',');
  app.add_option("--targets", targets, "true densities")->delimiter(',');
  app.add_option("--set", settings, "section.key=value")->allow_extra_args(false);
  app.add_flag("--table", table_only, "run nothing");
  CLI11_PARSE(app, argc, argv);
  try {
    RunConfig config;
    for (const std::string& assignment : settings) config.Set(assignment);
    std::vector<json> cells;
    for (int seed = first_seed; seed < first_seed + n_seeds; ++seed) {
      for (const int n : demos) {
        for (const double target : targets) {
          const fs::path file = fs::path(out) / fmt::format("{}-{}-{}-{:.2f}-{}.json", config.design.designer,
                                                            config.task.grid.observation, n, target, seed);
          if (!fs::exists(file) && !table_only) {
            WriteJson(file, RunCell(config, n, target, seed, fs::path(out) / "scratch" / file.stem()));
            fs::remove_all(fs::path(out) / "scratch" / file.stem());
          }
          if (fs::exists(file)) cells.push_back(ReadJson(file));
        }
      }
    }
    PrintTable(cells, demos, targets);
  } catch (const std::exception& error) {
    fmt::print(stderr, "minigrid_design: {}\n", error.what());
    return 1;
  }
  return 0;
}
