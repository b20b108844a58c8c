#include "oted/data/npz.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <map>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/rng.h"
#include "oted/base/testing.h"
#include "oted/data/npy.h"
#include "oted/data/testing.h"
#include "oted/data/zip.h"

namespace oted::npz_test {

using testing::HasSubstr;

NpzArrays SmallArrays() {
  NpzArrays arrays;
  arrays["d"] = NpyArray(std::vector<double>{0.1, -2.5, 1e300});
  arrays["d"].shape = {3, 1};
  arrays["f"] = NpyArray(std::vector<float>{0.5f, 0.1f});
  arrays["i"] = NpyArray(std::vector<int64_t>{INT64_MIN, -1, INT64_MAX});
  arrays["infos/u"] = NpyArray(std::vector<uint8_t>{0, 1, 255});
  arrays["empty"] = NpyArray(std::vector<double>{});
  arrays["empty"].shape = {0, 4};
  arrays["scalar"] = NpyArray(std::vector<double>{7});
  arrays["scalar"].shape = {};
  return arrays;
}

void ExpectSame(const NpzArrays& a, const NpzArrays& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [name, array] : a) {
    ASSERT_TRUE(b.contains(name)) << name;
    EXPECT_EQ(array.shape, b.at(name).shape) << name;
    EXPECT_EQ(array.values, b.at(name).values) << name;
    EXPECT_EQ(array.is_bool, b.at(name).is_bool) << name;
  }
}

std::string Npy(const std::string& header, const std::string& data) {
  std::string bytes("\x93NUMPY\1\0", 8);
  bytes += {static_cast<char>(header.size()), '\0'};
  return bytes + header + data;
}

TEST(Npz, GivesBackWhatWasWritten) {
  const TestFolder folder;
  WriteNpz(SmallArrays(), folder / "a.npz");
  ExpectSame(ReadNpz(folder / "a.npz"), SmallArrays());
  ExpectSame(ParseNpz(NpzBytes({}), "none"), {});
}

TEST(Npz, EqualArraysGiveEqualBytes) { EXPECT_EQ(NpzBytes(SmallArrays()), NpzBytes(SmallArrays())); }

TEST(Npz, NumpyReadsWhatWeWrote) {
  const TestFolder folder;
  NpzArrays arrays = SmallArrays();
  arrays["flag"] = NpyArray(std::vector<uint8_t>{1, 0});
  arrays["flag"].is_bool = true;
  WriteNpz(arrays, folder / "a.npz");
  EXPECT_TRUE(RunPython(R"(
import numpy as np, zipfile
assert zipfile.ZipFile('a.npz').testzip() is None
a = np.load('a.npz', allow_pickle=False)
assert sorted(a.files) == ['d', 'empty', 'f', 'flag', 'i', 'infos/u', 'scalar'], a.files
def check(name, dtype, value):
    want = np.array(value, dtype)
    assert a[name].dtype == want.dtype and a[name].shape == want.shape and (a[name] == want).all(), (name, a[name])
check('d', '<f8', [[0.1], [-2.5], [1e300]])
check('f', '<f4', [0.5, 0.1])
check('i', '<i8', [-2**63, -1, 2**63 - 1])
check('infos/u', '|u1', [0, 1, 255])
check('empty', '<f8', np.zeros((0, 4)))
check('scalar', '<f8', 7)
check('flag', '|b1', [True, False])
)",
                        folder));
}

