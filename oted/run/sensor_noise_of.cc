#include "oted/run/sensor_noise_of.h"

#include "oted/stages/design/replay/noise_estimate.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

Eigen::VectorXd SensorNoiseOf(const DesignRecord& design, const Dataset& logs) {
  const Eigen::VectorXd scale = ChannelScales(logs);
  if (!design.fit || static_cast<Eigen::Index>(design.fit->channels.size()) != scale.size()) return kNoiseGuess * scale;
  Eigen::VectorXd noise(scale.size());
  for (Eigen::Index c = 0; c < noise.size(); ++c) {
    noise[c] = design.fit->channels[static_cast<size_t>(c)].short_noise_std;
  }
  return noise;
}

}  // namespace oted
