#pragma once
/// Work in units: each is one command of the program whose result depends on nothing but what the unit's key names. A
/// plan lists them. Whatever runs them, here or on other machines, needs no more than the plan and an index.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "oted/base/fields.h"

namespace oted {

/// What a unit asks of a machine.
struct UnitNeeds {
  int threads = 1;
  int memory_mib = 2000;
  int minutes = 240;
};

/// A file or folder that a unit reads.
struct PlanInput {
  std::string path;  ///< absolute
  std::string sha256;

  /// @throws DataError where it cannot be read
  static PlanInput Of(const std::filesystem::path& path);
};

struct PlanLine {
  /// SHA-256 of everything that determines the result (UnitKey), in hexadecimal digits.
  std::string key;
  std::string name;                ///< for people
  std::vector<std::string> words;  ///< the command, without --out, --threads and --quiet
  std::vector<PlanInput> inputs;
  /// What tells it from its siblings, by name: columns of a sweep's table.
  std::vector<std::pair<std::string, std::string>> labels;
  UnitNeeds needs;

  /// Of its folders: 16 digits of the key.
  std::string Folder() const { return key.substr(0, 16); }
  nlohmann::json ToJson() const;
  /// @param where  file and line, for errors. @throws DataError
  static PlanLine FromJson(const nlohmann::json& line, const std::string& where);
};

/// How the results of a plan become one.
enum class PlanKind {
  kStudy,  ///< "study": a study's cells, each unit some seeds of some of them
  kSweep,  ///< "sweep": run directories, a row of a table each
};
const NamedValues<PlanKind>& PlanKindNames();

struct Plan {
  static constexpr const char* kSchema = "oted.plan/1";
  PlanKind kind = PlanKind::kSweep;
  std::string version = OTED_VERSION;  ///< of the program that made it
  /// Of a study: the command that does all of it at once from the folder where the plan is made, without --out.
  std::vector<std::string> command;
  std::vector<PlanLine> lines;

  /// The most that any unit asks for.
  UnitNeeds MostNeeds() const;
  /// A head, and a line of JSON for each unit. The same plan gives the same bytes.
  /// @throws UsageError when there is no unit, or when two are the same work
  std::string ToText() const;
  /// @throws DataError where the file is no plan, or not as it was written
  static Plan Read(const std::filesystem::path& file);
};

/// The key of a unit, from what determines its result but for the program's version, which it adds.
std::string UnitKey(const nlohmann::json& identity);

}  // namespace oted
