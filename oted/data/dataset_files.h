#pragma once
/// Datasets from files of every format, and into them.

#include <string>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// Reads a dataset by its path: .hdf5 | .h5 (D4RL or Minari, whichever it holds), .npz, .csv | .csv.gz, or the folder
/// of a Minari dataset. With what `options` say of format, columns, delay and the task: named columns come in the
/// task's order, a log with times is resampled to the task's control period, actions are delayed; `remarks` tells.
/// @throws DataError, UsageError
Dataset ReadDataset(const std::string& path, const DataOptions& options = {});

/// Dataset::sha256 of what is there. @throws DataError
std::string Sha256OfDataset(const std::string& path, const DataOptions& options = {});

/// Writes by path, atomically: .hdf5 | .h5 (D4RL layout), .npz, .csv | .csv.gz, or, where the last part of the path is
/// a Minari name (NAME-v0), that folder. @throws DataError
void WriteDataset(const Dataset& dataset, const std::string& path, const WriteOptions& options = {});

/// Puts the columns of a dataset that has names into the order of the task's names. Columns whose names are all foreign
/// to the task stay in the file's order; so does a dataset without names. @throws DataError when only some match.
void MatchNames(Dataset& dataset, const std::vector<std::string>& observation_names,
                const std::vector<std::string>& action_names);
/// Gives row i the action of row i - `delay` of its episode; each episode loses its first `delay` rows.
/// @throws DataError when nothing is left.
void DelayActions(Dataset& dataset, int delay);

}  // namespace oted
