#pragma once
/// How noisy sensors can be at most, as the readings alone tell: no simulator is asked.

#include <Eigen/Dense>

#include "oted/data/dataset.h"

namespace oted {

/// (obs_dim): what each channel's noise does surely not exceed, as a standard deviation. Each reading is held to a
/// cubic through the two before and the two behind it; noise moves them apart by 1.4 times its size, and what a
/// parabola does not follow moves them further. Where polynomials of two and four orders more leave a fifth and less,
/// that was motion, and what these leave counts. The median over the logs, a quarter added, and no less than what a
/// reading's own steps make (QuantisationNoise). Infinite where no episode has five readings.
///
/// A simulator that is wrong leaves more than that, however small the sensors' noise is.
Eigen::VectorXd LargestNoise(const Dataset& logs);

}  // namespace oted
