#include "oted/report/live_page.h"

#include <gmock/gmock.h>

namespace oted {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(LivePage, IsReadAnewLoadsNothingAndShowsTextAsText) {
  LivePage page{.title = "<plan>", .headline = "1 of 2 done", .refresh_s = 7};
  page.parts = {{"done", 0.5}};
  page.tables = {{"Failed", {"unit", "why"}, {{"a&b", "<script>"}}}, {"Empty", {"unit"}, {}}};
  const std::string html = page.Html();
  EXPECT_THAT(html, HasSubstr("http-equiv=\"refresh\" content=\"7\""));
  EXPECT_THAT(html, HasSubstr("width:50.000%"));
  EXPECT_THAT(html, HasSubstr("a&amp;b"));
  EXPECT_THAT(html, HasSubstr("&lt;plan&gt;"));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("Empty")));
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
}

}  // namespace
}  // namespace oted
