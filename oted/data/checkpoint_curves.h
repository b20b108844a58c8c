#pragma once
/// How far the curves of some work went when its checkpoint was written, kept within the checkpoint: curves that come
/// from an older copy than the checkpoint lack rows, though a mark that was copied with them fits them.

#include <string>

#include "oted/base/log.h"
#include "oted/data/npz.h"

namespace oted {

/// @param run  whose work it is, as in LogSink::Scalar
void KeepCurvesMark(LogSink& log, const std::string& run, NpzArrays& checkpoint);
/// Tells `log` what the checkpoint keeps; of one of an earlier version nothing.
void GoOnWithCurves(LogSink& log, const std::string& run, const NpzArrays& checkpoint);

}  // namespace oted