TEST(Npz, WeReadEveryDtypeAndOrderThatNumpyWrote) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(R"(
import numpy as np
x = np.arange(24).reshape(2, 3, 4)
arrays = {d: x.astype(d) for d in ['<f2', '<f4', '<f8', '|i1', '<i2', '<i4', '<i8', '|u1', '<u2', '<u4', '<u8']}
arrays['bool'] = x % 3 == 0
arrays['fortran'] = np.asfortranarray(x * 0.5)
arrays['matrix'] = np.asfortranarray(x.reshape(4, 6) * 0.5)
arrays['negative'] = np.array([-1, -128], 'i1')
arrays['half'] = np.array([1/3, -2.0**-24, 65504, np.inf, -0.0], 'f2')
arrays['scalar'] = np.float32(2.5)
arrays['repeated'] = np.zeros(10**6)
np.savez('stored.npz', **arrays)
np.savez_compressed('deflated.npz', **arrays)
)",
                        folder));
  for (const char* name : {"stored.npz", "deflated.npz"}) {
    const NpzArrays arrays = ReadNpz(folder / name);
    ASSERT_EQ(arrays.size(), 18u);
    for (const auto& [key, array] : arrays) {
      if (key[0] != '<' && key[0] != '|' && key != "fortran") continue;
      EXPECT_EQ(array.shape, (std::vector<int64_t>{2, 3, 4})) << key;
      const std::vector<double> values = array.ToDouble();
      for (int i = 0; i < 24; ++i) EXPECT_EQ(values[i], key == "fortran" ? 0.5 * i : i) << key << ' ' << i;
    }
    const std::vector<double> matrix = arrays.at("matrix").ToDouble();
    for (int i = 0; i < 24; ++i) EXPECT_EQ(matrix[i], 0.5 * i);
    EXPECT_TRUE(arrays.at("bool").is_bool);
    EXPECT_EQ(arrays.at("bool").ToDouble()[3], 1.0);
    EXPECT_EQ(arrays.at("negative").ToDouble(), (std::vector<double>{-1, -128}));
    const std::vector<double> half = arrays.at("half").ToDouble();
    // 1/3 rounded to 11 bits is 1365 / 4096.
    EXPECT_EQ(half, (std::vector<double>{1365.0 / 4096, -0x1.0p-24, 65504, INFINITY, 0}));
    EXPECT_TRUE(std::signbit(half[4]));
    EXPECT_EQ(arrays.at("scalar").size(), 1);
    EXPECT_TRUE(arrays.at("scalar").shape.empty());
    EXPECT_EQ(arrays.at("repeated").size(), 1000000);
  }
}

TEST(Npz, Zip64DirectoriesAreRead) {
  const TestFolder folder;
  // With its limit lowered, zipfile writes what it otherwise writes for more than 4 GiB.
  ASSERT_TRUE(RunPython(R"(
import numpy as np, zipfile
zipfile.ZIP64_LIMIT = 50
np.savez('a.npz', a=np.arange(100.), b=np.arange(3))
assert b'PK\x06\x06' in open('a.npz', 'rb').read()
)",
                        folder));
  const NpzArrays arrays = ReadNpz(folder / "a.npz");
  EXPECT_EQ(arrays.at("a").size(), 100);
  EXPECT_EQ(arrays.at("a").ToDouble()[99], 99.0);
  EXPECT_EQ(arrays.at("b").ToDouble(), (std::vector<double>{0, 1, 2}));
  const std::string bytes = ReadFile(folder / "a.npz");
  for (size_t n = 0; n < bytes.size(); ++n) EXPECT_THROW(ParseNpz(bytes.substr(0, n), "a.npz"), DataError) << n;
}

TEST(Npz, PickledStructuredAndBigEndianArraysAreRefused) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(R"(
import numpy as np
np.savez('object.npz', a=np.array([{}, None], object))
np.savez('structured.npz', a=np.zeros(2, [('x', 'f4')]))
np.savez('big.npz', a=np.zeros(2, '>f8'))
np.savez('text.npz', a=np.array(['x']))
np.savez('large.npz', a=np.array([2**63], 'u8'))
)",
                        folder));
  const auto message = [&](const char* name) { return MessageOf<DataError>([&] { ReadNpz(folder / name); }); };
  EXPECT_THAT(message("object.npz"), HasSubstr("pickled"));
  EXPECT_THAT(message("structured.npz"), HasSubstr("structured"));
  EXPECT_THAT(message("big.npz"), HasSubstr("big-endian"));
  EXPECT_THAT(message("text.npz"), HasSubstr("dtype '<U1'"));
  EXPECT_THAT(message("large.npz"), HasSubstr("2^63"));
}

