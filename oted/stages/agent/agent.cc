#include "oted/stages/agent/agent.h"

#include <utility>

#include "oted/base/error.h"

namespace oted {

EpisodeParameters DrawModes(std::vector<std::vector<double>> modes) {
  OTED_CHECK(!modes.empty());
  return [modes = std::move(modes)](Rng& rng) { return modes[rng.Below(modes.size())]; };
}

EpisodeParameters DrawSamples(std::vector<Designer> q) {
  OTED_CHECK(!q.empty());
  return [q = std::move(q)](Rng& rng) { return q[rng.Below(q.size())].Draw(rng).z; };
}

}  // namespace oted
