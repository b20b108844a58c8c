#include "oted/run/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/data/npz.h"
#include "oted/run/finished_design.h"
#include "oted/run/run_lock.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

/// Of what a run keeps in files: a folder of that name is in the way of one.
bool IsNameOfAFile(const fs::path& path) {
  constexpr std::array<const char*, 4> kEndings = {".json", ".toml", ".npz", ".csv"};
  return std::ranges::find(kEndings, path.extension()) != kEndings.end();
}

/// Records that are always sealed; among the exports q.json is not, its record speaks for it.
bool AlwaysHasSeal(const fs::path& path) {
  constexpr std::array<const char*, 18> kNames = {
      "agent.json",      "choice.json", "clone.json",  "dataset.json", "design.json",   "evaluation.json",
      "export.json",     "growth.json", "model.json",  "motion.json",  "offline.json",  "policy_selection.json",
      "prediction.json", "q.json",      "replay.json", "report.json",  "suspects.json", "versions.json"};
  if (path.filename() == "q.json" && path.parent_path().filename() == "export") return false;
  return std::ranges::find(kNames, path.filename()) != kNames.end();
}

class Verifier {
 public:
  /// @param records_alone  whether the files that records speak for are left out
  Verifier(fs::path root, bool records_alone) : root_(std::move(root)), records_alone_(records_alone) {}

  Verification Run() {
    int n_left = kListings;
    while (!List(n_left == 1)) --n_left;
    for (const auto& [path, unused] : std::map(files_)) {
      if (IsTemporaryName(path.filename().string())) {
        Set(path, FileState::kLeftOver, "of a program that died; the next command on this directory removes it");
      } else if (files_.at(path).state == FileState::kDamaged) {
        continue;
      } else if (path.extension() == ".json" && !(records_alone_ && IsWrittenAgain(path))) {
        Guarded(path, [&, &file = path] { CheckRecord(file); });
      } else if (path == root_ / "run.toml") {
        Guarded(path, [&, &file = path] {
          ReadSealedText(file, "an edited file is run with CONFIG, its name");
          Set(file, FileState::kWhole);
        });
      } else if (path.filename() == "checkpoint.npz" && !records_alone_) {
        Guarded(path, [&, &file = path] {
          ReadCheckpoint(file);
          Set(file, FileState::kWhole);
        });
      }
    }
    CheckMisfits();
    CheckOrigin("dataset.json", "dataset", "of other data");
    CheckOrigin("model/model.json", "model", "of another model");
    CheckConfig();
    Verification found;
    found.in_use = IsLocked(root_);
    for (const auto& [path, file] : files_) {
      if (path.filename() != ".lock") found.files.push_back(file);
    }
    return found;
  }

 private:
  static constexpr int kListings = 20;

  /// False where a folder was removed meanwhile, as that of the agents that began is when one of them is chosen.
  /// @param is_last  then that is thrown
  bool List(bool is_last) {
    files_.clear();
    try {
      for (const auto& entry : fs::recursive_directory_iterator(root_)) {
        std::error_code unreadable;
        if (entry.is_regular_file(unreadable)) {
          Add(entry.path(), FileState::kUnproven);
        } else if (!entry.is_directory(unreadable) || IsNameOfAFile(entry.path())) {
          Set(entry.path(), FileState::kDamaged, "it is no regular file");
        }
      }
      return true;
    } catch (const fs::filesystem_error& e) {
      if (is_last || e.code() != std::errc::no_such_file_or_directory) throw;
      return false;
    }
  }

  /// Exports and the report.
  bool IsWrittenAgain(const fs::path& path) const {
    return path.parent_path() == root_ / "export" || path == root_ / "report.json";
  }

  void Add(const fs::path& path, FileState state) { files_[path] = {path.lexically_relative(root_), state, ""}; }

  bool IsWhole(const fs::path& file) const {
    const auto found = files_.find(file);
    return found != files_.end() && found->second.state == FileState::kWhole;
  }

  /// What is worse stays.
  void Set(const fs::path& path, FileState state, const std::string& note = "") {
    if (!files_.contains(path)) Add(path, FileState::kMissing);
    VerifiedFile& file = files_.at(path);
    if (file.state == FileState::kDamaged) return;
    file.state = state;
    file.note = note;
  }

  void SetError(const fs::path& path, const Error& error) {
    if (files_.contains(path) && files_.at(path).state == FileState::kDamaged) return;
    Set(path, FileState::kDamaged, error.what());
    files_.at(path).note_is_error = true;
  }

  template <class F>
  void Guarded(const fs::path& path, const F& check) {
    try {
      check();
    } catch (const Error& e) {
      std::error_code unreadable;
      if (files_.at(path).state == FileState::kUnproven && !fs::exists(path, unreadable)) {
        files_.erase(path);  // gone since it was listed: a stage that came to its end removed its checkpoint
      } else {
        SetError(path, e);
      }
    }
  }