TEST(Npy, HeadersAreParsedWhateverTheOrderAndQuotes) {
  const std::string data(16, '\0');
  const NpyArray a = ParseNpy(Npy(R"({"shape": (2L,), 'fortran_order':False,'descr': "<f8"})", data), "a");
  EXPECT_EQ(a.shape, std::vector<int64_t>{2});
}

TEST(Npy, ShapesThatDoNotMatchTheValuesAreRefused) {
  const std::string data(16, '\0');
  const auto parse = [&](const std::string& shape) {
    ParseNpy(Npy("{'descr': '<f8', 'fortran_order': False, 'shape': (" + shape + "), }", data), "a");
  };
  EXPECT_NO_THROW(parse("2,"));
  EXPECT_NO_THROW(parse("1, 2, 1"));
  for (const char* shape : {"3,", "1,", "", "0, 2", "4294967296, 4294967296", "9223372036854775807,", "-2,", "2.0,",
                            "99999999999999999999,", "2 2", "(2,),", "2305843009213693952, 8, 2"}) {
    EXPECT_THROW(parse(shape), DataError) << shape;
  }
}

TEST(Npy, DamagedHeadersAreRefused) {
  for (const char* header : {"", "{", "{}", "{'descr': '<f8'}", "{'descr': '<f8', 'fortran_order': 1, 'shape': ()}",
                             "{'descr': '<f8', 'descr': '<f8', 'fortran_order': False, 'shape': ()}",
                             "{'descr': '<f8', 'fortran_order': False, 'shape': ()} + 1",
                             "{'descr': f(), 'fortran_order': False, 'shape': ()}"}) {
    EXPECT_THROW(ParseNpy(Npy(header, std::string(8, '\0')), "a"), DataError) << header;
  }
}

/// The same archive as another program would have written it.
std::string Unsealed(std::string bytes) {
  EXPECT_TRUE(HasZipSeal(bytes));
  bytes[bytes.rfind("sha256 ")] = 'S';
  EXPECT_FALSE(HasZipSeal(bytes));
  return bytes;
}

TEST(Npz, NoFlippedBitOfWhatWeWroteChangesANumberInSilence) {
  const TestFolder folder;
  const NpzArrays arrays = SmallArrays();
  const std::string good = NpzBytes(arrays);
  int n_read = 0;
  for (size_t at = 0; at < good.size(); ++at) {
    std::string bytes = good;
    bytes[at] ^= static_cast<char>(1 << (at % 8));
    try {
      ExpectSame(ParseNpz(bytes, "a.npz"), arrays);
      ++n_read;
    } catch (const DataError&) {
    }
    if (at % 37 != 0) continue;
    std::ofstream(folder / "checkpoint.npz", std::ios::binary) << bytes;
    EXPECT_THROW(ReadCheckpoint(folder / "checkpoint.npz"), DataError) << at;
  }
  EXPECT_LE(n_read, 7) << "only the seal's own name may be lost";
  std::ofstream(folder / "checkpoint.npz", std::ios::binary) << Unsealed(good);
  EXPECT_THAT(MessageOf<DataError>([&] { ReadCheckpoint(folder / "checkpoint.npz"); }), HasSubstr("checkpoint.npz"));
  std::ofstream(folder / "checkpoint.npz", std::ios::binary) << good;
  ExpectSame(ReadCheckpoint(folder / "checkpoint.npz"), arrays);
}

