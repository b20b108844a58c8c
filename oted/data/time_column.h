#pragma once
/// Which column of a table holds its times, and in what unit.

#include <string>
#include <string_view>
#include <vector>

namespace oted {

/// So many of a time column's units make a second: 1000 for "t_ms", "time [ms]" and "stampMs"; 1 where the end of its
/// name tells no other unit than seconds.
double UnitsPerSecond(std::string_view column);

/// The column that is times by its name: "time", "time_s", "time [s]", "t" or "timestamp", else one of these words with
/// another unit, such as "t_ms"; -1 where none is.
int FindTimeColumn(const std::vector<std::string>& header);

}  // namespace oted
