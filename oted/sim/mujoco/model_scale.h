#pragma once
/// How large numbers of a model may be thought to be.

struct mjModel_;

namespace oted {

/// The next of 1, 2, 5, 10, ... that is not below: bounds that a person reads.
double RoundBound(double value);

/// [N m] what holds a mean body at the model's length against gravity.
double HoldingTorque(const mjModel_& model);

/// [N, or N m where a length is an angle] what holds a mean body by a tendon against gravity: of the model's tendons
/// the one that it takes most. 0 without a tendon.
double HoldingTension(const mjModel_& model);

}  // namespace oted
