#include "oted/data/time_column.h"

#include <gtest/gtest.h>

namespace oted::time_column_test {

TEST(UnitsPerSecond, AreToldByTheEndOfTheName) {
  for (const char* name : {"t_ms", "time [ms]", "stampMs", "Timestamp (msec)"}) EXPECT_EQ(UnitsPerSecond(name), 1e3);
  EXPECT_EQ(UnitsPerSecond("stamp_us"), 1e6);
  EXPECT_EQ(UnitsPerSecond("header.stamp.nsec"), 1e9);
  for (const char* name : {"time", "t", "time_s", "ms", "motors", "status"}) EXPECT_EQ(UnitsPerSecond(name), 1) << name;
}

TEST(FindTimeColumn, SecondsComeBeforeOtherUnits) {
  EXPECT_EQ(FindTimeColumn({"hip", "t_ms", "Time"}), 2);
  EXPECT_EQ(FindTimeColumn({"hip", "t_ms"}), 1);
  EXPECT_EQ(FindTimeColumn({"hip", "time [us]"}), 1);
  EXPECT_EQ(FindTimeColumn({"hip", "temperature_ms", "offset_ms"}), -1);
  EXPECT_EQ(FindTimeColumn({}), -1);
}

}  // namespace oted::time_column_test
