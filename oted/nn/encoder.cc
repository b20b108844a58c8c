#include "oted/nn/encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/npz_fields.h"

namespace oted {
namespace {

constexpr int kMostLevels = 4096;

/// The index that a number stands for; -1 for none.
int IndexOf(double value, int levels) { return value >= 0 && value < levels ? static_cast<int>(value) : -1; }

}  // namespace

InputShape InputShape::With(int n_before, const std::vector<int>& more) const {
  InputShape shape = *this;
  shape.levels.resize(static_cast<size_t>(n_before), 0);
  shape.levels.insert(shape.levels.end(), more.begin(), more.end());
  if (shape.image.empty() && std::ranges::all_of(shape.levels, [](int n) { return n == 0; })) shape.levels.clear();
  return shape;
}

Encoder::Encoder(const Array2<double>& rows, InputShape shape)
    : shape_(std::move(shape)), in_(rows.cols()), normalizer_(Normalizer::Fit(rows)) {
  const size_t n_image = static_cast<size_t>(shape_.image_size());
  if (n_image > static_cast<size_t>(in_) ||
      (!shape_.levels.empty() && shape_.levels.size() != normalizer_.mean.size())) {
    throw DataError(fmt::format("rows of {} numbers do not hold what their shape says ({} of an image, {} levels)", in_,
                                n_image, shape_.levels.size()));
  }
  if (n_image > 0) {
    shape_.levels.resize(static_cast<size_t>(in_), 0);
    const size_t n_channels = static_cast<size_t>(shape_.image[2]), places = n_image / n_channels;
    for (size_t c = 0; c < n_channels; ++c) {
      // Of a quantity: one mean and one spread for the whole image, so that a place looks like any other.
      double mean = 0, square = 0;
      for (size_t p = c; p < n_image; p += n_channels) {
        mean += normalizer_.mean[p] / static_cast<double>(places);
        square += (normalizer_.mean[p] * normalizer_.mean[p] + normalizer_.scale[p] * normalizer_.scale[p]) /
                  static_cast<double>(places);
      }
      const double scale = std::sqrt(std::max(0.0, square - mean * mean));
      for (size_t p = c; p < n_image; p += n_channels) {
        normalizer_.mean[p] = mean;
        normalizer_.scale[p] = scale > 0 ? scale : 1.0;
      }
    }
    for (size_t c = 0; c < n_channels; ++c) {
      const int levels = shape_.levels[c];
      const size_t first = occurs_.size();
      occurs_.resize(first + static_cast<size_t>(levels), 0);
      for (int i = 0; i < rows.rows() && levels > 0; ++i) {
        for (size_t p = c; p < n_image; p += n_channels) {
          const int index = IndexOf(rows.row(i)[p], levels);
          if (index >= 0) occurs_[first + static_cast<size_t>(index)] = 1;
        }
      }
    }
  }
  Finish();
}

void Encoder::Finish() {
  const size_t n_image = static_cast<size_t>(shape_.image_size());
  if (n_image > 0) {
    place_.assign(occurs_.size(), 0);
    int first = 0;
    for (int c = 0; c < shape_.image[2]; ++c) {
      const int levels = shape_.levels[static_cast<size_t>(c)];
      channel_levels_.push_back(levels);
      first_level_.push_back(first);
      first_channel_.push_back(channels_);
      // The last channel of the group is that of indices which never occurred; where one index alone occurred, it is
      // the only one.
      const auto begin = occurs_.begin() + first;
      const auto n_occur = static_cast<int>(std::count(begin, begin + levels, uint8_t{1}));
      int next = channels_;
      const int n_own = n_occur > 1 ? n_occur : 0;
      for (int k = 0; k < levels; ++k) {
        const bool own = n_own > 0 && occurs_[static_cast<size_t>(first + k)] != 0;
        const bool constant = n_own == 0 && occurs_[static_cast<size_t>(first + k)] != 0;
        place_[static_cast<size_t>(first + k)] = own ? next++ : constant ? -1 : channels_ + n_own;
      }
      channels_ += levels > 0 ? n_own + 1 : 1;
      first += levels;
    }
  }
  for (size_t j = n_image; j < static_cast<size_t>(in_); ++j) {
    n_extra_ += shape_.levels.empty() || shape_.levels[j] == 0 ? 1 : shape_.levels[j];
  }
}

int Encoder::EncodedChannel(int c, int index) const {
  const auto at = static_cast<size_t>(c);
  if (channel_levels_[at] == 0) return first_channel_[at];
  if (index >= 0) return place_[static_cast<size_t>(first_level_[at] + index)];
  return (at + 1 < first_channel_.size() ? first_channel_[at + 1] : channels_) - 1;
}

void Encoder::Encode(std::span<const double> row, float bound, std::span<float> image, std::span<float> extra) const {
  const auto quantity = [&](size_t j) {
    const auto value = static_cast<float>((row[j] - normalizer_.mean[j]) / normalizer_.scale[j]);
    return bound > 0 ? std::clamp(value, -bound, bound) : value;
  };
  const size_t n_image = static_cast<size_t>(shape_.image_size());
  if (n_image > 0) {
    std::fill(image.begin(), image.end(), 0.0f);
    const size_t n_channels = static_cast<size_t>(shape_.image[2]);
    float* to = image.data();
    for (size_t p = 0; p < n_image; p += n_channels, to += channels_) {
      for (size_t c = 0; c < n_channels; ++c) {
        const int levels = channel_levels_[c];
        if (levels == 0) {
          to[first_channel_[c]] = quantity(p + c);
          continue;
        }
        const int index = IndexOf(row[p + c], levels);
        const int other = c + 1 < n_channels ? first_channel_[c + 1] - 1 : channels_ - 1;
        const int channel = index < 0 ? other : place_[static_cast<size_t>(first_level_[c] + index)];
        if (channel >= 0) to[channel] = 1.0f;
      }
    }
  }
  float* to = extra.data();
  for (size_t j = n_image; j < static_cast<size_t>(in_); ++j) {
    const int levels = shape_.levels.empty() ? 0 : shape_.levels[j];
    if (levels == 0) {
      *to++ = quantity(j);
      continue;
    }
    std::fill(to, to + levels, 0.0f);
    const int index = IndexOf(row[j], levels);
    if (index >= 0) to[index] = 1.0f;
    to += levels;
  }
}

void Encoder::Save(const std::string& prefix, NpzArrays& arrays) const {
  arrays[prefix + "/mean"] = NpyArray(normalizer_.mean);
  arrays[prefix + "/scale"] = NpyArray(normalizer_.scale);
  if (shape_.levels.empty()) return;
  arrays[prefix + "/image"] = NpyArray(std::vector<int64_t>(shape_.image.begin(), shape_.image.end()));
  arrays[prefix + "/levels"] = NpyArray(std::vector<int64_t>(shape_.levels.begin(), shape_.levels.end()));
  arrays[prefix + "/occurs"] = NpyArray(occurs_);
}

Encoder Encoder::Load(const std::string& prefix, const NpzArrays& arrays, const std::string& where) {
  const NpzFields fields{prefix, arrays, where};
  Encoder encoder;
  encoder.normalizer_ = {fields.Get("mean"), fields.Get("scale")};
  const std::vector<double>& mean = encoder.normalizer_.mean;
  const std::vector<double>& scale = encoder.normalizer_.scale;
  const auto sound = [](double v) { return std::isfinite(v); };
  if (mean.empty() || !std::ranges::all_of(mean, sound)) fields.Fail("mean");
  if (scale.size() != mean.size() || !std::ranges::all_of(scale, [](double v) { return std::isfinite(v) && v > 0; })) {
    fields.Fail("scale");
  }
  encoder.in_ = static_cast<int>(mean.size());
  const NpyArray* saved_levels = fields.Find("levels");
  const std::vector<double> levels = saved_levels != nullptr ? saved_levels->ToDouble() : std::vector<double>();
  if (!levels.empty()) {
    if (levels.size() != mean.size()) fields.Fail("levels");
    for (const double n : levels) {
      if (!(n >= 0 && n <= kMostLevels && n == std::floor(n))) fields.Fail("levels");
    }
    encoder.shape_.levels.assign(levels.begin(), levels.end());
    const std::vector<double> image = fields.Get("image"), occurs = fields.Get("occurs");
    double size = image.empty() ? 0 : 1;
    for (const double n : image) {
      if (!(n >= 1 && n <= encoder.in_ && n == std::floor(n))) fields.Fail("image");
      size *= n;
    }
    if ((!image.empty() && image.size() != 3) || size > encoder.in_) fields.Fail("image");
    encoder.shape_.image.assign(image.begin(), image.end());
    double n_levels = 0;
    for (size_t p = 0; p < static_cast<size_t>(size); ++p) {
      const auto c = p % static_cast<size_t>(image[2]);
      if (levels[p] != levels[c]) fields.Fail("levels");
      if (p == c) n_levels += levels[c];
    }
    if (static_cast<double>(occurs.size()) != n_levels) fields.Fail("occurs");
    for (const double flag : occurs) {
      if (flag != 0 && flag != 1) fields.Fail("occurs");
      encoder.occurs_.push_back(flag == 1);
    }
  }
  encoder.Finish();
  return encoder;
}

}  // namespace oted
