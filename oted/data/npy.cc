#include "oted/data/npy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <bit>
#include <cstring>
#include <limits>
#include <optional>

#include "oted/base/error.h"

namespace oted {
namespace {

static_assert(std::endian::native == std::endian::little, ".npy values are copied as they lie in memory");

constexpr std::string_view kMagic("\x93NUMPY", 6);
constexpr size_t kMaxDimensions = 32;

struct Header {
  std::string descr;
  bool fortran_order = false;
  std::vector<int64_t> shape;
};

/// Reads the header's Python dictionary: three keys, of which the values are text, True or False, and whole numbers.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  Header Parse() {
    std::optional<std::string> descr;
    std::optional<bool> fortran_order;
    std::optional<std::vector<int64_t>> shape;
    Expect('{');
    while (!Take('}')) {
      const std::string key = Text();
      Expect(':');
      if (key == "descr" && !descr) {
        if (Peek() == '[') {
          throw DataError(where_ + " is a structured array; save one plain array per field");
        }
        descr = Text();
      } else if (key == "fortran_order" && !fortran_order) {
        fortran_order = Boolean();
      } else if (key == "shape" && !shape) {
        shape = Shape();
      } else {
        Fail();
      }
      if (!Take(',') && Peek() != '}') Fail();
    }
    if (Peek() != '\0' || !descr || !fortran_order || !shape) Fail();
    return {*descr, *fortran_order, *shape};
  }

