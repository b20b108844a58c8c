#include "oted/config/former_names.h"

#include <fmt/format.h>

#include "oted/base/error.h"

namespace oted {
namespace {

struct FormerName {
  const char *section, *former, *present;
};
constexpr FormerName kFormerNames[] = {{"agents", "undesigned", "nominal"}, {"agents", "undesigned_at", "nominal_at"}};

}  // namespace

void RefuseFormerName(const std::string& section, std::string_view key, std::string_view where) {
  for (const FormerName& name : kFormerNames) {
    if (section != name.section || key != name.former) continue;
    throw UsageError(fmt::format("{0}: {1}.{2} is now {1}.{3}; rename it", where, section, name.former, name.present));
  }
}

}  // namespace oted
