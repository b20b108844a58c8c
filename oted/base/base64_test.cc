#include "oted/base/base64.h"

#include <gtest/gtest.h>

namespace oted::base64_test {

// RFC 4648, section 10.
TEST(Base64Test, GivesTheTestVectorsOfItsStandard) {
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foo"), "Zm9v");
  EXPECT_EQ(Base64("foob"), "Zm9vYg==");
  EXPECT_EQ(Base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
}

TEST(Base64Test, TakesAnyByte) { EXPECT_EQ(Base64(std::string_view("\0\xff\xfe\0", 4)), "AP/+AA=="); }

}  // namespace oted::base64_test
