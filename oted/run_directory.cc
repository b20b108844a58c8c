#include "oted/run_directory.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {

RunDirectory::RunDirectory(std::filesystem::path root) : root_(std::move(root)) {
  // Found out now, not after an hour of work.
  AtomicFile probe(root_ / "writable");
  WriteFileAtomically(probe.temporary_path(), "");
}

std::string RunDirectory::NameOf(const std::filesystem::path& folder) const {
  return std::filesystem::relative(folder, root_).string();
}

bool RunDirectory::IsComplete(const std::filesystem::path& file, const std::string& fingerprint) const {
  if (!std::filesystem::exists(file)) return false;
  const nlohmann::json result = ReadJson(file);
  if (result.value("fingerprint", "") == fingerprint) return true;
  throw UsageError(
      fmt::format("'{}' was made with other data, settings or an earlier stage that has changed; choose another --out, "
                  "or remove '{}'",
                  file.string(), file.parent_path() == root_ ? file.string() : file.parent_path().string()));
}

void RunDirectory::Complete(const std::filesystem::path& file, nlohmann::json result,
                            const std::string& fingerprint) const {
  result["fingerprint"] = fingerprint;
  WriteJson(file, result);
}

std::string Fingerprint(const nlohmann::json& inputs) { return Sha256(inputs.dump()).substr(0, 16); }

}  // namespace oted
