#include "oted/baselines/baselines_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "oted/base/error.h"

namespace oted {

const NamedValues<Baseline>& BaselineNames() {
  static const NamedValues<Baseline> names = {
      {Baseline::kDomainRandomization, "dr"}, {Baseline::kIntervalSearch, "is"}, {Baseline::kBcDr, "bc_dr"}};
  return names;
}

bool BaselinesConfig::Runs(Baseline baseline) const {
  return std::ranges::find(run, NameOf(BaselineNames(), baseline)) != run.end();
}

std::vector<Baseline> BaselinesConfig::Agents() const {
  std::vector<Baseline> agents;
  const bool collects = Runs(Baseline::kBcDr) && bc_dr.collector == Collector::kRandomizedAgent;
  if (Runs(Baseline::kDomainRandomization) || collects) agents.push_back(Baseline::kDomainRandomization);
  if (Runs(Baseline::kIntervalSearch)) agents.push_back(Baseline::kIntervalSearch);
  return agents;
}

std::vector<OfflineBaseline> BaselinesConfig::Offline() const {
  std::vector<OfflineBaseline> found;
  for (const OfflineEntry& entry : OfflineBaselines()) {
    if (std::ranges::find(run, entry.name) != run.end()) found.push_back(entry.baseline);
  }
  return found;
}

void BaselinesConfig::Check() const {
  std::vector<std::string> known;
  for (const auto& [unused, name] : BaselineNames()) known.push_back(name);
  for (const OfflineEntry& entry : OfflineBaselines()) known.push_back(entry.name);
  for (size_t i = 0; i < run.size(); ++i) {
    if (std::ranges::find(known, run[i]) == known.end()) {
      throw UsageError(fmt::format("baselines.run has '{}', wanted some of {}{}", run[i], fmt::join(known, ", "),
                                   DidYouMean(run[i], known)));
    }
    if (std::find(run.begin(), run.begin() + static_cast<ptrdiff_t>(i), run[i]) !=
        run.begin() + static_cast<ptrdiff_t>(i)) {
      throw UsageError(fmt::format("baselines.run names '{}' twice; name it once", run[i]));
    }
  }
}

FieldList BaselinesConfig::Fields() {
  FieldList fields("baselines");
  fields.Add("run", &run,
             "baselines to train beside the agents: dr (domain randomisation), is (interval search), bc_dr (a clone of "
             "the logs and of data collected under dr); from the logs alone: f_brc, mbop, td3_bc, rebrac");
  fields.Add("is_boundary", &is.boundary, "is: share of the episodes with one parameter at an end of its interval",
             AboveUpTo(0, 1));
  fields.Add("is_episodes", &is.episodes, "is: episodes at an end before it may move", AtLeast(1));
  fields.Add("is_step", &is.step, "is: by how much an end moves, in ranges of the parameter", AboveUpTo(0, 1));
  fields.Add("is_grow", &is.grow,
             "is: an end moves outwards from this mean performance on; 0: a random policy's return, 1: the reference",
             Between(-10, 10));
  fields.Add("is_shrink", &is.shrink, "is: an end moves inwards at this mean performance or less", Between(-10, 10));
  fields.Add("is_reference", &is.reference,
             "is: return that counts as 1; 0: that of D4RL's expert, where the task has it");
  fields.AddChoice("bc_dr_collector", &bc_dr.collector,
                   "bc_dr: who collects in the randomised simulators, the agent trained there or the clone of the logs",
                   NamedValues<Collector>{{Collector::kRandomizedAgent, "dr"}, {Collector::kClone, "clone"}});
  fields.Add("bc_dr_ratio", &bc_dr.ratio, "bc_dr: simulated transitions for each logged one", AboveUpTo(0, 1000));
  return fields;
}

}  // namespace oted
