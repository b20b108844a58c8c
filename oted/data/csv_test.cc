#include "oted/data/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/gzip.h"

namespace oted::csv_test {

using testing::ElementsAre;
using testing::HasSubstr;
using Records = std::vector<std::vector<std::string>>;

Records Parse(const std::string& text) {
  CsvParser parser(text, "a.csv");
  Records records;
  std::vector<std::string> fields;
  while (parser.Next(fields)) records.push_back(fields);
  return records;
}

TEST(Csv, ReadsQuotesLineEndsAndAByteOrderMark) {
  const Records expected = {{"a", "b,c", ""}, {"1", "say \"x\"", "two\nlines"}};
  EXPECT_EQ(Parse("\xEF\xBB\xBF"
                  "a,\"b,c\",\r\n\r\n1,\"say \"\"x\"\"\",\"two\nlines\"\n"),
            expected);
  EXPECT_EQ(Parse("a,\"b,c\",\r1,\"say \"\"x\"\"\",\"two\nlines\""), expected);
  EXPECT_TRUE(Parse("").empty());
  EXPECT_TRUE(Parse("\n\r\n").empty());
}

TEST(Csv, LinesAreTheFilesOwn) {
  const std::string text = "a\n\n\"x\ny\"\nz\n";
  CsvParser parser(text, "a.csv");
  std::vector<std::string> fields;
  std::vector<int64_t> lines;
  while (parser.Next(fields)) lines.push_back(parser.line());
  EXPECT_THAT(lines, ElementsAre(1, 3, 5));
}

TEST(Csv, DefectsNameFileAndLine) {
  const auto message = [](const std::string& text) { return MessageOf<DataError>([&] { Parse(text); }); };
  EXPECT_THAT(message("a\n\"b\n"), HasSubstr("'a.csv' line 2: a quote is never closed"));
  EXPECT_THAT(message("a\nb\"c\n"), HasSubstr("'a.csv' line 2: a quote in the middle"));
  EXPECT_THAT(message("a\n\"b\"c\n"), HasSubstr("'a.csv' line 2: text behind a closing quote"));
  EXPECT_THAT(message("\xFF\xFE"
                      "a"),
              HasSubstr("UTF-16"));
  EXPECT_THAT(message(std::string("a\0b", 3)), HasSubstr("binary"));
}

TEST(Csv, AFieldThatIsWrittenIsReadBack) {
  for (const std::string field : {"plain", "a,b", "\"", "x\r\ny", ""}) {
    EXPECT_EQ(Parse("first," + CsvField(field) + "\n"), (Records{{"first", field}}));
  }
}

TEST(Gzip, GivesBackItsBytesAndPythonReadsThem) {
  const TestFolder folder;
  std::string text;
  for (int i = 0; i < 300000; ++i) text += std::to_string(i * 79 % 1000);
  WriteFileAtomically(folder / "ours.gz", Gzip(text));
  EXPECT_EQ(Gunzip(Gzip(text), "a"), text);
  EXPECT_EQ(Gunzip(Gzip(""), "a"), "");
  EXPECT_EQ(Gunzip(Gzip("one") + Gzip("two"), "a"), "onetwo");
  EXPECT_TRUE(
      RunPython("import gzip\nassert len(gzip.open('ours.gz').read()) == " + std::to_string(text.size()), folder));
  const std::string whole = Gzip(text);
  for (const size_t size : {size_t{2}, size_t{12}, whole.size() / 2, whole.size() - 1}) {
    EXPECT_THAT(MessageOf<DataError>([&] { Gunzip(whole.substr(0, size), "a.csv.gz"); }), HasSubstr("'a.csv.gz'"));
  }
}

TEST(Gzip, GivesBackItsBytesHoweverWellTheyDeflate) {
  const TestFolder folder;
  for (const bool begins_with_noise : {false, true}) {
    std::string text(size_t{100} << 20, '0');
    std::mt19937 random(1);
    for (size_t i = 0; begins_with_noise && i < size_t{1} << 20; ++i) text[i] = static_cast<char>(random());
    const std::string packed = Gzip(text);
    EXPECT_LT(packed.size(), size_t{8} << 20);
    EXPECT_EQ(Gunzip(packed, "a"), text);
    WriteFileAtomically(folder / "ours.gz", packed);
    EXPECT_TRUE(
        RunPython("import gzip\nassert len(gzip.open('ours.gz').read()) == " + std::to_string(text.size()), folder));
  }
}

}  // namespace oted::csv_test
