#include "oted/report/html_text.h"

#include <gtest/gtest.h>

#include <string>

#include "oted/report/figure.h"

namespace oted::html_text_test {

TEST(EscapeTest, LeavesNoCharacterThatMarkupIsMadeOf) {
  EXPECT_EQ(Escape("<b a='1' c=\"2\">&</b>"), "&lt;b a=&#39;1&#39; c=&quot;2&quot;&gt;&amp;&lt;/b&gt;");
  EXPECT_EQ(Escape("größer, 6 × 7"), "größer, 6 × 7");
}

TEST(FormatTest, NumbersShowThreeSignificantDigits) {
  EXPECT_EQ(FormatNumber(0.031249), "0.0312");
  EXPECT_EQ(FormatNumber(1.2345), "1.23");
  EXPECT_EQ(FormatNumber(48.06), "48.1");
  EXPECT_EQ(FormatNumber(612.8), "613");
  EXPECT_EQ(FormatNumber(1234567.4), "1,234,567");
  EXPECT_EQ(FormatNumber(-1234.5), "\u22121,234");
  EXPECT_EQ(FormatNumber(0), "0");
  EXPECT_EQ(FormatNumber(3e-7), "3.00e-07");
  EXPECT_EQ(FormatNumber(std::nullopt), "–");
}

TEST(FormatTest, AValueHasTheDecimalsOfItsSpread) {
  EXPECT_EQ(FormatSpread(0.98123, 0.0521), "0.981\u00a0±\u00a00.052");
  EXPECT_EQ(FormatSpread(1731.52, 93.21), "1,732\u00a0±\u00a093");
  EXPECT_EQ(FormatSpread(18.24, 9.14), "18.2\u00a0±\u00a09.1");
  EXPECT_EQ(FormatSpread(0.5, std::nullopt), "0.500");
  EXPECT_EQ(FormatAtScale(-0.0001, 0.05), "0.000") << "no minus before a zero";
}

TEST(FormatTest, GivenNumbersAreNotPadded) {
  EXPECT_EQ(FormatGiven(1.0), "1");
  EXPECT_EQ(FormatGiven(0.6), "0.6");
  EXPECT_EQ(FormatGiven(-9.81), "\u22129.81");
  EXPECT_EQ(FormatScore(-0.0281), "\u22120.028");
  EXPECT_EQ(FormatPoints(0), "0.0");
  EXPECT_EQ(UnitHtml("x nominal"), " <small>× nominal</small>");
  EXPECT_EQ(UnitHtml("<i>"), " <small>&lt;i&gt;</small>");
  EXPECT_EQ(UnitHtml(""), "");
}

TEST(FigureTest, NoTextCanLeaveTheScriptElement) {
  Figure figure("title");
  figure.AddCurve({{0, 1}, {1, 2}}, "</script><script>alert(1)</script><!--", {.color = "var:--designed"});
  const std::string html = figure.Html();
  const size_t begin = html.find("application/json\">") + 18;
  const std::string spec = html.substr(begin, html.rfind("</script>") - begin);
  EXPECT_EQ(spec.find('<'), std::string::npos) << spec;
  // What plotly.js then reads has its tags escaped.
  EXPECT_EQ(nlohmann::json::parse(spec)["data"][0]["name"],
            "&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt;&lt;!--");
}

TEST(FigureTest, TheBandIsMeanPlusAndMinusSpread) {
  Figure figure("title");
  figure.AddBand({{0, 1.0}, {5, 2.0}}, {{0, 0.5}, {5, 0.25}}, "var:--band");
  const std::string html = figure.Html();
  const size_t begin = html.find("application/json\">") + 18;
  const auto trace = nlohmann::json::parse(html.substr(begin, html.rfind("</script>") - begin))["data"][0];
  EXPECT_EQ(trace["x"], (nlohmann::json{0, 5, 5, 0}));
  EXPECT_EQ(trace["y"], (nlohmann::json{1.5, 2.25, 1.75, 0.5}));
}

TEST(FigureTest, NothingToPlotGivesNoFigure) {
  Figure figure("title");
  figure.AddCurve(nlohmann::json::array(), "empty", {.color = "var:--designed"});
  figure.AddLevel(1, "level", {.color = "var:--truth"});
  EXPECT_EQ(figure.Html(), "");
}

}  // namespace oted::html_text_test
