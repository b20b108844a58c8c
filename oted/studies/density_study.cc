#include "oted/studies/density_study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/base/rng.h"
#include "oted/base/statistics.h"
#include "oted/config/run_config.h"
#include "oted/sim/minigrid/density_likelihood.h"
#include "oted/sim/minigrid/minigrid_simulator.h"
#include "oted/sim/task_policy.h"
#include "oted/stages/clone/clone.h"
#include "oted/stages/design/design.h"
#include "oted/studies/cell_record.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kDensitySchema = "oted.density_cell/1";
constexpr double kGrid = 0.05;    // the paper's quantisation
constexpr double kWithin = 0.02;  // an error that counts as small

RunConfig ConfigOf(const DensityStudy& study, const DensityCell& cell) {
  RunConfig config;
  config.task.name = "MiniGrid-Obstacles-10x10";
  for (const std::string& assignment : study.assignments) config.Set(assignment);
  config.Set("design.designer=" + cell.designer);
  return config;
}

MinigridTask TaskOf(const RunConfig& config) { return config.task.grid.ApplyTo(FindMinigridTask(config.task.name)); }

MinigridSimulatorFactory FactoryOf(const RunConfig& config) {
  return {TaskOf(config),
          {{.name = "density",
            .field = "env/density",
            .low = DensityStudy::kLow,
            .high = DensityStudy::kHigh,
            .scale = ParameterScale::kAbsolute}}};
}

/// Keeps how q's mode moved, and forgets the rest.
class ModeCurve : public NullSink {
 public:
  void Scalar(std::string_view, std::string_view key, int64_t, double value) override {
    if (key == "design/mode/density") modes.push_back(value);
  }
  std::vector<double> modes;  // by iteration
};

/// Seconds of the processor that this thread has used.
double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Four digits: no more is known, and the file stays small.
double Rounded(double density) { return std::round(1e4 * density) / 1e4; }

json RunSeed(const RunConfig& config, const DensityStudy& study, const DensityCell& cell, int64_t seed,
             const fs::path& scratch, const RunContext& context) {
  const MinigridSimulatorFactory factory = FactoryOf(config);
  const RngKey key = RngKey(static_cast<uint64_t>(seed)).Stage("minigrid design");
  const Dataset logs = CollectTaskPolicy(factory, {cell.target}, TaskPolicyNamed(study.policy), cell.n_demonstrations,
                                         key.Stage("demonstrations"), 1);
  DensityLikelihood likelihood(TaskOf(config));
  likelihood.Add(logs);

  ModeCurve curve;
  const RunContext own{&curve, context.stop, 1};
  const double start = ThreadSeconds();
  const CloneResult clone = CloneBehavior({logs, factory.spec(), config.clone, key.Stage("clone"), "clone", own});
  const DesignConfig design = config.design.Resolved(factory.parameters(), factory.spec());
  const DesignResult result = LearnDesign({.factory = factory,
                                           .dataset = logs,
                                           .clone = clone.policy.get(),
                                           .key = key.Stage("design"),
                                           .folder = scratch,
                                           .run_name = "design",
                                           .context = own},
                                          design);
  const double seconds = ThreadSeconds() - start;
  fs::remove_all(scratch);

  // By iteration, and what came of it. Behind the design g is trained against a q that does not move.
  curve.modes.resize(std::min(curve.modes.size(), static_cast<size_t>(design.n_iterations())));
  curve.modes.push_back(result.q.Mode()[0]);
  const Designer::Interval interval = result.q.CentralInterval(0.9)[0];
  json modes = json::array();
  for (const double mode : curve.modes) modes.push_back(Rounded(mode));
  return {{"mode", result.q.Mode()[0]},
          {"std", result.q.Std()[0]},
          {"interval90", {interval.low, interval.high}},
          {"yardstick", likelihood.Maximum(DensityStudy::kLow, DensityStudy::kHigh).density},
          {"yardstick_grid", likelihood.MaximumOnGrid(DensityStudy::kLow, DensityStudy::kHigh, kGrid).density},
          {"obstacles_seen", likelihood.n_obstacles_seen()},
          {"cells_seen", likelihood.n_seen()},
          {"cpu_s", std::round(10 * seconds) / 10},
          {"modes", modes}};
}

