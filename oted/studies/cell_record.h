#pragma once
/// One cell of a study: what it was run with, and one entry for each of its seeds.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "oted/studies/study_file.h"

namespace oted {

/// Not for several threads at once.
class CellRecord {
 public:
  /// Goes on with the seeds that `file` holds of `cell`. @param identity  what all seeds have in common, by name
  /// @param schema  of the record  @param command  what runs the seeds that will be added
  /// @throws UsageError where the file holds seeds of another identity
  CellRecord(nlohmann::json identity, const std::string& schema, StudyFile file, std::string cell, std::string command);

  bool Has(int64_t seed) const;
  /// Adds one seed's entry and writes the cell's line. Entries stand in the order of their seeds, whatever the order in
  /// which they end; the cell's command is that of the last one added.
  void Add(int64_t seed, nlohmann::json entry);

  /// `identity`, "schema", "version", "command", and "seeds", a list of entries that name their "seed".
  const nlohmann::json& record() const { return record_; }

 private:
  nlohmann::json record_;
  StudyFile file_;
  std::string cell_;
  std::string command_;
};

}  // namespace oted
