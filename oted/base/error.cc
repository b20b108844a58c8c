#include "oted/base/error.h"

#include <fmt/format.h>

namespace oted::internal {

void CheckFailed(const char* condition, const char* file, int line) {
  throw InternalError(fmt::format("internal error: {} does not hold ({}:{}); please report it", condition, file, line));
}

}  // namespace oted::internal
