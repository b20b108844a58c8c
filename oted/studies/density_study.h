#pragma once
/// The paper's Figure 3: the density of a grid world's obstacles, designed from images of demonstrations. Beside every
/// design stands maximum likelihood on the cells that the same demonstrations show: so much can be known.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/log.h"

namespace oted {

/// One line of the figure: what is designed from what, over all seeds.
struct DensityCell {
  int n_demonstrations = 5;
  double target = 0.26;               ///< probability of an obstacle, before unsolvable grids are rejected
  std::string designer = "gaussian";  ///< design.designer

  std::string Name() const;
};

struct DensityStudy {
  std::vector<double> targets = {0.10, 0.26, 0.40};
  std::vector<int> demonstrations = {5, 50};
  std::vector<std::string> designers = {"gaussian", "categorical"};
  std::string policy = "expert";         ///< who demonstrates: "expert" or "medium"
  std::vector<std::string> assignments;  ///< "section.key=value", for every cell
  int n_seeds = 5;                       ///< fresh demonstrations, clone and design for each
  int64_t first_seed = 1;

  /// @throws UsageError for a target outside the range that is searched, or another designer
  std::vector<DensityCell> Cells() const;

  /// The range of densities that is searched.
  static constexpr double kLow = 0, kHigh = 0.6;
};

/// Runs what is missing of a cell: demonstrations, clone and design of every seed, seeds side by side on the context's
/// threads, each with one. After each seed the cell's line in OUT.jsonl (schema
/// oted.density_cell/1) holds all that are done. By seed: q's
/// mode, spread and 90 % interval, the yardstick's density (free and on the grid), cpu seconds, and the mode after
/// every iteration and at the end.
/// @return the record  @throws UsageError when the file holds seeds of other settings; Interrupted
nlohmann::json RunDensityCell(const DensityStudy& study, const DensityCell& cell, const std::filesystem::path& out,
                              const std::string& command, const RunContext& context);

/// A line of Figure 3's table, from a record: errors are q's mode less the target.
struct DensityErrors {
  int n_seeds = 0;
  double rms = 0, bias = 0;  ///< of the design
  double yardstick_rms = 0;
  double ratio = 0, ratio_low = 0, ratio_high = 0;  ///< rms / yardstick_rms; its 90 % bootstrap interval over seeds
  double covered = 0;                               ///< share of seeds whose 90 % interval holds the target
  double nearest = 0, yardstick_nearest = 0;        ///< share of seeds whose nearest multiple of 0.05 is the target's
  double within = 0, yardstick_within = 0;          ///< share of seeds with an error of at most 0.02
  double seconds = 0;                               ///< mean, of one core
};
DensityErrors ErrorsOf(const nlohmann::json& record);

/// Absolute error over discriminator steps: {"steps", "median", "low", "high"}, the latter two the quartiles over
/// seeds.
nlohmann::json ErrorCurves(const nlohmann::json& record);

/// Figure 3 as Markdown, a line for each record.
std::string Figure3(const std::vector<nlohmann::json>& records);

/// Figure 3 as the content of a page (oted/report/study_page.h): a panel for each designer and number of
/// demonstrations, a curve for each target.
nlohmann::json Figure3Page(const std::vector<nlohmann::json>& records);

}  // namespace oted
