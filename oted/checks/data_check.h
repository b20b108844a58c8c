#pragma once
/// Everything that can be told of logged data before a design: the checks that need no simulator, and with one the
/// one-step error, the task's terminals, the parameters' effects, and whether there is a gap at all.

#include <optional>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/checks.h"
#include "oted/data/checks_dynamics.h"
#include "oted/matching/judge.h"
#include "oted/sim/one_step.h"
#include "oted/sim/simulator.h"

namespace oted {

/// How well the logs can be told from the nominal simulator (docs/data_checks.md).
enum class GapVerdict { kNone, kSmall, kClear, kUnknown };
std::string ToString(GapVerdict verdict);

struct DataCheck {
  std::vector<Finding> findings;
  std::vector<ChannelNoise> noise;       ///< per observation channel, or empty
  std::optional<OneStepError> one_step;  ///< where the task is known and its states can be set
  std::optional<JudgeScore> gap;         ///< where the task is known, unless rates are hidden that only a fit finds
  bool gap_by_clone = false;             ///< a clone acted, whose own errors count, too
  bool is_little = false;                ///< so few transitions that what a classifier tells means nothing
  /// Unknown where there is little data. None below an area under the curve of 0.55, clear from 0.75 on; from 0.55 on
  /// unknown where a clone acted.
  GapVerdict Verdict() const;
};

/// What a task says about its data.
TaskFacts FactsOf(const SimulatorSpec& spec);

/// What the checks that need no simulator warn of, a sentence each.
/// @throws DataError where readings are of no robot (kImpossibleMotion): nothing can be said of such logs
/// @param most  the methods that design from these logs
std::vector<std::string> DataWarnings(const Dataset& dataset, const SimulatorSpec& spec, Concern most);

/// What CheckCorrections finds of checked data: which changes of the columns (a joint's or an action's sign, two joints
/// swapped, a zero) would make the nominal simulator predict the logs far better. None where logs of the task cannot be
/// replayed.
std::vector<Finding> FindCorrections(const SimulatorFactory& factory, const Dataset& dataset,
                                     const RunContext& context);
/// Such a finding as a warning of a run, with its remedy.
std::string CorrectionWarning(const Finding& correction);

/// @param factory  may be null: then the checks that need a simulator are left out. Its parameters, if any, are checked
///   for an effect on the logged episodes.
/// Never throws for what the data hold. Equal seeds give equal results at any number of threads.
DataCheck CheckData(const Dataset& dataset, const SimulatorFactory* factory, uint64_t seed, const RunContext& context);

}  // namespace oted
