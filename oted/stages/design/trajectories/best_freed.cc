#include "oted/stages/design/trajectories/best_freed.h"

#include <algorithm>

namespace oted {
namespace {

std::vector<const Suspect*> Kept(const std::vector<Suspect>& suspects) {
  std::vector<const Suspect*> kept;
  for (const Suspect& suspect : suspects) {
    if (suspect.trial && suspect.trial->kept) kept.push_back(&suspect);
  }
  return kept;
}

/// Of two that were tried.
bool IsLedBy(const Suspect& one, const Suspect& other) {
  return std::ranges::count(one.trial->led_by, other.spec.name) > 0;
}

}  // namespace

const Suspect* BestFreed(const std::vector<Suspect>& suspects) {
  const std::vector<const Suspect*> kept = Kept(suspects);
  const auto is_led = [&](const Suspect* one) {
    return std::ranges::any_of(kept, [&](const Suspect* other) { return IsLedBy(*one, *other); });
  };
  if (kept.empty()) return nullptr;
  const auto best = std::ranges::find_if_not(kept, is_led);
  return best == kept.end() ? kept.front() : *best;  // gains and nats may lead in a circle
}

std::vector<const Suspect*> RivalsOfBest(const std::vector<Suspect>& suspects) {
  const Suspect* best = BestFreed(suspects);
  std::vector<const Suspect*> rivals = Kept(suspects);
  std::erase_if(rivals, [&](const Suspect* one) { return one == best || IsLedBy(*one, *best); });
  return rivals;
}

}  // namespace oted
