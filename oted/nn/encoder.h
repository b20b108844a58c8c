#pragma once
/// Observations, and what joins them, as a network takes them: quantities normalised, indices as one-hot numbers, an
/// image apart from the rest.

#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/normalizer.h"
#include "oted/data/npz.h"

namespace oted {

/// What the numbers of a row are.
struct InputShape {
  std::vector<int> image;   ///< (height, width, channels) of the leading numbers; empty: no image
  std::vector<int> levels;  ///< per number: n for an index 0, ..., n - 1, 0 for a quantity; empty: quantities all

  int image_size() const { return image.empty() ? 0 : image[0] * image[1] * image[2]; }
  /// The same with more numbers behind. Where `levels` is empty it is filled up to `n_before` first.
  InputShape With(int n_before, const std::vector<int>& more) const;
};

/// Fitted on rows. A channel of indices becomes one number for each index that occurs in those rows, and one for any
/// other index: what never occurs costs nothing, and what is new is seen as such. An index outside of the image is one
/// number per level.
class Encoder {
 public:
  Encoder() = default;
  /// @param rows (n, d), n >= 1. @throws DataError when the shape does not fit d
  Encoder(const Array2<double>& rows, InputShape shape);

  int in() const { return in_; }
  bool has_image() const { return !shape_.image.empty(); }
  int height() const { return shape_.image[0]; }
  int width() const { return shape_.image[1]; }
  int channels() const { return channels_; }  ///< of the encoded image
  int n_extra() const { return n_extra_; }    ///< numbers beside the image
  const Normalizer& normalizer() const { return normalizer_; }
  const InputShape& shape() const { return shape_; }
  /// The encoded channel that is 1 where channel `c` of the image holds `index`, or, for -1, any number without a
  /// channel of its own; -1: none. Of a quantity: its channel.
  int EncodedChannel(int c, int index) const;

  /// One row. @param image (height, width, channels), empty without an image. @param extra (n_extra)
  /// Quantities are cut to +-`bound` where it is positive.
  void Encode(std::span<const double> row, float bound, std::span<float> image, std::span<float> extra) const;

  /// Arrays of these names: PREFIX/image, PREFIX/levels, PREFIX/occurs, PREFIX/mean, PREFIX/scale.
  void Save(const std::string& prefix, NpzArrays& arrays) const;
  /// @throws DataError naming `where`
  static Encoder Load(const std::string& prefix, const NpzArrays& arrays, const std::string& where);

 private:
  void Finish();
  InputShape shape_;
  int in_ = 0, channels_ = 0, n_extra_ = 0;
  Normalizer normalizer_;            // per number of a row; unused for indices
  std::vector<uint8_t> occurs_;      // per image channel and level
  std::vector<int> first_level_;     // per image channel: where its levels begin in occurs_ and place_
  std::vector<int> first_channel_;   // per image channel: its first encoded channel
  std::vector<int> place_;           // per image channel and level: the encoded channel
  std::vector<int> channel_levels_;  // per image channel
};

}  // namespace oted
