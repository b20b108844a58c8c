#pragma once
/// What design.json says, from what the stages found.

#include <vector>

#include "oted/run/design_record.h"
#include "oted/run/run_setup.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

struct DesignFindings {
  std::vector<Candidate> candidates;
  SelectionResult result;
  std::vector<MethodChoice> choices;     ///< of the settings whose method was left to auto
  std::vector<Suspect> suspects;         ///< of the design that tells of the whole
  std::vector<std::string> corrections;  ///< of the logs' columns, where more is left than the sensors explain
  std::vector<bool> has_effect;          ///< per parameter, whether it changes anything that the logs show
};

/// The candidate whose fit tells of the whole: the selected setting's best, or that of the first method which it stands
/// for.
size_t ToldBy(const DesignFindings& findings);

/// Parameters with modes, spreads, intervals and verdicts over the selected setting's seeds; the mixture that agents
/// train in; every setting's scores; the verdict on the whole. Where another method took the place of trajectories, the
/// verdict, the channels and the suspects are still those of the fit, which tells them.
DesignRecord MakeDesignRecord(const RunSetup& run, const DesignFindings& findings);

/// A prediction with the names and units of the observations.
DesignRecord::Validation InRecord(const HeldOutPrediction& prediction, const SimulatorSpec& spec);

}  // namespace oted
