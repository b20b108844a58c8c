#pragma once
/// The sensors' noise, as a finished design tells it.

#include <Eigen/Dense>

#include "oted/data/dataset.h"
#include "oted/run/design_record.h"

namespace oted {

/// (obs_dim): the standard deviation of each channel's noise as the design's fit told it; where none did, a hundredth
/// of the channel's spread over the logs.
Eigen::VectorXd SensorNoiseOf(const DesignRecord& design, const Dataset& logs);

}  // namespace oted
