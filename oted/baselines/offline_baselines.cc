#include "oted/baselines/offline_baselines.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/rl/offline/offline_rows.h"

namespace oted {

std::span<const OfflineEntry> OfflineBaselines() {
  using Settings = OfflineSettings;
  static const OfflineEntry entries[] = {
      {OfflineBaseline::kFisherBrc, "f_brc", "F-BRC", [](Settings& s) { return s.f_brc.Fields(); },
       [](const OfflineJob& job, const Settings& s) { return MakeFisherBrc(job, s.f_brc); }},
      {OfflineBaseline::kMbop, "mbop", "MBOP", [](Settings& s) { return s.mbop.Fields(); },
       [](const OfflineJob& job, const Settings& s) { return MakeMbop(job, s.mbop); }},
      {OfflineBaseline::kTd3Bc, "td3_bc", "TD3+BC", [](Settings& s) { return s.td3_bc.Fields(); },
       [](const OfflineJob& job, const Settings& s) { return MakeTd3Bc(job, s.td3_bc); }},
      {OfflineBaseline::kRebrac, "rebrac", "ReBRAC", [](Settings& s) { return s.rebrac.Fields(); },
       [](const OfflineJob& job, const Settings& s) { return MakeRebrac(job, s.rebrac); }}};
  return entries;
}

const OfflineEntry& EntryOf(OfflineBaseline baseline) {
  for (const OfflineEntry& entry : OfflineBaselines()) {
    if (entry.baseline == baseline) return entry;
  }
  throw InternalError("an offline baseline that is not in the table");
}

void CheckOffline(const OfflineEntry& entry, const OfflineSettings& settings, const Dataset& dataset,
                  const SimulatorSpec& spec) {
  if (spec.n_discrete_actions > 0 || !spec.image_shape.empty()) {
    throw UsageError(
        fmt::format("baselines.run has {}, which takes continuous actions and no images; task '{}' has {}; take it out",
                    entry.name, spec.task, spec.n_discrete_actions > 0 ? "discrete actions" : "images"));
  }
  CheckHasRewards(dataset);
  if (entry.baseline == OfflineBaseline::kMbop) CheckMbop(dataset, settings.mbop);
}

}  // namespace oted
