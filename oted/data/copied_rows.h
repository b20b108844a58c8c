#pragma once
/// Rows that were logged once and stand in a dataset twice: a file given twice, another export of it, pieces that
/// overlap. A copy tells nothing new, and what is kept aside is not unseen where its copy was learned from.

#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// Rows [begin, end) of one episode, which an earlier episode has as well, from row `original` on.
struct CopiedStretch {
  int begin = 0, end = 0, original = 0;
  bool operator==(const CopiedStretch&) const = default;
};

/// Stretches of twenty rows or more (or a shorter episode whole, of five or more) in which the robot moves and every
/// observation and action differs from an earlier episode's by at most a twentieth of the channel's own noise from row
/// to row: what rounding changes, and what no second recording of the same motion can repeat. In the order of the rows;
/// none overlap. Flat observations and continuous actions only.
std::vector<CopiedStretch> FindCopiedStretches(const Dataset& dataset);

/// The dataset without them, and a warning that says how many rows are gone. What is left of an episode on either side
/// of a stretch is an episode of its own; a single row is left out, too.
Dataset WithoutCopies(Dataset dataset);

}  // namespace oted
