#pragma once
/// What the logs of a task say about it: how much moves, and what does not fit the model.

#include <optional>
#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/mujoco/model_outline.h"
#include "oted/sim/simulator.h"

namespace oted {

/// 0.0437 -> 0.05: one digit, upwards. Of a positive number.
double RoundedUp(double value);

/// How an observed velocity goes with its position: change of the position per row over the velocity.
struct RateAgreement {
  int velocity = 0, position = 0;  ///< observations
  double rows_s = 0;               ///< least squares: seconds per row, where units agree
  double correlation = 0;
};

/// Of every velocity in the log whose position is there too and that moves.
std::vector<RateAgreement> CompareRates(const Dataset& dataset, const std::vector<int>& rate_of);

/// Seconds per row by positions and velocities: the median, where they agree with each other; 0 otherwise.
double PeriodByRates(const std::vector<RateAgreement>& rates);

/// The log as one that shows `names` would be, velocities of its positions from differences: good enough to see what a
/// parameter does. Nothing where a name is neither there nor such a velocity.
std::optional<Dataset> WithVelocities(const Dataset& dataset, const std::vector<std::string>& has,
                                      const std::vector<std::string>& names, double period_s);

/// What is suspicious, with what to do, a sentence each: units, signs, offsets, joint limits, actions that act later.
/// @param dataset  of the task `factory` is of, with its period
std::vector<std::string> SuspiciousFacts(const SimulatorFactory& factory, const Dataset& dataset,
                                         const ModelOutline& model, int n_threads);

}  // namespace oted
