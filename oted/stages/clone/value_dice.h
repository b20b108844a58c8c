#pragma once
/// ValueDICE (Kostrikov, Nachum and Tompson 2020), the paper's other way to clone: mu-hat by matching distributions.

#include <string>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/stages/clone/clone.h"

namespace oted {

/// Behavioural cloning asks for the logged action at every logged state; ValueDICE for a policy whose own state-action
/// distribution is the logs', where its errors add up as well. Here it is offline: a max-min over policy and critic
/// (ValueDiceUpdate) on logged rows alone. The clone begins as the behavioural one, or from random weights, and the
/// critic learns against it for kWarmUp updates before it moves. The last policy is kept. Rows are held out as in
/// behavioural cloning, and tell nothing but the loss that is reported.
/// @throws DataError when `dataset` does not fit `spec`; Interrupted: a stopped fit begins anew
CloneResult CloneByValueDice(const CloneJob& job);

}  // namespace oted