 private:
  [[noreturn]] void Fail() const {
    throw DataError(where_ + " has a damaged .npy header; save it again with numpy.savez");
  }
  char Peek() {
    while (!text_.empty() && (text_[0] == ' ' || text_[0] == '\n' || text_[0] == '\t')) text_.remove_prefix(1);
    return text_.empty() ? '\0' : text_[0];
  }
  bool Take(char c) {
    if (Peek() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  void Expect(char c) {
    if (text_.empty() || !Take(c)) Fail();
  }
  std::string Text() {
    const char quote = Peek();
    if (quote != '\'' && quote != '"') Fail();
    const size_t end = text_.find(quote, 1);
    if (end == std::string_view::npos) Fail();
    const std::string text(text_.substr(1, end - 1));
    text_.remove_prefix(end + 1);
    return text;
  }
  bool Boolean() {
    for (const std::string_view word : {"True", "False"}) {
      if (Peek() == word[0] && text_.starts_with(word)) {
        text_.remove_prefix(word.size());
        return word[0] == 'T';
      }
    }
    Fail();
  }
  std::vector<int64_t> Shape() {
    std::vector<int64_t> shape;
    Expect('(');
    while (!Take(')')) {
      if (shape.size() == kMaxDimensions) Fail();
      shape.push_back(Number());
      if (!Take(',') && Peek() != ')') Fail();
    }
    return shape;
  }
  int64_t Number() {
    int64_t number = 0;
    if (Peek() < '0' || Peek() > '9') Fail();
    while (!text_.empty() && text_[0] >= '0' && text_[0] <= '9') {
      if (number > (std::numeric_limits<int64_t>::max() - 9) / 10) Fail();
      number = 10 * number + (text_[0] - '0');
      text_.remove_prefix(1);
    }
    // Python 2 wrote long integers with this suffix.
    if (!text_.empty() && text_[0] == 'L') text_.remove_prefix(1);
    return number;
  }

  std::string_view text_;
  const std::string& where_;
};

/// IEEE 754 binary16.
struct Half {
  uint16_t bits;
  explicit operator float() const {
    const uint32_t sign = static_cast<uint32_t>(bits & 0x8000u) << 16;
    const uint32_t exponent = (bits >> 10) & 31u;
    const uint32_t fraction = bits & 1023u;
    if (exponent == 0) {
      const float magnitude = static_cast<float>(fraction) * 0x1.0p-24f;
      return sign != 0 ? -magnitude : magnitude;
    }
    const uint32_t wide = exponent == 31 ? 255 : exponent + 112;
    return std::bit_cast<float>(sign | (wide << 23) | (fraction << 13));
  }
};

/// Copies values stored as `Stored` into C order as `Kept`.
template <class Stored, class Kept>
std::vector<Kept> Values(std::string_view data, const Header& header, const std::string& where) {
  const size_t n = data.size() / sizeof(Stored);
  std::vector<Kept> values(n);
  const auto load = [&](size_t i) {
    Stored stored;
    std::memcpy(&stored, data.data() + i * sizeof(Stored), sizeof(Stored));
    if constexpr (std::is_same_v<Stored, uint64_t>) {
      if (stored > static_cast<uint64_t>(std::numeric_limits<int64_t>::max())) {
        throw DataError(fmt::format("{} holds {}, above 2^63 - 1; save it as int64 or float64", where, stored));
      }
    }
    return static_cast<Kept>(stored);
  };
  const std::vector<int64_t>& shape = header.shape;
  if (!header.fortran_order || shape.size() < 2) {
    for (size_t i = 0; i < n; ++i) values[i] = load(i);
    return values;
  }
  // Walks the stored values in order, first index fastest, and keeps where each belongs.
  std::vector<size_t> stride(shape.size(), 1);
  for (size_t d = shape.size() - 1; d > 0; --d) stride[d - 1] = stride[d] * static_cast<size_t>(shape[d]);
  std::vector<int64_t> index(shape.size(), 0);
  size_t to = 0;
  for (size_t i = 0; i < n; ++i) {
    values[to] = load(i);
    for (size_t d = 0; d < shape.size(); ++d) {
      to += stride[d];
      if (++index[d] < shape[d]) break;
      to -= stride[d] * static_cast<size_t>(shape[d]);
      index[d] = 0;
    }
  }
  return values;
}

template <class Stored, class Kept>
NpyArray Decode(std::string_view data, const Header& header, const std::string& where) {
  const size_t available = data.size() / sizeof(Stored);
  // Counts up to what is there only, so that a huge shape can neither overflow nor allocate.
  size_t n = 1;
  for (const int64_t size : header.shape) {
    if (size == 0) n = 0;
  }
  for (const int64_t size : header.shape) {
    if (n != 0 && static_cast<uint64_t>(size) > available / n)
      n = available + 1;
    else
      n *= static_cast<size_t>(size);
    if (n > available) break;
  }
  if (n > available || n * sizeof(Stored) != data.size()) {
    throw DataError(fmt::format("{} has shape ({}) of '{}' but {} bytes of values; it is damaged: save it again", where,
                                fmt::join(header.shape, ", "), header.descr, data.size()));
  }
  NpyArray array(Values<Stored, Kept>(data, header, where));
  array.shape = header.shape;
  return array;
}

}  // namespace

NpyArray ParseNpy(std::string_view bytes, const std::string& where) {
  const auto fail = [&] { throw DataError(where + " is not a .npy array; save it with numpy.savez"); };
  if (bytes.size() < 12 || !bytes.starts_with(kMagic)) fail();
  const auto byte = [&](size_t i) { return static_cast<uint32_t>(static_cast<unsigned char>(bytes[i])); };
  const uint32_t version = byte(6);
  if (version < 1 || version > 3) {
    throw DataError(fmt::format("{} is .npy version {}, wanted 1 to 3; save it with numpy.savez", where, version));
  }
  size_t begin = 10;
  uint32_t header_size = byte(8) | byte(9) << 8;
  if (version >= 2) {
    begin = 12;
    header_size |= byte(10) << 16 | byte(11) << 24;
  }
  if (header_size > bytes.size() - begin) fail();
  const Header header = HeaderParser(bytes.substr(begin, header_size), where).Parse();
  const std::string_view data = bytes.substr(begin + header_size);

  std::string descr = header.descr;
  if (descr.size() > 2 && descr[0] == '>') {
    throw DataError(
        fmt::format("{} is big-endian ('{}'); convert it with a.astype('<{}')", where, header.descr, descr.substr(1)));
  }
  if (descr.find('O') != std::string::npos) {
    throw DataError(where + " holds pickled Python objects, which are never loaded; save plain numeric arrays");
  }
  if (!descr.empty() && (descr[0] == '<' || descr[0] == '|' || descr[0] == '=')) descr.erase(0, 1);
  if (descr == "f8") return Decode<double, double>(data, header, where);
  if (descr == "f4") return Decode<float, float>(data, header, where);
  if (descr == "f2") return Decode<Half, float>(data, header, where);
  if (descr == "i8") return Decode<int64_t, int64_t>(data, header, where);
  if (descr == "i4") return Decode<int32_t, int64_t>(data, header, where);
  if (descr == "i2") return Decode<int16_t, int64_t>(data, header, where);
  if (descr == "i1") return Decode<int8_t, int64_t>(data, header, where);
  if (descr == "u8") return Decode<uint64_t, int64_t>(data, header, where);
  if (descr == "u4") return Decode<uint32_t, int64_t>(data, header, where);
  if (descr == "u2") return Decode<uint16_t, int64_t>(data, header, where);
  if (descr == "u1") return Decode<uint8_t, uint8_t>(data, header, where);
  if (descr == "b1") {
    NpyArray array = Decode<uint8_t, uint8_t>(data, header, where);
    array.is_bool = true;
    return array;
  }
  throw DataError(
      fmt::format("{} has dtype '{}', wanted bool, integers or floats; convert it with astype", where, header.descr));
}

std::string NpyBytes(const NpyArray& array) {
  const char* descr = nullptr;
  std::string_view data;
  std::visit(
      [&]<class T>(const std::vector<T>& values) {
        OTED_CHECK(static_cast<int64_t>(values.size()) == array.size());
        if constexpr (std::is_same_v<T, double>) descr = "<f8";
        if constexpr (std::is_same_v<T, float>) descr = "<f4";
        if constexpr (std::is_same_v<T, int64_t>) descr = "<i8";
        if constexpr (std::is_same_v<T, uint8_t>) descr = array.is_bool ? "|b1" : "|u1";
        data = {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
      },
      array.values);
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}{}), }}", descr,
                                   fmt::join(array.shape, ", "), array.shape.size() == 1 ? "," : "");
  // NumPy pads so that the values begin at a multiple of 64 bytes.
  header.append(63 - (10 + header.size()) % 64, ' ');
  header += '\n';
  OTED_CHECK(header.size() <= 0xFFFF);
  std::string bytes(kMagic);
  bytes += {'\1', '\0', static_cast<char>(header.size() & 0xFF), static_cast<char>(header.size() >> 8)};
  bytes += header;
  bytes += data;
  return bytes;
}

}  // namespace oted
