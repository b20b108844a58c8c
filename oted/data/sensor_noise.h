#pragma once
/// Logs as a noisy sensor would have left them, for studies of what noise does.

#include "oted/base/rng.h"
#include "oted/data/dataset.h"

namespace oted {

/// `logs` with Gaussian noise of standard deviation `std` on every observation. There is one reading of each state: s'
/// of a row is s of the next, within an episode. Full states (qpos, qvel) are left out, as they would give the noise
/// away. @throws UsageError unless std is positive and finite
Dataset WithSensorNoise(const Dataset& logs, double std, RngKey key);

}  // namespace oted
