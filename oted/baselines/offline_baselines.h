#pragma once
/// The baselines that learn from the logs alone: one table of what each is called, its settings and its training.

#include <memory>
#include <span>
#include <string>

#include "oted/base/fields.h"
#include "oted/baselines/fisher_brc.h"
#include "oted/baselines/mbop.h"
#include "oted/baselines/offline_learner.h"
#include "oted/baselines/td3_bc.h"

namespace oted {

enum class OfflineBaseline { kFisherBrc, kMbop, kTd3Bc, kRebrac };

/// The settings of all of them, each a section of its own.
struct OfflineSettings {
  FisherBrcConfig f_brc;
  MbopConfig mbop;
  Td3BcConfig td3_bc;
  RebracConfig rebrac;
};

struct OfflineEntry {
  OfflineBaseline baseline;
  std::string name;   ///< "f_brc": in settings and files
  std::string title;  ///< "F-BRC": in reports
  FieldList (*fields)(OfflineSettings& settings);
  std::unique_ptr<OfflineLearner> (*make)(const OfflineJob& job, const OfflineSettings& settings);
};

/// All of them, the paper's first.
std::span<const OfflineEntry> OfflineBaselines();
const OfflineEntry& EntryOf(OfflineBaseline baseline);

/// @throws UsageError for a task with discrete actions or images; DataError for logs without rewards, or too short
void CheckOffline(const OfflineEntry& entry, const OfflineSettings& settings, const Dataset& dataset,
                  const SimulatorSpec& spec);

}  // namespace oted
