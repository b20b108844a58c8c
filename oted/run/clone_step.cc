#include "oted/run/clone_step.h"

#include <fmt/format.h>

#include <utility>

#include "oted/checks/data_check.h"
#include "oted/run/artifacts.h"

namespace oted {
namespace {

/// The checks of data that need no simulator: told before long work starts, and no more than told.
void WarnAboutData(const Dataset& dataset, const SimulatorSpec& spec, LogSink& log) {
  for (const Finding& f : CheckDataset(dataset, FactsOf(spec))) {
    if (f.severity == Severity::kNote) continue;
    log.Warning(fmt::format("data, {}: {}; {}; 'oted data check' has more", f.check, f.what, f.meaning));
  }
}

}  // namespace

ClonedBehavior MakeClone(const RunSetup& run) {
  const std::filesystem::path folder = run.directory.clone();
  ClonedBehavior clone;
  clone.record = OnceAs<CloneRecord>(run.directory, CloneArtifact(run), [&] {
    WarnAboutData(run.dataset, run.spec(), *run.context.log);
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
