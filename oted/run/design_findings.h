#pragma once
/// What design.json says, from what the stages found.

#include <vector>

#include "oted/data/finding.h"
#include "oted/run/design_record.h"
#include "oted/run/run_setup.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

struct DesignFindings {
  std::vector<Candidate> candidates;
  SelectionResult result;
  std::vector<MethodChoice> choices;  ///< of the settings whose method was left to auto
  std::vector<Suspect> suspects;      ///< of the design that ToldBy names
  std::vector<Finding> corrections;   ///< of the logs' columns, where more is left than the sensors explain
  std::vector<bool> has_effect;       ///< per parameter, whether it changes anything that the logs show
};

/// Index of the candidate whose fit and suspects the record shows: the best seed of the selected setting. Where auto
/// put another method in the place of its first, it is the best seed of the first.
size_t ToldBy(const DesignFindings& findings);

/// Parameters with modes, spreads, intervals and verdicts over the selected setting's seeds; the mixture that agents
/// train in; every setting's scores; the verdict on the whole, by the best candidate's predictions. The fit and the
/// suspects are those of ToldBy.
DesignRecord MakeDesignRecord(const RunSetup& run, const DesignFindings& findings);

/// A parameter is at most weak that a condition (rests_on) would move by more than ten small changes (SmallChange), a
/// half of its value. After --grow by more than four, a fifth: something was off that nobody had searched, and what
/// else resembles it may have been in its place. So is what was added, if it is of a body: mass, inertia, length and
/// centre of mass imitate each other.
void WeakenWhatMovesFar(const ParameterSpace& space, DesignRecord& record);

/// A prediction with the names and units of the observations.
DesignRecord::Validation InRecord(const HeldOutPrediction& prediction, const SimulatorSpec& spec);

}  // namespace oted
