#include "oted/run/clone_step.h"

#include <utility>

#include "oted/run/artifacts.h"

namespace oted {

ClonedBehavior MakeClone(const RunSetup& run) {
  const std::filesystem::path folder = run.directory.clone();
  ClonedBehavior clone;
  clone.record = OnceAs<CloneRecord>(run.directory, CloneArtifact(run), [&] {
    CloneResult result = CloneBehavior({run.dataset, run.spec(), run.config.clone, run.Key("clone"),
                                        run.directory.NameOf(folder), run.context, run.factory.get()});
    result.policy->Save(folder / "policy.npz");
    clone.policy = std::move(result.policy);
    return CloneRecord::Of(result);
  });
  if (clone.policy == nullptr) clone.policy = LoadPolicy(folder / "policy.npz");
  return clone;
}

}  // namespace oted
