#pragma once
/// Ctrl-C, SIGTERM, a terminal that goes away and a limit of processor time.

#include <atomic>

namespace oted::cli {

/// Set by Ctrl-C; a second one ends the program at once.
extern std::atomic<bool> g_stop;
void InstallStopHandler();
/// For a command that waits for child programs: they have a grace of their own, so this program ends by itself.
void WaitForChildrenOnStop();

}  // namespace oted::cli
