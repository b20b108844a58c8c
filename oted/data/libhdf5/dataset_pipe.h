#pragma once
/// A dataset out of a child process: what HDF5 files are read through.

#include <functional>
#include <string>

#include "oted/data/dataset.h"

namespace oted {

/// Runs `read` in a child process within LimitsFor the file and gives back the dataset that it made, without its path
/// and sha256. The result is held against the memory limit before anything is allocated for it: what comes from a child
/// that read a hostile file is not trusted. @throws DataError naming `file`; what `read` throws.
Dataset ReadInChild(const std::string& file, const ChildLimits& limits, const std::function<Dataset()>& read);

}  // namespace oted
