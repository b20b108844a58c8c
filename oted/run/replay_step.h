#pragma once
/// What the report shows of the design at work: logs replayed in the nominal and in the designed simulator, as curves
/// and, where there is an OpenGL context, as pictures. Nothing else depends on it.

#include "oted/run/design_record.h"
#include "oted/run/run_setup.h"

namespace oted {

/// motion/: replay.json, and motion.json with the films that it names.
void ReplayLogs(const RunSetup& run, const DesignRecord& design);

/// @throws UsageError when report.motion asks for pictures and none can be drawn
void CheckCanDraw(const RunConfig& config, const SimulatorFactory& factory);

}  // namespace oted
