#pragma once
/// Units and zeros of a log's columns, corrected.

#include <string>
#include <vector>

#include "oted/data/data_options.h"
#include "oted/data/dataset.h"
#include "oted/data/recording.h"

namespace oted {

/// The names of a task, for logs that have none.
struct TaskNames {
  const std::vector<std::string>& observations;
  const std::vector<std::string>& actions;
};

/// Corrects the columns that `rescaling` names, in every row.
/// @throws UsageError where a pattern names no column or two patterns name one, and where an observation is corrected
///   beside a qpos, which would stay
void Rescale(Recording& recording, const Rescaling& rescaling, const TaskNames& task);
void Rescale(Dataset& dataset, const Rescaling& rescaling, const TaskNames& task);

}  // namespace oted
