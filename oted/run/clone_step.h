#pragma once
/// Stage 1 of a run: mu-hat from the logs.

#include <memory>

#include "oted/nn/policy.h"
#include "oted/run/records.h"
#include "oted/run/run_setup.h"

namespace oted {

struct ClonedBehavior {
  CloneRecord record;
  std::shared_ptr<const Policy> policy;
};

/// clone/: policy.npz and clone.json.
ClonedBehavior MakeClone(const RunSetup& run);

}  // namespace oted
