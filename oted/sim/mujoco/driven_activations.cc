#include "oted/sim/mujoco/driven_activations.h"

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

constexpr double kTimeConstants = 4.6;  // exp(-4.6) is a hundredth
constexpr double kNothing = 1e-17;      // beside 1, for doubles

/// What is left of the way to a constant command after one time step (mj_nextActivation).
double LeftAfterStep(const mjModel& model, int actuator, double time_constant) {
  const double x = model.opt.timestep / std::max(mjMINVAL, time_constant);
  // mj_RungeKutta averages the activation's rate over its four stages, Euler takes that of the first.
  const double rate = model.opt.integrator == mjINT_RK4 ? 1 - x / 2 + x * x / 6 - x * x * x / 24 : 1;
  const bool is_exact = model.actuator_dyntype[actuator] == mjDYN_FILTEREXACT;
  return 1 - rate * (is_exact ? 1 - std::exp(-x) : x);
}

}  // namespace

std::vector<DrivenActivation> DrivenActivations(const mjModel& model, const std::vector<int>& controls,
                                                const std::function<bool(int act)>& is_seen) {
  std::vector<DrivenActivation> driven;
  for (int actuator = 0; actuator < model.nactuator; ++actuator) {
    const int type = model.actuator_dyntype[actuator], act = model.actuator_actadr[actuator];
    if ((type != mjDYN_FILTER && type != mjDYN_FILTEREXACT) || act < 0) continue;
    if (model.actuator_actnum[actuator] != 1 || model.actuator_ctrlnum[actuator] != 1 || is_seen(act)) continue;
    const auto control = std::ranges::find(controls, model.actuator_ctrladr[actuator]);
    if (control == controls.end()) continue;
    driven.push_back({act, actuator, static_cast<int>(control - controls.begin())});
  }
  return driven;
}

int StepsToForget(const mjModel& model, const std::vector<DrivenActivation>& driven,
                  const std::vector<ModelField>& fields, const std::vector<ParameterSpec>& specs, double period_s) {
  double slowest = 0;
  for (const DrivenActivation& d : driven) {
    const int entry = mjNDYN * d.actuator;
    double time_constant = model.actuator_dynprm[entry];
    for (const ModelField& field : fields) {
      if (field.array != "actuator_dynprm" || std::ranges::find(field.indices, entry) == field.indices.end()) continue;
      const ParameterSpec& spec = specs[field.parameter];
      time_constant = spec.high * (spec.IsMultiple() ? time_constant : 1);
    }
    slowest = std::max(slowest, time_constant);
  }
  return static_cast<int>(std::ceil(kTimeConstants * slowest / period_s));
}

double ActivationAfter(const mjModel& model, const DrivenActivation& driven, double time_constant, double act,
                       const Commands& commands) {
  const double left = std::pow(LeftAfterStep(model, driven.actuator, time_constant), commands.n_steps);
  const int n_rows = static_cast<int>(commands.actions.size()) / commands.act_dim;
  const int control = model.actuator_ctrladr[driven.actuator];
  const auto clamped = [](double value, bool limited, const mjtNum* range) {
    return limited ? std::clamp(value, range[0], range[1]) : value;
  };
  int n_felt = n_rows;
  if (left > 0 && left < 1) n_felt = std::min<int>(n_rows, static_cast<int>(std::log(kNothing) / std::log(left)) + 1);
  for (int row = n_rows - n_felt; row < n_rows; ++row) {
    const double command = clamped(commands.actions[static_cast<size_t>(row * commands.act_dim + driven.action)],
                                   model.actuator_ctrllimited[control] && !(model.opt.disableflags & mjDSBL_CLAMPCTRL),
                                   model.actuator_ctrlrange + 2 * control);
    act = clamped(command + (act - command) * left, model.actuator_actlimited[driven.actuator],
                  model.actuator_actrange + 2 * driven.actuator);
  }
  return act;
}

}  // namespace oted
