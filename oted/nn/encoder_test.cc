#include "oted/nn/encoder.h"

#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::encoder_test {

Array2<double> Rows(const std::vector<std::vector<double>>& list) {
  Array2<double> rows;
  for (const auto& row : list) rows.AppendRow(row);
  return rows;
}

struct Encoded {
  std::vector<float> image, extra;
};

Encoded Encode(const Encoder& encoder, const std::vector<double>& row, float bound = 0) {
  Encoded out;
  if (encoder.has_image()) {
    out.image.resize(static_cast<size_t>(encoder.height() * encoder.width() * encoder.channels()));
  }
  out.extra.resize(static_cast<size_t>(encoder.n_extra()));
  encoder.Encode(row, bound, out.image, out.extra);
  return out;
}

// Two places of two channels (a kind below 4, a quantity), then an index below 3.
InputShape Shape() { return {.image = {1, 2, 2}, .levels = {4, 0, 4, 0, 3}}; }

TEST(Encoder, GivesAKindThatOccursItsOwnChannelAndAllOthersOne) {
  const Encoder encoder(Rows({{0, 1, 2, 3, 0}, {2, 1, 2, 3, 1}}), Shape());
  ASSERT_EQ(encoder.channels(), 4);  // kind 0, kind 2, any other kind, the quantity
  ASSERT_EQ(encoder.n_extra(), 3);
  const Encoded known = Encode(encoder, {0, 2, 2, 2, 1});
  EXPECT_EQ(known.image, (std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0}));  // 2 is the quantity's mean over all places
  EXPECT_EQ(known.extra, (std::vector<float>{0, 1, 0}));
  const Encoded strange = Encode(encoder, {3, 2, -1, 3, 7});
  const std::vector<float> wanted = {0, 0, 1, 0, 0, 0, 1, 1};  // 3 is one spread above the mean
  for (size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(strange.image[i], wanted[i], 1e-5) << i;
  EXPECT_EQ(strange.extra, (std::vector<float>{0, 0, 0}));
}

TEST(Encoder, AChannelThatNeverChangesSaysOnlyWhenItDoes) {
  const Encoder encoder(Rows({{1, 0, 1, 2, 0}, {1, 4, 1, 6, 0}}), Shape());
  ASSERT_EQ(encoder.channels(), 2);
  EXPECT_EQ(Encode(encoder, {1, 3, 1, 3, 0}).image, (std::vector<float>{0, 0, 0, 0}));
  EXPECT_EQ(Encode(encoder, {2, 3, 1, 3, 0}).image, (std::vector<float>{1, 0, 0, 0}));
}

TEST(Encoder, WithoutAnImageItIsTheNormaliser) {
  const Array2<double> rows = Rows({{0, 10}, {2, 30}});
  const Encoder encoder(rows, {});
  EXPECT_FALSE(encoder.has_image());
  EXPECT_EQ(Encode(encoder, {2, 10}).extra, (std::vector<float>{1, -1}));
  EXPECT_EQ(Encode(encoder, {200, 10}, 10).extra, (std::vector<float>{10, -1}));
}

TEST(Encoder, AFileGivesItBackAndADamagedOneIsNamed) {
  const Encoder encoder(Rows({{0, 1, 2, 3, 0}, {2, 1, 2, 3, 1}}), Shape());
  NpzArrays arrays;
  encoder.Save("o", arrays);
  const Encoder read = Encoder::Load("o", ParseNpz(NpzBytes(arrays), "memory"), "memory");
  const std::vector<double> row = {3, 1, 2, 0, 2};
  EXPECT_EQ(Encode(read, row).image, Encode(encoder, row).image);
  EXPECT_EQ(Encode(read, row).extra, Encode(encoder, row).extra);
  for (const char* name : {"o/mean", "o/scale", "o/occurs", "o/image"}) {
    NpzArrays damaged = arrays;
    damaged[name] = NpyArray(std::vector<double>{1e9});
    EXPECT_NE(MessageOf<DataError>([&] { Encoder::Load("o", damaged, "p.npz"); }).find("p.npz"), std::string::npos);
  }
  EXPECT_THROW(Encoder(Rows({{0, 1}}), Shape()), DataError);
}

}  // namespace oted::encoder_test
