#include "oted/baselines/domain_randomization.h"

namespace oted {

EpisodeParameters DrawUniformly(const ParameterSpace& space) {
  return [space](Rng& rng) { return space.SampleUniform(rng); };
}

std::vector<std::vector<double>> UniformDraws(const ParameterSpace& space, int n, RngKey key) {
  std::vector<std::vector<double>> draws;
  for (int k = 0; k < n; ++k) {
    Rng rng = key.Index(static_cast<uint64_t>(k)).MakeRng();
    draws.push_back(space.SampleUniform(rng));
  }
  return draws;
}

}  // namespace oted
