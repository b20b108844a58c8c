#pragma once
/// Which process a number stands for: numbers are given again.

#include <cstdint>
#include <optional>

namespace oted {

/// When a process began, in ticks of the machine's clock since it was started: the same number with another start is
/// another process. 0 of one that has ended and whose parent has not looked yet; none where there is no such process,
/// or where the system does not tell.
std::optional<uint64_t> ProcessStart(int pid);

}  // namespace oted