TEST(Npz, MembersThatTogetherUnpackToFarMoreThanTheFileAreRefusedBeforeThat) {
  std::map<std::string, std::string> members;
  for (const char* name : {"a.npy", "b.npy", "never_read"}) members[name] = std::string(size_t{1} << 20, '\0');
  const std::string bytes = ZipBytes(members);
  EXPECT_EQ(ParseZip(bytes, "a.npz", 3 << 20).size(), 3u);
  EXPECT_THAT(MessageOf<DataError>([&] { ParseZip(bytes, "a.npz", (3 << 20) - 1); }),
              testing::AllOf(HasSubstr("a.npz"), HasSubstr("numpy.savez")));
}

TEST(Npz, WhatIsWrittenIsReadHoweverWellItDeflates) {
  std::map<std::string, std::string> members = {{"small", std::string(size_t{3} << 20, '\0')},
                                                {"middle", std::string(size_t{8} << 20, '\0')},
                                                {"large", std::string(size_t{100} << 20, '\0')}};
  const std::string bytes = ZipBytes(members);
  EXPECT_LT(bytes.size(), size_t{5} << 20) << "the smallest that suffices is stored";
  EXPECT_EQ(ParseZip(bytes, "a.npz"), members);
  members.erase("small");
  members["middle"] += std::string(size_t{200} << 20, '\1');
  EXPECT_EQ(ParseZip(ZipBytes(members), "a.npz"), members);
}

TEST(Npz, AMemberThatInflatesToAnotherSizeThanItClaimsIsRefused) {
  // The size lies at offset 22 of the local header and 24 of the directory's entry; only the latter is believed.
  std::string bytes = Unsealed(ZipBytes({{"a.npy", std::string(1000, 'x')}}));
  const size_t entry = bytes.find("PK\1\2");
  ASSERT_NE(entry, std::string::npos);
  for (const uint32_t claimed : {0u, 999u, 1001u, 0xFFFFFFFEu, 0xFFFFFFFFu}) {
    std::memcpy(bytes.data() + entry + 24, &claimed, 4);
    EXPECT_THROW(ParseZip(bytes, "a.npz"), DataError) << claimed;
  }
}

TEST(Npz, EveryTruncationIsADataError) {
  const std::string bytes = NpzBytes(SmallArrays());
  for (size_t n = 0; n < bytes.size(); ++n) {
    EXPECT_THROW(ParseNpz(bytes.substr(0, n), "a.npz"), DataError) << n;
  }
}

TEST(Npz, MutatedBytesGiveADataErrorOrArraysOfTheirShape) {
  const std::string good = Unsealed(NpzBytes(SmallArrays()));
  Rng rng(3);
  int refused = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::string bytes = good;
    for (uint64_t k = 0; k <= rng.Below(4); ++k) {
      bytes[rng.Below(bytes.size())] = static_cast<char>(rng.Below(256));
    }
    try {
      for (const auto& [name, array] : ParseNpz(bytes, "a.npz")) {
        EXPECT_EQ(static_cast<size_t>(array.size()), array.ToDouble().size());
      }
    } catch (const DataError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(Npz, ForeignFilesAreNamed) {
  const TestFolder folder;
  WriteFileAtomically(folder / "a.npz", "just text, long enough to hold an end record");
  EXPECT_THAT(MessageOf<DataError>([&] { ReadNpz(folder / "a.npz"); }), HasSubstr("a.npz' is not an .npz archive"));
  EXPECT_THROW(ReadNpz(folder / "missing.npz"), DataError);
}

TEST(Npz, ADatasetThatNumpyWroteIsRead) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(R"(
import numpy as np
i = np.arange(20.)
obs = lambda i: 0.1 * i[:, None] + np.arange(3)
np.savez('d.npz', observations=obs(i), next_observations=obs(i + 1), terminals=(i == 19).astype('f4'),
         actions=((i % 8) / 8)[:, None] - np.arange(2), rewards=(i / 4)[:, None], timeouts=i == 9)
)",
                        folder));
  const Dataset read = ReadDatasetNpz(folder / "d.npz");
  EXPECT_TRUE(SameTransitions(read, MakeTestDataset(20, 10, false)));
}

}  // namespace oted::npz_test
