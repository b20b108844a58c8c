#pragma once
/// What a call from Python says of a run, and the task file that one may begin with.

#include <memory>
#include <string>

#include "oted/config/run_config.h"
#include "oted/run/finished_design.h"
#include "oted/sim/simulator.h"
#include "python/binding.h"

namespace oted::python {

/// What a call from Python says of a run: the TOML of a task file, whose relative paths start from that file's folder,
/// and what the call gives beside it, [data] and [parameters], which come before the file's. Paths in `given` start
/// from the working folder.
struct Study {
  std::string toml, file_name, given;
  std::shared_ptr<const FinishedDesign> design = nullptr;  ///< whose task and parameters these are; toml is empty

  /// @throws UsageError, DataError
  RunConfig Config() const;
  /// The simulator of ExpandPresets(Config()). @throws DataError where a design's model has changed since
  std::unique_ptr<SimulatorFactory> Factory(const RunConfig& config, const Array2<double>& starts = {}) const;
};

void AddStudies(nb::module_& m);

}  // namespace oted::python
