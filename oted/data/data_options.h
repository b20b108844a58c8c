#pragma once
/// How a dataset's file is to be read and written, beyond what its name says.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/fields.h"

namespace oted {

enum class DataFormat { kD4rl, kMinari, kNpz, kCsv };

/// Without a value: "auto".
const NamedValues<std::optional<DataFormat>>& DataFormatNames();

/// Which columns of a CSV hold what. An empty entry is found by convention (docs/file_formats.md): observations and
/// actions by their prefixes ("obs.hip", "action_0"), the others by their usual names ("episode", "time", "reward",
/// "terminal", "timeout").
struct CsvLayout {
  std::vector<std::string> observations;
  std::vector<std::string> actions;
  std::string episode;
  std::string time;  ///< [s]
  std::string reward;
  std::string terminal;
  std::string timeout;
};

/// What the child process that reads an HDF5 file may use. The defaults grow with the file: LimitsFor.
struct ChildLimits {
  uint64_t memory_bytes = uint64_t{1} << 30;  ///< beyond what the process uses already
  int cpu_s = 10;
  int wall_s = 60;
};

/// The limits for a file of this size: the defaults, and for each MiB of it 32 MiB of memory, a second of processor
/// time and three of wall time.
ChildLimits LimitsFor(uint64_t file_bytes, const ChildLimits& base = {});

/// Units and zeros of columns, corrected: value * scale + offset. By name or pattern (MatchesGlob) of an observation or
/// an action.
struct Rescaling {
  std::map<std::string, double> scale;
  std::map<std::string, double> offset;  ///< in the unit that the scale leads to
  bool empty() const { return scale.empty() && offset.empty(); }
};

struct DataOptions {
  std::optional<DataFormat> format;  ///< none: by path and content
  CsvLayout columns;                 ///< of a CSV
  /// The logged action acts this many control steps later: row i gets the action of row i - action_delay.
  int action_delay = 0;
  Rescaling rescaling;              ///< units and zeros, corrected before anything else
  std::vector<std::string> unwrap;  ///< observations, by name or pattern, that are angles kept within one turn

  // What the task says; 0 or empty where it is not known.
  double control_period_s = 0;                 ///< a log with a time column and shorter rows is resampled to it
  int max_episode_steps = 0;                   ///< time limit of D4RL files without timeouts; 0: 1,000
  std::vector<std::string> observation_names;  ///< named columns are put into this order
  std::vector<std::string> action_names;       ///< the same for actions
  std::vector<std::string> constant_names;     ///< what differs between recordings: columns that a CSV may have

  ChildLimits hdf5_limits;
  bool check = true;  ///< Dataset::Check; without it, what the file holds, NaN included, for the checks that name it
};

/// What is written beside a dataset: Minari's metadata.
struct WriteOptions {
  std::string environment;         ///< Gymnasium id ("Hopper-v5") for env_spec; empty: none
  std::string dataset_id;          ///< "NAMESPACE/NAME-v0"; empty: the last part of the path
  std::string algorithm = "oted";  ///< what chose the actions
  std::vector<double> action_low;  ///< of the action space; empty: unbounded
  std::vector<double> action_high;

  // Of a Minari dataset alone: observations that begin with an image become {image, INDEX} as in Farama's grid worlds.
  std::vector<int> image_shape;  ///< (height, width, channels), whole numbers below 256; empty: flat observations
  std::string index_name;        ///< what the one number behind the image is ("direction"), an index below n_index
  int n_index = 0;
  int n_discrete_actions = 0;  ///< actions are indices below it; 0: continuous
};

}  // namespace oted
