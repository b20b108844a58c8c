#pragma once
/// design.method = "auto": which method of the design, by evidence, and why (docs/design_methods.md#auto).

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/matching/designer.h"
#include "oted/matching/held_out_prediction.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/replay/held_out_replay.h"

namespace oted {

/// Of the table (design_method.h), the methods that auto tries where the answer of its first, `trajectories`, does not
/// surely predict better than the nominal simulator: what is likeliest need not be the best where none is right. The
/// paper's own method is not among them: from a clone's rollouts it came nowhere near, in more time
/// (docs/design_methods.md#auto).
std::vector<DesignMethod> OtherMethods();

/// What a method, learning from part of the logs, made of the rest.
struct TriedMethod {
  DesignMethod method = DesignMethod::kTrajectories;
  std::vector<double> mode;  ///< z
  double error = 0;          ///< geometric mean over the held-out windows, in units of HeldOutErrors
  double gain = 0;           ///< over the first method: mean log ratio of the windows' errors; positive where nearer
  double gain_std = 0;       ///< standard error of the gain
};

struct MethodChoice {
  std::string setting;                                ///< whose method was left open
  DesignMethod method = DesignMethod::kTrajectories;  ///< that is taken
  std::string picked;        ///< the setting that holds its designs: `setting` itself where the first method is taken
  std::string reason;        ///< one sentence
  int n_windows = 0;         ///< held out; 0 where no other method was tried
  int n_steps = 0;           ///< control steps of each
  double nominal_error = 0;  ///< of the nominal simulator
  std::vector<TriedMethod> tried;  ///< the first method first; empty where no other was needed
};

/// The choice where capability decides: `method`, and why.
MethodChoice ChooseByCapability(DesignMethod method, const SimulatorSpec& spec);

/// Whether the first method's answer asks for others to be tried: it leaves more than the sensors explain, and does not
/// surely predict better than the nominal simulator.
/// @param prediction  of its best seed
bool AsksForOtherMethods(const std::optional<HeldOutPrediction>& prediction);

/// The choice where it does not, or where it does and too little can be held out to compare methods.
MethodChoice KeepFirstMethod(const std::optional<HeldOutPrediction>& prediction);

/// With fewer held-out windows nothing is compared: they come from five stretches of the logs that share nothing.
inline constexpr int kFewestWindows = 25;

/// The method whose simulator is nearest to the held-out windows. Another than the first is taken where it is nearer by
/// kLeastGain, and by two standard errors, so that chance does not decide: the first tells intervals and verdicts too.
/// @param methods   the first method first
/// @param modes   of each method
/// @param errors  of each method, and behind them of the nominal simulator
MethodChoice ChooseByHeldOut(const std::vector<DesignMethod>& methods, const std::vector<std::vector<double>>& modes,
                             const HeldOutErrors& errors);
inline constexpr double kLeastGain = 0.02;  ///< of the logarithm of the error

nlohmann::json ToJson(const MethodChoice& choice);
/// @throws nlohmann::json::exception when a member is missing
MethodChoice MethodChoiceFromJson(const nlohmann::json& record);

}  // namespace oted
