#pragma once
/// What a network, a batch and a set of simulators may measure. More is refused when settings are read: the system
/// would end the program for want of memory, without a word.

#include "oted/base/fields.h"

namespace oted {

inline Range LayerWidths() { return Between(1, 16'384); }
inline Range BatchSizes() { return Between(1, 1'000'000); }
inline Range LaneCounts() { return Between(1, 10'000); }
inline Range EpisodeCounts() { return Between(1, 10'000); }

}  // namespace oted
