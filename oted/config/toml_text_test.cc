#include "oted/config/toml_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::toml_text_test {

using testing::HasSubstr;

TEST(CheckTomlCharacters, TakesAnyCharacterInStringsAndComments) {
  for (const char* text :
       {"", "a = 1\n", "\xEF\xBB\xBF# mit Bytefolgemarke\na = 1", "a = 1  # größe [µm] \"offen\n b = 2",
        "\"größe\" = 'µ\\'", "a = \"\\\"größe\"\nb = 'é'", "a = \"\"\"zwei\nZeilen: é \"\" und \\\"\"\"\"\"\nb = 1",
        "a = '''é'\n''é'''\nb = ['ß', \"ü\"]", "a = \"\"  # é\nb = ''  # é"}) {
    EXPECT_NO_THROW(CheckTomlCharacters(text, "run.toml")) << text;
  }
}

TEST(CheckTomlCharacters, ACharacterBeyondAsciiElsewhereNamesItsLine) {
  for (const char* text : {"\ngröße = 1", "\na = é", "\n[t\xC3\xA9]", "a = \"\"\"\n\"\"\"é", "a = 'x\né", "#\n\xFF"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { CheckTomlCharacters(text, "run.toml"); }), HasSubstr("run.toml:2:"))
        << text;
  }
}

TEST(CheckTomlCharacters, ANameOfVeryManyPartsIsRefusedBeforeTheParserDescendsIntoIt) {
  std::string parts;
  for (int i = 0; i < 200000; ++i) parts += "a.";
  for (const std::string& text : {"[" + parts + "a]\n", "x = {" + parts + "a = 1}", parts + "a = 1"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { CheckTomlCharacters(text, "run.toml"); }), HasSubstr("run.toml:1: a name"));
  }
  std::string numbers = "x = [";
  for (int i = 0; i < 1000; ++i) numbers += "1.5, ";
  EXPECT_NO_THROW(CheckTomlCharacters(numbers + "2.5]\na.b.c = 1", "run.toml"));
}

TEST(CheckTomlCharacters, StringsThatDoNotEndAreLeftToTheParser) {
  for (const char* text : {"a = \"é", "a = \"é\\", "a = '''é", "\"\"\"", "'"}) {
    EXPECT_NO_THROW(CheckTomlCharacters(text, "run.toml")) << text;
  }
}

}  // namespace oted::toml_text_test
