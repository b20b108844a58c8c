#pragma once
/// Which columns of a CSV hold what: by the user's lists, the task's names, or convention.

#include <string>
#include <string_view>
#include <vector>

#include "oted/data/data_options.h"

namespace oted {

/// Indices of columns; -1 or empty where the file has none.
struct CsvColumns {
  std::vector<int> observations;
  std::vector<int> actions;
  std::vector<int> qpos;
  std::vector<int> qvel;
  std::vector<int> constants;  ///< one for each of the options' names, -1 where the file has none; empty: none of them
  int episode = -1;
  int time = -1;
  int reward = -1;
  int terminal = -1;
  int timeout = -1;
  std::vector<std::string> observation_names;  ///< without their prefix
  std::vector<std::string> action_names;
  std::vector<std::string> unused;  ///< names of columns that hold none of it
};

/// Whether `name` begins with the word of a prefix ("obs_0", "act.hip"), and not with a longer one ("actuator/hip").
bool BeginsWithPrefix(std::string_view name, std::string_view word);

/// Finds the columns of `header`. Observations and actions are, in this order: the listed ones; those that the task
/// names, when all are there; those with a prefix. @throws DataError naming `file`, what is missing and what is there.
CsvColumns FindColumns(const std::vector<std::string>& header, const DataOptions& options, const std::string& file);

}  // namespace oted
