#include "oted/base/error.h"

#include <gtest/gtest.h>

#include <string>

namespace oted::error_test {

TEST(Printable, KeepsTextOfAnyLanguage) {
  const std::string text = "'größe/模型.xml': 3 µm ≠ 4 𝛼";
  EXPECT_EQ(Printable(text), text);
  EXPECT_EQ(Printable(""), "");
}

TEST(Printable, IsOneLineWithoutControlCharacters) {
  EXPECT_EQ(Printable("dtype '<\ni8'\r\n"), "dtype '< i8'  ");
  EXPECT_EQ(Printable(std::string("a\0b\x1b[31mc\x7f\td", 12)), "a?b?[31mc??d");
  EXPECT_EQ(Printable("a\u0085b\u009fc"), "a?b?c") << "the control characters beyond ASCII";
}

TEST(Printable, IsValidUtf8) {
  EXPECT_EQ(Printable("a\xff\xfe"
                      "b"),
            "a??b");
  EXPECT_EQ(Printable("cut \xe6\xa8"), "cut ??");
  EXPECT_EQ(Printable("\xc0\xaf"), "??") << "an overlong '/'";
  EXPECT_EQ(Printable("\xed\xa0\x80"), "???") << "a surrogate";
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "????") << "beyond U+10FFFF";
  EXPECT_EQ(Printable("\xf5"
                      "abc"),
            "?abc");
}

TEST(Printable, LeavesOutTheMiddleOfMoreThanFourThousandBytes) {
  EXPECT_EQ(Printable(std::string(4000, 'x')), std::string(4000, 'x'));
  EXPECT_EQ(Printable(std::string(1'000'000, 'x') + "; shorten it"),
            std::string(3000, 'x') + " ... " + std::string(988, 'x') + "; shorten it");
  std::string letters;
  for (int i = 0; i < 4001; ++i) letters += "µ";
  letters += "!";
  EXPECT_EQ(Printable(Printable(letters) + letters).find('?'), std::string::npos) << "no half of a letter stays";
}

TEST(Error, SaysWhatADamagedFileHoldsInOneLine) {
  EXPECT_STREQ(DataError("array 'a' has dtype '<\n\x01i8'").what(), "array 'a' has dtype '< ?i8'");
}

}  // namespace oted::error_test