  void CheckRecord(const fs::path& path) {
    const json record = ReadSealed(path, true);
    if (SealOf(record).empty()) {
      if (AlwaysHasSeal(path)) Set(path, FileState::kDamaged, "it has no seal");
      return;
    }
    Set(path, FileState::kWhole);
    for (const SealedSource& source : SourcesOf(record, path)) CheckSource(path, source.path, source.seal);
    if (records_alone_) return;
    const std::vector<std::string> damaged = DamagedFiles(record, path);
    for (const auto& [name, unused] : SealedFiles(record, path.string())) {
      const fs::path file = path.parent_path() / name;
      if (std::ranges::find(damaged, name) == damaged.end()) {
        Set(file, FileState::kWhole);
      } else if (fs::exists(file)) {
        Set(file, FileState::kDamaged, fmt::format("its SHA-256 is not the one in '{}'", path.filename().string()));
      } else {
        Set(file, FileState::kMissing, fmt::format("'{}' names it", path.lexically_relative(root_).string()));
      }
    }
  }

  void CheckSource(const fs::path& record, const fs::path& source, const std::string& seal) {
    if (!fs::exists(source)) {
      return Set(source, FileState::kMissing, fmt::format("it was the source of '{}'", Relative(record)));
    }
    json from;
    try {
      from = ReadSealed(source);
    } catch (const Error& e) {
      return SetError(source, e);  // a file without a seal does not tell of itself
    }
    if (SealOf(from) != seal) misfits_.push_back({record, source});
  }

  /// Of a chain of misfits the first record is damaged. What was made from it cannot be judged.
  void CheckMisfits() {
    const auto stands = [&](const fs::path& path) {
      const auto of = [&](const Misfit& misfit) { return misfit.record == path; };
      return files_.at(path).state != FileState::kDamaged && std::ranges::none_of(misfits_, of);
    };
    for (const Misfit& misfit : misfits_) {
      if (files_.contains(misfit.source) && !stands(misfit.source)) {
        Set(misfit.record, FileState::kUnproven, fmt::format("its source '{}' is damaged", Relative(misfit.source)));
      } else {
        Set(misfit.record, FileState::kDamaged, fmt::format("it was made from another '{}'", Relative(misfit.source)));
      }
    }
  }

  /// What a run learned from is told twice: by a record of its own, and in design.json. One of another run shows there.
  void CheckOrigin(const char* name, const char* field, const char* other) {
    const fs::path design = root_ / "design.json", record = root_ / name;
    if (!IsWhole(design) || !IsWhole(record)) return;
    Guarded(record, [&] {
      const json wanted = ReadSealed(design), got = ReadSealed(record);
      const json::json_pointer of_design(fmt::format("/{}/sha256", field)), own("/sha256");
      if (!wanted.contains(of_design) || !got.contains(own) || wanted[of_design] == got[own]) return;
      Set(record, FileState::kDamaged, fmt::format("it is {} than 'design.json'", other));
    });
  }

  /// A run.toml that is whole may be another run's. Where there is a design, what it was made from is kept beside it.
  void CheckConfig() {
    const fs::path design = root_ / "design.json", config = root_ / "run.toml";
    if (!IsWhole(design)) return;
    for (const char* name : {"run.toml", "dataset.json"}) {
      if (!files_.contains(root_ / name)) Set(root_ / name, FileState::kMissing, "the design tells of it");
    }
    if (!IsWhole(config)) return;
    Guarded(config, [&] {
      const bool has_model = ReadDesign(root_).config.task.has_model();
      const fs::path model = root_ / "model" / "model.json";
      if (has_model && !files_.contains(model)) Set(model, FileState::kMissing, "the design tells of it");
    });
  }

  std::string Relative(const fs::path& path) const { return path.lexically_relative(root_).string(); }

  fs::path root_;
  bool records_alone_;
  std::map<fs::path, VerifiedFile> files_;
  struct Misfit {
    fs::path record, source;  ///< the record was made from a source with another seal
  };
  std::vector<Misfit> misfits_;
};

}  // namespace

bool Verification::is_whole() const {
  return std::ranges::none_of(files, [](const VerifiedFile& file) {
    return file.state == FileState::kDamaged || file.state == FileState::kMissing;
  });
}

namespace {

fs::path RootOf(const fs::path& run_directory) {
  const fs::path root = run_directory.lexically_normal();
  return root.has_filename() ? root : root.parent_path();
}

bool HoldsRun(const fs::path& root) { return fs::exists(root / "run.toml") || fs::exists(root / "design.json"); }

}  // namespace

Verification VerifyRun(const fs::path& run_directory) {
  const fs::path root = RootOf(run_directory);
  if (!HoldsRun(root)) {
    throw UsageError(
        fmt::format("'{}' holds no run.toml; name the folder that was given as --out", run_directory.string()));
  }
  return Verifier(root, false).Run();
}

void CheckRecords(const fs::path& run_directory) {
  const fs::path root = RootOf(run_directory);
  if (!HoldsRun(root)) return;  // for the caller to tell
  for (const VerifiedFile& file : Verifier(root, true).Run().files) {
    const bool is_record = file.path.extension() == ".json" || file.path == "run.toml";
    if (!is_record || (file.state != FileState::kDamaged && file.state != FileState::kMissing)) continue;
    if (file.note_is_error) throw DataError(file.note);
    throw DataError(
        fmt::format("'{}' is {}: {}; restore it, or run again the command that made it ('oted verify {}' names all "
                    "that are not whole)",
                    (root / file.path).string(), file.state == FileState::kDamaged ? "damaged" : "missing", file.note,
                    root.string()));
  }
}

}  // namespace oted
