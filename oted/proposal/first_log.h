#pragma once
/// The log that a task file is proposed from: its columns and what they are of a model, its largest command, its rate.

#include <optional>
#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/log_columns.h"
#include "oted/proposal/column_map.h"

namespace oted {

bool IsCsv(const std::string& path);

/// The first few of them, and how many more there are.
std::string Some(const std::vector<std::string>& names);

class FirstLog {
 public:
  /// Reads the columns of a CSV file, or all of another one.
  /// @throws FileError, DataError
  explicit FirstLog(std::string path);

  const std::string& path() const { return path_; }
  bool is_csv() const { return IsCsv(path_); }
  /// The log, unless it is a CSV file: its columns have yet to be chosen.
  const std::optional<Dataset>& arrays() const { return arrays_; }

  /// @param model_path  for messages
  /// @throws DataError  nothing is an observation, or nothing a command; an array is neither; a column of the model
  ///   holds words
  ColumnMap Map(const ModelOutline& model, const std::string& model_path) const;

  /// The largest absolute command; 0 where there is none.
  double LargestAction(const ColumnMap& map) const;

  /// From one row to the next, by the time column of a CSV file. [s]
  /// @throws UsageError  there is none
  /// @throws DataError   it does not go up, or not by seconds
  double RowPeriod(const ColumnMap& map) const;
  [[noreturn]] void FailPeriod() const;

 private:
  void RefuseWhereKnown(const LogColumn& column, const ModelOutline& model) const;
  void InFileOrder(ColumnMap& map, const ModelOutline& model, const std::string& model_path) const;
  std::string TimeName(const ColumnMap& map) const;

  std::string path_;
  std::vector<std::string> names_;       // of numbers
  std::vector<LogColumn> columns_;       // those that hold numbers
  std::vector<LogColumn> text_columns_;  // the others
  std::optional<Dataset> arrays_;
  size_t n_observations_ = 0;  // of the names of arrays, the first
};

}  // namespace oted
