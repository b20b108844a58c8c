#pragma once
/// design.form = "auto": which form of the design, by evidence, and why (docs/design_forms.md#auto).

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/matching/designer.h"
#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/design_config.h"
#include "oted/stages/design/replay/held_out_replay.h"

namespace oted {

/// The forms that auto tries where the answer of its first, `trajectories`, is outside the family: what is likeliest
/// need not be the best simulator where none is right. The paper's own form is not among them: from a clone's rollouts
/// it came nowhere near, in more time (docs/design_forms.md#auto).
const std::vector<std::string>& OtherForms();

/// What a form, learning from part of the logs, made of the rest.
struct TriedForm {
  std::string form;
  std::vector<double> mode;  ///< z
  double error = 0;          ///< geometric mean over the held-out windows, in units of HeldOutErrors
  double gain = 0;           ///< over the first form: mean log ratio of the windows' errors; positive where nearer
  double gain_std = 0;       ///< standard error of the gain
};

struct FormChoice {
  std::string setting;           ///< whose form was left open
  std::string form;              ///< that is taken
  std::string picked;            ///< the setting that holds its designs: `setting` itself where the first form is taken
  std::string reason;            ///< one sentence
  int n_windows = 0;             ///< held out; 0 where no other form was tried
  int n_steps = 0;               ///< control steps of each
  double nominal_error = 0;      ///< of the un-designed simulator
  std::vector<TriedForm> tried;  ///< the first form first; empty where no other was needed
};

/// The choice where capability decides: what `resolved.form` is, and why.
FormChoice ChooseByCapability(const DesignConfig& resolved, const SimulatorSpec& spec);

/// Whether the first form's answer asks for others to be tried. @param q, fit  of its best seed
bool AsksForOtherForms(const Designer& q, const FitEvidence& fit);

/// The choice where it does not, or where it does and too little can be held out to compare forms.
FormChoice KeepFirstForm(const Designer& q, const FitEvidence& fit);

/// With fewer held-out windows nothing is compared: they come from five stretches of the logs that share nothing.
inline constexpr int kFewestWindows = 25;

/// The form whose simulator is nearest to the held-out windows. Another than the first is taken where it is nearer by
/// kLeastGain, and by two standard errors, so that chance does not decide: the first tells intervals and verdicts too.
/// @param forms   the first form first
/// @param modes   of each form
/// @param errors  of each form, and behind them of the un-designed simulator
FormChoice ChooseByHeldOut(const std::vector<std::string>& forms, const std::vector<std::vector<double>>& modes,
                           const HeldOutErrors& errors);
inline constexpr double kLeastGain = 0.02;  ///< of the logarithm of the error

nlohmann::json ToJson(const FormChoice& choice);
/// @throws nlohmann::json::exception when a member is missing
FormChoice FormChoiceFromJson(const nlohmann::json& record);

}  // namespace oted
