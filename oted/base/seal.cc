#include "oted/base/seal.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr const char* kSeal = "seal";
constexpr const char* kFiles = "files";
constexpr char kTextSeal[] = "# sha256 ";

std::string HashWithoutSeal(json record) {
  record.erase(kSeal);
  // As it will be read again: a number that is not finite is null in a file.
  return Sha256(record.dump(-1, ' ', false, json::error_handler_t::replace));
}

}  // namespace

void SealAs(json& record, const std::map<std::string, std::string>& files) {
  record.erase(kFiles);
  for (const auto& [name, hash] : files) record[kFiles][name] = hash;
  record[kSeal] = HashWithoutSeal(record);
}

void Seal(json& record, const fs::path& folder, const std::vector<std::string>& files) {
  std::map<std::string, std::string> hashes;
  for (const std::string& name : files) hashes[name] = Sha256OfFile(folder / name);
  SealAs(record, hashes);
}

void Seal(json& record) { Seal(record, {}, {}); }

std::string SealOf(const json& record) {
  const bool has = record.is_object() && record.contains(kSeal) && record.at(kSeal).is_string();
  return has ? record.at(kSeal).get<std::string>() : "";
}

bool IsSealed(const json& record) {
  const std::string seal = SealOf(record);
  return !seal.empty() && seal == HashWithoutSeal(record);
}

std::map<std::string, std::string> SealedFiles(const json& record, const std::string& where) {
  std::map<std::string, std::string> files;
  if (!record.is_object() || !record.contains(kFiles)) return files;
  for (const auto& [name, hash] : record.at(kFiles).items()) {
    if (!IsPlainName(name) || !hash.is_string()) {
      throw DataError(fmt::format("'{}': '{}' in its field 'files' is no plain name; restore the file", where, name));
    }
    files[name] = hash.get<std::string>();
  }
  return files;
}

std::vector<std::string> DamagedFiles(const json& record, const fs::path& file) {
  std::vector<std::string> damaged;
  for (const auto& [name, hash] : SealedFiles(record, file.string())) {
    const fs::path path = file.parent_path() / name;
    std::error_code error;
    if (!fs::is_regular_file(path, error) || Sha256OfFile(path) != hash) damaged.push_back(name);
  }
  return damaged;
}

json ReadSealed(const fs::path& file, bool may_lack_seal) {
  json record = ReadJson(file);
  if (IsSealed(record) || (may_lack_seal && SealOf(record).empty())) return record;
  throw DataError(fmt::format("'{}' {}; restore it, or remove it and run again the command that made it", file.string(),
                              SealOf(record).empty()
                                  ? "has no seal: it was made by another version of oted, or is damaged"
                                  : "is not as oted wrote it (its seal does not fit its content)"));
}

std::vector<SealedSource> SourcesOf(const json& record, const fs::path& file) {
  const auto made_from = record.find("made_from");
  if (made_from == record.end() || !made_from->is_object()) return {};
  std::vector<SealedSource> sources;
  for (const auto& [name, seal] : made_from->items()) {
    sources.push_back(
        {(file.parent_path() / name).lexically_normal(), seal.is_string() ? seal.get<std::string>() : ""});
  }
  return sources;
}

SourceState StateOf(const SealedSource& source) {
  if (!fs::exists(source.path)) return SourceState::kMissing;
  const std::string text = ReadJsonText(source.path);
  if (!json::accept(text)) return SourceState::kNoJson;
  const json record = ParseJson(text, source.path.string());
  if (!IsSealed(record)) return SourceState::kAltered;
  return SealOf(record) == source.seal ? SourceState::kSame : SourceState::kAnother;
}

void CheckMadeFrom(const json& record, const fs::path& file) {
  for (const SealedSource& source : SourcesOf(record, file)) {
    const SourceState state = StateOf(source);
    if (state != SourceState::kAltered && state != SourceState::kAnother) continue;
    throw DataError(
        fmt::format("'{}' was made from another '{}' than the one that is there; restore that file, or "
                    "remove '{}' to make it again",
                    file.string(), source.path.string(), file.string()));
  }
}

void CheckSealedFile(const json& record, const fs::path& file, const std::string& name) {
  const auto files = SealedFiles(record, file.string());
  const auto found = files.find(name);
  const fs::path path = file.parent_path() / name;
  if (found == files.end() || Sha256OfFile(path) == found->second) return;
  throw DataError(
      fmt::format("'{}' is damaged: its SHA-256 is not the one in '{}'; restore it, or run again the "
                  "command that made it",
                  path.string(), file.string()));
}

std::string SealedText(const std::string& text, const std::string& comment) {
  return fmt::format("{}{} {}\n{}", kTextSeal, Sha256(text), comment, text);
}

std::string ReadSealedText(const fs::path& file, const std::string& remedy) {
  std::string text = ReadFile(file);
  const size_t end = text.find('\n');
  const bool sealed = text.starts_with(kTextSeal) && end != std::string::npos;
  if (sealed && text.substr(sizeof kTextSeal - 1, 64) == Sha256(std::string_view(text).substr(end + 1))) return text;
  throw DataError(fmt::format("'{}' is not as oted wrote it: restore it; {}", file.string(), remedy));
}

bool IsPlainName(const std::string& name) {
  return !name.empty() && name != "." && name != ".." &&
         name.find_first_of(std::string_view("/\\\0", 3)) == std::string::npos;
}

}  // namespace oted
