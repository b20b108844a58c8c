#include "oted/data/field_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace oted::field_text_test {

TEST(ParseNumber, ReadsWhatPeopleWrite) {
  EXPECT_EQ(ParseNumber("1.5"), 1.5);
  EXPECT_EQ(ParseNumber(" \t-2e3 "), -2000.0);
  EXPECT_EQ(ParseNumber("+.25"), 0.25);
  EXPECT_TRUE(std::isnan(ParseNumber("nan").value()));
  EXPECT_EQ(ParseNumber("-inf"), -std::numeric_limits<double>::infinity());
}

TEST(ParseNumber, RefusesWhatIsNoNumber) {
  for (const char* field : {"", "  ", "+", "++1", "1,5", "1.5 m", "0x10", "one", "1e"}) {
    EXPECT_FALSE(ParseNumber(field).has_value()) << field;
  }
}

TEST(ParseNumber, WhatIsTooSmallIsTheNearestDoubleAndWhatIsTooLargeIsRefused) {
  EXPECT_EQ(ParseNumber("1e-400"), 0.0);
  EXPECT_TRUE(std::signbit(ParseNumber("-1e-400").value()));
  EXPECT_EQ(ParseNumber("5e-324"), std::numeric_limits<double>::denorm_min());
  EXPECT_FALSE(ParseNumber("1e400").has_value());
  EXPECT_FALSE(ParseNumber("-1e5000").has_value());
}

}  // namespace oted::field_text_test
