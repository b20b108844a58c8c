#include "oted/data/sensor_noise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"

namespace oted {

Dataset WithSensorNoise(const Dataset& logs, double std, RngKey key) {
  if (!(std > 0) || !std::isfinite(std)) {
    throw UsageError(fmt::format("sensor noise of standard deviation {:g}: wanted a positive number", std));
  }
  Dataset noisy = logs;
  noisy.qpos = noisy.qvel = {};
  noisy.path = noisy.sha256 = "";
  const std::vector<Episode> episodes = logs.Episodes();
  for (size_t e = 0; e < episodes.size(); ++e) {
    Rng rng = key.Index(e).MakeRng();
    for (int i = episodes[e].begin; i < episodes[e].end; ++i) {
      const auto reading = noisy.observations.row(i), next = noisy.next_observations.row(i);
      if (i > episodes[e].begin) {
        std::ranges::copy(noisy.next_observations.row(i - 1), reading.begin());
      } else {
        for (double& value : reading) value += std * rng.Normal();
      }
      for (double& value : next) value += std * rng.Normal();
    }
  }
  return noisy;
}

}  // namespace oted