/// The mean density of the grids that are left after rejection; null where no exact figure is known.
json RealisedDensity(const MinigridTask& task, double density) {
  const int side = task.size - 2;
  if (task.placement != GridPlacement::kBernoulli || !task.solvable) return nullptr;
  if (side > minigrid::SolvableGrids::kMaxSide) return nullptr;
  return minigrid::SolvableGrids::Of(side).MeanRealisedDensity(density);
}

/// What a cell's results depend on, beside its seeds.
json IdentityOf(const RunConfig& config, const DensityStudy& study, const DensityCell& cell) {
  const MinigridSimulatorFactory factory = FactoryOf(config);
  const DesignConfig design = config.design.Resolved(factory.parameters(), factory.spec());
  return {{"demonstrations", cell.n_demonstrations},
          {"target", cell.target},
          {"designer", cell.designer},
          {"policy", study.policy},
          {"realised", RealisedDensity(TaskOf(config), cell.target)},
          {"assignments", study.assignments},
          {"discriminator_steps", design.discriminator.steps}};
}

double NearestOnGrid(double density) { return kGrid * std::round(density / kGrid); }

std::vector<double> Column(const json& record, const char* key) {
  std::vector<double> values;
  for (const json& seed : record.at("seeds")) values.push_back(seed.at(key).get<double>());
  return values;
}

