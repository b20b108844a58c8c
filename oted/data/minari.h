#pragma once
/// Minari datasets in its HDF5 format: a folder NAME-vK with data/main_data.hdf5 and data/metadata.json.

#include <string>

#include "oted/data/dataset.h"

namespace oted {

/// The two files of a dataset.
struct MinariFiles {
  std::string data;      ///< main_data.hdf5
  std::string metadata;  ///< metadata.json; empty where there is none
};

/// Finds them from the dataset's folder, its data/ folder, or main_data.hdf5 itself. @throws DataError
MinariFiles FindMinari(const std::string& path);

/// Whether a path's last part is a Minari name: letters, digits, '_' and '-', then "-v" and a number.
bool IsMinariName(const std::string& path);

/// Reads T + 1 observations per episode (minari_layout.h), held against the number of episodes in the metadata.
/// @throws DataError; for arrow, parquet and images with the remedy.
Dataset ReadMinari(const std::string& path, const DataOptions& options);

/// Writes the folder `path`, which must not exist yet, in one piece; Minari's load_dataset opens it when it lies below
/// $MINARI_DATASETS_PATH. Without rewards they are NaN, as Minari needs the array. @throws DataError, also when s' is
/// not the next row's s within an episode: the layout holds each state once.
void WriteMinari(const Dataset& dataset, const std::string& path, const WriteOptions& options);

}  // namespace oted
