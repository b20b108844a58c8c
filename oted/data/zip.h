#pragma once
/// ZIP archives in memory, as .npz uses them: stored and deflated members.

#include <map>
#include <string>

namespace oted {

/// The members of an archive by name. Every member is checked against its CRC-32 and its size; members that share
/// bytes, or inflate to more than 4 GiB, are refused. `name_in_errors` names the archive. @throws DataError
std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors);

/// A deflated archive with a fixed time stamp: equal members give equal bytes. Each member is below 4 GiB.
/// @throws DataError
std::string ZipBytes(const std::map<std::string, std::string>& members);

}  // namespace oted