double RootMeanSquare(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

/// The value below which a share `p` of the sorted values lies, between neighbours in proportion.
double Quantile(const std::vector<double>& sorted, double p) {
  const double at = p * static_cast<double>(sorted.size() - 1);
  const size_t below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

/// The 5 % and 95 % quantiles of RMS(a) / RMS(b) over resampled pairs.
std::pair<double, double> RatioInterval(const std::vector<double>& a, const std::vector<double>& b) {
  constexpr int kResamples = 2000;
  Rng rng = RngKey(0).Stage("ratio of errors").MakeRng();
  std::vector<double> ratios;
  for (int i = 0; i < kResamples; ++i) {
    double square_a = 0, square_b = 0;
    for (size_t k = 0; k < a.size(); ++k) {
      const size_t pick = rng.Below(a.size());
      square_a += a[pick] * a[pick];
      square_b += b[pick] * b[pick];
    }
    ratios.push_back(std::sqrt(square_a / square_b));
  }
  std::ranges::sort(ratios);
  return {Quantile(ratios, 0.05), Quantile(ratios, 0.95)};
}

constexpr std::array kColumns = {"demonstrations",
                                 "designer",
                                 "density",
                                 "mean density of solvable grids",
                                 "seeds",
                                 "error (root mean square)",
                                 "bias",
                                 "yardstick",
                                 "ratio",
                                 "90 % interval holds",
                                 "nearest grid value",
                                 "yardstick's",
                                 "within 0.02",
                                 "yardstick's",
                                 "cpu s"};

std::string Percent(double share) { return fmt::format("{:.0f} %", 100 * share); }

std::vector<std::string> Row(const json& record) {
  const DensityErrors errors = ErrorsOf(record);
  return {fmt::format("{}", record.at("demonstrations").get<int>()),
          record.at("designer").get<std::string>(),
          fmt::format("{:.2f}", record.at("target").get<double>()),
          record.at("realised").is_number() ? fmt::format("{:.3f}", record.at("realised").get<double>()) : "–",
          fmt::format("{}", errors.n_seeds),
          fmt::format("{:.4f}", errors.rms),
          fmt::format("{:+.4f}", errors.bias),
          fmt::format("{:.4f}", errors.yardstick_rms),
          fmt::format("{:.2f} ({:.2f} to {:.2f})", errors.ratio, errors.ratio_low, errors.ratio_high),
          Percent(errors.covered),
          Percent(errors.nearest),
          Percent(errors.yardstick_nearest),
          Percent(errors.within),
          Percent(errors.yardstick_within),
          fmt::format("{:.0f}", errors.seconds)};
}

}  // namespace

std::string DensityCell::Name() const {
  return fmt::format("{}-demonstrations-{:.2f}-{}", n_demonstrations, target, designer);
}

std::vector<DensityCell> DensityStudy::Cells() const {
  for (const double target : targets) {
    if (target > kLow && target < kHigh) continue;
    throw UsageError(fmt::format("target density {}, wanted one between {} and {}, the range that is searched", target,
                                 kLow, kHigh));
  }
  TaskPolicyNamed(policy);
  const std::vector<std::string> known = {"gaussian", "categorical"};
  std::vector<DensityCell> cells;
  for (const std::string& designer : designers) {
    if (std::ranges::find(known, designer) == known.end()) {
      throw UsageError(
          fmt::format("designer '{}', wanted {}{}", designer, fmt::join(known, "|"), DidYouMean(designer, known)));
    }
    for (const int n : demonstrations) {
      for (const double target : targets) cells.push_back({n, target, designer});
    }
  }
  return cells;
}

json RunDensityCell(const DensityStudy& study, const DensityCell& cell, const fs::path& out, const std::string& command,
                    const RunContext& context) {
  const RunConfig config = ConfigOf(study, cell);
  CellRecord cell_record(IdentityOf(config, study, cell), kDensitySchema, StudyFile(out), cell.Name(), command);
  std::vector<int64_t> missing;
  for (int64_t seed = study.first_seed; seed < study.first_seed + study.n_seeds; ++seed) {
    if (!cell_record.Has(seed)) missing.push_back(seed);
  }

  std::mutex mutex;
  const int n_seeds = static_cast<int>(cell_record.record().at("seeds").size() + missing.size());
  ParallelFor(static_cast<int>(missing.size()), context.n_threads, [&](int i) {
    const int64_t seed = missing[static_cast<size_t>(i)];
    const fs::path scratch = out / "scratch" / fmt::format("{}-{}", cell.Name(), seed);
    json entry = RunSeed(config, study, cell, seed, scratch, context);
    const std::lock_guard lock(mutex);
    cell_record.Add(seed, std::move(entry));
    const DensityErrors errors = ErrorsOf(cell_record.record());
    context.log->Progress("figure3", cell.Name(), errors.n_seeds, n_seeds,
                          fmt::format("error {:.3f}, yardstick {:.3f}", errors.rms, errors.yardstick_rms));
  });
  return cell_record.record();
}

DensityErrors ErrorsOf(const json& record) {
  const double target = record.at("target");
  const double nearest = NearestOnGrid(target);
  const std::vector<double> modes = Column(record, "mode"), yardstick = Column(record, "yardstick"),
                            yardstick_grid = Column(record, "yardstick_grid");
  DensityErrors result;
  result.n_seeds = static_cast<int>(modes.size());
  if (modes.empty()) return result;
  std::vector<double> errors, yardstick_errors;
  const double share = 1.0 / static_cast<double>(modes.size());
  for (size_t i = 0; i < modes.size(); ++i) {
    errors.push_back(modes[i] - target);
    yardstick_errors.push_back(yardstick[i] - target);
    result.nearest += share * (std::abs(NearestOnGrid(modes[i]) - nearest) < 1e-9);
    result.yardstick_nearest += share * (std::abs(yardstick_grid[i] - nearest) < 1e-9);
    result.within += share * (std::abs(errors.back()) <= kWithin);
    result.yardstick_within += share * (std::abs(yardstick_errors.back()) <= kWithin);
  }
  for (const json& seed : record.at("seeds")) {
    const json& interval = seed.at("interval90");
    result.covered += share * (interval[0].get<double>() <= target && target <= interval[1].get<double>());
  }
  result.rms = RootMeanSquare(errors);
  result.bias = Mean(errors);
  result.yardstick_rms = RootMeanSquare(yardstick_errors);
  result.ratio = result.rms / result.yardstick_rms;
  std::tie(result.ratio_low, result.ratio_high) = RatioInterval(errors, yardstick_errors);
  result.seconds = Mean(Column(record, "cpu_s"));
  return result;
}

json ErrorCurves(const json& record) {
  const double target = record.at("target");
  const int64_t steps = record.at("discriminator_steps");
  json curves = {{"steps", json::array()}, {"median", json::array()}, {"low", json::array()}, {"high", json::array()}};
  size_t n_iterations = 0;
  for (const json& seed : record.at("seeds")) n_iterations = std::max(n_iterations, seed.at("modes").size());
  for (size_t i = 0; i < n_iterations; ++i) {
    std::vector<double> errors;
    for (const json& seed : record.at("seeds")) {
      if (i < seed.at("modes").size()) errors.push_back(std::abs(seed.at("modes")[i].get<double>() - target));
    }
    std::ranges::sort(errors);
    curves["steps"].push_back(static_cast<int64_t>(i + 1) * steps);
    curves["median"].push_back(Quantile(errors, 0.5));
    curves["low"].push_back(Quantile(errors, 0.25));
    curves["high"].push_back(Quantile(errors, 0.75));
  }
  return curves;
}

std::string Figure3(const std::vector<json>& records) {
  std::string text = fmt::format("| {} |\n|", fmt::join(kColumns, " | "));
  for (size_t i = 0; i < kColumns.size(); ++i) text += "---|";
  text += "\n";
  for (const json& record : records) text += fmt::format("| {} |\n", fmt::join(Row(record), " | "));
  return text;
}

json Figure3Page(const std::vector<json>& records) {
  json page = {
      {"title", "Figure 3: density of obstacles from images"},
      {"headline", "How near the designed density comes to the true one"},
      {"text",
       {"Absolute error of q's mode over discriminator steps: the median over seeds and the band between their "
        "quartiles. Every seed has demonstrations of its own.",
        "Dashed: the median error of maximum likelihood on the cells that the same demonstrations show. It says "
        "how much can be known; it is not part of the method.",
        "In the table, errors are root mean squares. The density is the probability of an obstacle before unsolvable "
        "grids are rejected. 0.26 lies off the "
        "categorical designer's grid, whose nearest value is 0.25.",
        "The paper's Figure 3 shows errors that fall within several hundred discriminator steps, a little "
        "later for 0.26; it gives no figures."}},
      {"level_name", "median error of maximum likelihood"},
      {"panels", json::array()},
      {"columns", {"", "density", "error", "maximum likelihood's", "ratio", "90 % interval holds", "within 0.02"}},
      {"rows", json::array()}};
  std::map<std::string, json> panels;
  for (const json& record : records) {
    if (record.at("seeds").empty()) continue;
    const std::string title = fmt::format("{}, {} demonstrations", record.at("designer").get<std::string>(),
                                          record.at("demonstrations").get<int>());
    if (!panels.contains(title)) page["panels"].push_back({{"title", title}});
    std::vector<double> yardstick;
    for (const double density : Column(record, "yardstick")) {
      yardstick.push_back(std::abs(density - record.at("target").get<double>()));
    }
    std::ranges::sort(yardstick);
    json line = ErrorCurves(record);
    line["name"] = fmt::format("density {:.2f}", record.at("target").get<double>());
    line["level"] = Quantile(yardstick, 0.5);
    panels[title].push_back(line);
    const DensityErrors errors = ErrorsOf(record);
    page["rows"].push_back({title, fmt::format("{:.2f}", record.at("target").get<double>()),
                            fmt::format("{:.4f}", errors.rms), fmt::format("{:.4f}", errors.yardstick_rms),
                            fmt::format("{:.2f}", errors.ratio), Percent(errors.covered), Percent(errors.within)});
  }
  for (json& panel : page["panels"]) {
    panel["x"] = "discriminator steps";
    panel["lines"] = panels.at(panel.at("title").get<std::string>());
  }
  return page;
}

}  // namespace oted
