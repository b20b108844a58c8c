#pragma once
/// Records that prove themselves: a JSON object that carries the SHA-256 of its own content, of the files that it
/// speaks for, and the seals of the records that it was made from (docs/file_formats.md).
///
///   "files":     {"policy.npz": SHA-256}            in the record's own folder
///   "made_from": {"../clone/clone.json": seal}      relative to it
///   "seal":      SHA-256 of the record without this field, as compact JSON with its keys in order

#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace oted {

/// Names "files" and seals the record: to be called last, before it is written. @param files  names in `folder`
void Seal(nlohmann::json& record, const std::filesystem::path& folder, const std::vector<std::string>& files);
/// The same for files that are not there yet. @param files  name -> SHA-256
void SealAs(nlohmann::json& record, const std::map<std::string, std::string>& files);
/// Without files.
void Seal(nlohmann::json& record);

/// The record's seal, "" where it has none.
std::string SealOf(const nlohmann::json& record);
/// Whether the record is as it was when it was sealed; false where it was not.
bool IsSealed(const nlohmann::json& record);
/// What `record` says of its files. @throws DataError naming `where` when that is no list of plain names
std::map<std::string, std::string> SealedFiles(const nlohmann::json& record, const std::string& where);
/// Names of the files that are missing or not as they were when the record was sealed.
std::vector<std::string> DamagedFiles(const nlohmann::json& record, const std::filesystem::path& file);

/// A record whose seal holds; one without a seal is read as it is when it `may_lack_seal`.
/// @throws DataError naming the file
nlohmann::json ReadSealed(const std::filesystem::path& file, bool may_lack_seal = false);

/// A record that another was made from, and its seal then.
struct SealedSource {
  std::filesystem::path path;
  std::string seal;  ///< "" where none is named
};
/// @param file  where the record lies. Empty where it names none
std::vector<SealedSource> SourcesOf(const nlohmann::json& record, const std::filesystem::path& file);

/// What is there of a record that another was made from: the same, nothing, text that is no JSON, a record that does
/// not fit its own seal, or a whole one that has another seal.
enum class SourceState { kSame, kMissing, kNoJson, kAltered, kAnother };
SourceState StateOf(const SealedSource& source);

/// @param file  where the record lies. @throws DataError naming both where a record that it was made from is there, and
/// is another; what is missing or no JSON is passed over
void CheckMadeFrom(const nlohmann::json& record, const std::filesystem::path& file);

/// @throws DataError naming the file where a sealed record's `name` is listed and no longer as it was
void CheckSealedFile(const nlohmann::json& record, const std::filesystem::path& file, const std::string& name);

/// The same for text: a first line, "# sha256 HEX", and `comment` behind it. Other readers take it for a comment.
std::string SealedText(const std::string& text, const std::string& comment);
/// Such a file, first line included. @throws DataError naming it when it is not as it was written; `remedy` says what
/// one who edited it may do
std::string ReadSealedText(const std::filesystem::path& file, const std::string& remedy);

/// A name of a file and nothing else: no folder, not "." or "..".
bool IsPlainName(const std::string& name);

}  // namespace oted
