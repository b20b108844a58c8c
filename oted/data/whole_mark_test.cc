#include "oted/data/whole_mark.h"

#include <gtest/gtest.h>

namespace oted::whole_mark_test {

TEST(WholeMark, FitsWhatBeginsWithItsBytesAndNothingElse) {
  const std::string text = "step,key,value\n1,a,0.5\n";
  const WholeMark mark{text.size(), Checksum(0, text)};
  EXPECT_TRUE(mark.Fits(text));
  EXPECT_TRUE(mark.Fits(text + "2,a,")) << "what lies behind is not its matter";
  EXPECT_FALSE(mark.Fits(text.substr(1)));
  for (size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] ^= 4;
    EXPECT_FALSE(mark.Fits(damaged)) << i;
  }
}

TEST(WholeMark, ChecksumsGoOn) {
  EXPECT_EQ(Checksum(Checksum(0, "12345"), "6789"), 0xCBF43926u) << "CRC-32's own check";
}

TEST(WholeMark, ItsTextIsReadAgainAndNoOther) {
  const WholeMark mark{538, 0x3cbca112};
  EXPECT_EQ(mark.ToText(), "000000000000021a 3cbca112\n");
  const auto read = WholeMark::FromText(mark.ToText());
  ASSERT_TRUE(read);
  EXPECT_EQ(read->size, 538u);
  EXPECT_EQ(read->checksum, 0x3cbca112u);
  EXPECT_FALSE(WholeMark::FromText(""));
  EXPECT_FALSE(WholeMark::FromText("000000000000021a 3cbca11\n"));
  EXPECT_FALSE(WholeMark::FromText("x00000000000021a 3cbca112\n"));
}

}  // namespace oted::whole_mark_test
