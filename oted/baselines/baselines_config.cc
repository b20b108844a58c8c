#include "oted/baselines/baselines_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "oted/base/error.h"

namespace oted {

const std::vector<std::string>& BaselinesConfig::Known() {
  static const std::vector<std::string> known = {"dr"};
  return known;
}

bool BaselinesConfig::Runs(const std::string& name) const { return std::ranges::find(run, name) != run.end(); }

void BaselinesConfig::Check() const {
  for (size_t i = 0; i < run.size(); ++i) {
    if (std::ranges::find(Known(), run[i]) == Known().end()) {
      throw UsageError(fmt::format("baselines.run has '{}', wanted some of {}{}", run[i], fmt::join(Known(), ", "),
                                   DidYouMean(run[i], Known())));
    }
    if (std::find(run.begin(), run.begin() + static_cast<ptrdiff_t>(i), run[i]) !=
        run.begin() + static_cast<ptrdiff_t>(i)) {
      throw UsageError(fmt::format("baselines.run names '{}' twice; name it once", run[i]));
    }
  }
}

FieldList BaselinesConfig::Fields() {
  FieldList fields("baselines");
  fields.Add("run", &run, "what the paper compares with, trained beside the agents: dr, domain randomisation");
  return fields;
}

}  // namespace oted
