#include "oted/data/gzip.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "oted/base/error.h"
#include "oted/data/unpack_budget.h"

namespace oted {
namespace {

constexpr int kGzipWindow = 15 + 16;  // zlib's way to ask for gzip's header
constexpr size_t kUnpackedStep = size_t{1} << 20;

/// Gives a stream that has used up its input the next bytes, from `at` to `end`.
void Feed(const std::string& bytes, size_t& at, size_t end, z_stream& stream) {
  if (stream.avail_in > 0 || at >= end) return;
  const size_t n = std::min(kUnpackedStep, end - at);
  // zlib's interface wants a pointer to mutable bytes and does not change them.
  stream.next_in = const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(bytes.data() + at));
  stream.avail_in = static_cast<unsigned>(n);
  at += n;
}

}  // namespace

bool IsGzip(const std::string& bytes) {
  return bytes.size() >= 2 && static_cast<unsigned char>(bytes[0]) == 0x1f &&
         static_cast<unsigned char>(bytes[1]) == 0x8b;
}

std::string Gunzip(const std::string& bytes, const std::string& file) {
  const auto fail = [&](const char* what) {
    throw DataError(fmt::format("'{}' {}; write it again, or unpack it with gunzip", file, what));
  };
  std::string out;
  std::vector<unsigned char> block(kUnpackedStep);
  size_t at = 0;
  while (at < bytes.size()) {
    z_stream stream{};
    OTED_CHECK(inflateInit2(&stream, kGzipWindow) == Z_OK);
    struct End {
      z_stream* stream;
      ~End() { inflateEnd(stream); }
    } const end{&stream};
    int status = Z_OK;
    while (status != Z_STREAM_END) {
      Feed(bytes, at, bytes.size(), stream);
      stream.next_out = block.data();
      stream.avail_out = static_cast<unsigned>(block.size());
      status = inflate(&stream, Z_NO_FLUSH);
      if (status != Z_OK && status != Z_STREAM_END) fail("is a truncated or damaged gzip file");
      const size_t n = block.size() - stream.avail_out;
      if (out.size() + n > UnpackBudget(bytes.size())) fail("unpacks to far more than its size");
      out.append(reinterpret_cast<const char*>(block.data()), n);
    }
    at -= stream.avail_in;
  }
  return out;
}

namespace {

constexpr int kGzipLevel = 6;  // zlib's usual one

/// Adds a member to `out`. @param level  0: only wrapped
void AddGzip(const std::string& bytes, size_t begin, size_t stop, int level, std::string& out) {
  z_stream stream{};
  OTED_CHECK(deflateInit2(&stream, level, Z_DEFLATED, kGzipWindow, 8, Z_DEFAULT_STRATEGY) == Z_OK);
  struct End {
    z_stream* stream;
    ~End() { deflateEnd(stream); }
  } const end{&stream};
  std::vector<unsigned char> block(kUnpackedStep);
  size_t at = begin;
  int status = Z_OK;
  while (status != Z_STREAM_END) {
    Feed(bytes, at, stop, stream);
    stream.next_out = block.data();
    stream.avail_out = static_cast<unsigned>(block.size());
    status = deflate(&stream, at == stop ? Z_FINISH : Z_NO_FLUSH);
    OTED_CHECK(status == Z_OK || status == Z_STREAM_END);
    out.append(reinterpret_cast<const char*>(block.data()), block.size() - stream.avail_out);
  }
}

}  // namespace

std::string Gzip(const std::string& bytes) {
  // A first part that is not deflated makes the file large enough for what it unpacks to.
  size_t n_plain = 0;
  for (;;) {
    std::string out;
    if (n_plain > 0) AddGzip(bytes, 0, n_plain, 0, out);
    AddGzip(bytes, n_plain, bytes.size(), kGzipLevel, out);
    const uint64_t budget = UnpackBudget(out.size());
    if (bytes.size() <= budget) return out;
    n_plain = std::min(bytes.size(), 2 * n_plain + (bytes.size() - budget) / kUnpackRatio + 1);
  }
}

}  // namespace oted
