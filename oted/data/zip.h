#pragma once
/// The part of the ZIP format that .npz archives use: stored and deflated members, zip64.

#include <map>
#include <string>

namespace oted {

/// The members of an archive by name. Every offset and size is checked against the archive before anything is
/// allocated, every member against its CRC-32; inflated members are limited to 4 GiB. `name_in_errors` names the
/// archive. @throws DataError
std::map<std::string, std::string> ParseZip(const std::string& bytes, const std::string& name_in_errors);

/// A deflated archive with a fixed time stamp: equal members give equal bytes. Neither a member nor the archive may
/// reach 4 GiB. @throws DataError
std::string ZipBytes(const std::map<std::string, std::string>& members);

}  // namespace oted
