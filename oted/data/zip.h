#pragma once
/// ZIP archives in memory, as .npz uses them: stored and deflated members.

#include <cstdint>
#include <map>
#include <string>

namespace oted {

/// The members of an archive by name. Every member is checked against its CRC-32 and its size, and an archive of
/// ZipBytes against its seal. Members that share bytes, or together claim more than `budget` bytes, are refused before
/// anything is unpacked. `name_in_errors` names the archive. @throws DataError
std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors,
                                            uint64_t budget);
/// With UnpackBudget.
std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors);

/// Whether the archive ends with a seal: the SHA-256 of all bytes before, as its comment.
bool HasZipSeal(const std::string& bytes);

enum class ZipMethod { kDeflated, kStored };

/// A sealed archive with a fixed time stamp: equal members give equal bytes. Each member is below 4 GiB. Where all
/// deflated would unpack to more than ParseZip takes, as few as needed are stored.
/// @throws DataError
std::string ZipBytes(const std::map<std::string, std::string>& members, ZipMethod method = ZipMethod::kDeflated);

}  // namespace oted
