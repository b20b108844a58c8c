#pragma once
/// Of suspects that were freed (freed.h), which one to take. Not in the paper.

#include <vector>

#include "oted/matching/fit_evidence.h"

namespace oted {

/// Of those that are kept, the first that no other surely leads (FreedTrial::led_by); null where none is kept. They
/// stand in the order of the windows that named them, which are more.
const Suspect* BestFreed(const std::vector<Suspect>& suspects);

/// The others that are kept and that the best one does not surely lead. Which of them is off, the logs do not say.
std::vector<const Suspect*> RivalsOfBest(const std::vector<Suspect>& suspects);

}  // namespace oted
