#include "oted/base/system_error.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <string_view>

#include "oted/base/files.h"

namespace oted {
const char* RemedyOf(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return "free some space, then run the same command again";
    case EFBIG:
      return "raise the limit (ulimit -f), then run the same command again";
    case EMFILE:
    case ENFILE:
      return "raise the limit (ulimit -n), then run the same command again";
    case ENOMEM:
    case EAGAIN:
      return "use fewer threads (--threads) or free memory, then run the same command again";
    case ENOENT:
      return "check the path";
    case EISDIR:
      return "remove or rename the folder that has the file's name";
    case ELOOP:
      return "remove the link: it leads to itself";
    default:
      return "choose another place or fix its permissions";
  }
}

void ThrowSystemError(const char* what, const std::filesystem::path& path, int error) {
  if (error == ENAMETOOLONG) {
    throw UsageError(
        fmt::format("cannot {} '{}': {}; choose a shorter name", what, path.string(), std::strerror(error)));
  }
  const bool is_folder = error == EISDIR && std::string_view(what) == "read";
  throw FileError(fmt::format("cannot {} '{}': {}; {}", what, path.string(), std::strerror(error),
                              is_folder ? "give a file" : RemedyOf(error)));
}

}  // namespace oted
