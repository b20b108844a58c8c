#pragma once
/// gzip of whole buffers, for .csv.gz.

#include <string>

namespace oted {

/// Whether the bytes begin as gzip's do.
bool IsGzip(const std::string& bytes);
/// Inflates all members; at most UnpackBudget (unpack_budget.h). `file` names the file in errors. @throws DataError
std::string Gunzip(const std::string& bytes, const std::string& file);
/// Deflates without name and time: equal bytes give equal bytes. Where that would unpack to more than Gunzip takes, a
/// first part is a member of its own that is not deflated.
std::string Gzip(const std::string& bytes);

}  // namespace oted
