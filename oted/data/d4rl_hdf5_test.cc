#include "oted/data/d4rl_hdf5.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/data/testing.h"

namespace oted::d4rl_hdf5_test {

using testing::AllOf;
using testing::HasSubstr;

// What the scripts below share: a good file's arrays, of the same values as MakeTestDataset(n, ...).
constexpr const char* kPrelude = R"(
import h5py, numpy as np
def arrays(n):
    i = np.arange(float(n))
    obs = lambda i: 0.1 * i[:, None] + np.arange(3)
    return {'observations': obs(i), 'next_observations': obs(i + 1), 'actions': ((i % 8) / 8)[:, None] - np.arange(2),
            'rewards': i / 4, 'terminals': np.zeros(n, bool), 'timeouts': np.zeros(n, bool),
            'infos/qpos': 0.3 * i[:, None] - np.arange(2), 'infos/qvel': (i / 3)[:, None]}
def write(path, data, **options):
    with h5py.File(path, 'w') as f:
        for name, value in data.items():
            f.create_dataset(name, data=value, **options)
)";

std::string Script(const std::string& body) { return kPrelude + body; }

std::string ReadMessage(const std::string& path) {
  return MessageOf<DataError>([&] { ReadD4rlHdf5(path); });
}

TEST(D4rlHdf5, ReadsD4rlV2AsH5pyWritesIt) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
a = arrays(40)
a['terminals'][[19, 39]] = True
a['timeouts'][[9, 29]] = True
a['metadata/algorithm'] = np.bytes_('SAC')
a['infos/action_log_probs'] = np.zeros(40, 'f4')
write('gzip.hdf5', {k: v for k, v in a.items() if k != 'metadata/algorithm'}, compression='gzip')
write('contiguous.hdf5', a)
write('f4.hdf5', {k: v.astype('f4') if v.dtype == 'f8' else v for k, v in a.items()})
)"),
                        folder));
  const Dataset expected = MakeTestDataset(40, 10);
  EXPECT_TRUE(SameTransitions(ReadD4rlHdf5(folder / "gzip.hdf5"), expected));
  EXPECT_TRUE(SameTransitions(ReadD4rlHdf5(folder / "contiguous.hdf5"), expected));
  const Dataset narrow = ReadD4rlHdf5(folder / "f4.hdf5");
  EXPECT_EQ(narrow.observations(7, 0), static_cast<double>(static_cast<float>(expected.observations(7, 0))));
  EXPECT_EQ(narrow.qvel(7, 0), static_cast<double>(7 / 3.0f));
}

TEST(D4rlHdf5, InfersTimeoutsAndSuccessorsOfV0Files) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
a = arrays(2500)
a['terminals'][[99, 1100]] = True
write('v0.hdf5', {k: a[k] for k in ['observations', 'actions', 'rewards', 'terminals']})
)"),
                        folder));
  const Dataset read = ReadD4rlHdf5(folder / "v0.hdf5");
  // Episodes [0, 100) and [1100, 1101) end in terminals, [100, 1100) and [1101, 2101) after 1,000 rows, the last with
  // the file. Each loses its last row, and the one of a single row is gone.
  const std::vector<Episode> episodes = read.Episodes();
  ASSERT_EQ(read.size(), 2500 - 5);
  ASSERT_EQ(episodes.size(), 4u);
  const int sizes[] = {99, 999, 999, 398};
  const int starts[] = {0, 100, 1101, 2101};
  for (int e = 0; e < 4; ++e) {
    EXPECT_EQ(episodes[e].size(), sizes[e]);
    EXPECT_FALSE(episodes[e].terminated);
    for (int i = 0; i < sizes[e]; ++i) {
      const int row = starts[e] + i;
      ASSERT_EQ(read.observations(episodes[e].begin + i, 0), 0.1 * row);
      ASSERT_EQ(read.next_observations(episodes[e].begin + i, 0), 0.1 * (row + 1));
      ASSERT_EQ(read.rewards[episodes[e].begin + i], row / 4.0);
    }
  }
  EXPECT_FALSE(read.has_states());
  EXPECT_THAT(read.remarks, testing::ElementsAre(HasSubstr("cut after 1000 rows"), HasSubstr("of the 5 episodes")));

  // A task with another time limit says so.
  DataOptions options;
  options.max_episode_steps = 500;
  const Dataset shorter = ReadDataset(folder / "v0.hdf5", options);
  EXPECT_EQ(shorter.Episodes().size(), 6u);
  EXPECT_EQ(shorter.Episodes()[1].size(), 499);
}

TEST(D4rlHdf5, AcceptsColumnVectorsAndFlagsOfAnyType) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
a = arrays(20)
a['rewards'] = a['rewards'][:, None].astype('f4')
a['terminals'] = (np.arange(20) == 19)[:, None].astype('f4')
a['timeouts'] = (np.arange(20) == 9).astype('u1')
write('columns.hdf5', a)
)"),
                        folder));
  EXPECT_TRUE(SameTransitions(ReadD4rlHdf5(folder / "columns.hdf5"), MakeTestDataset(20, 10)));
}

TEST(D4rlHdf5, H5pyReadsWhatWeWroteExactly) {
  const TestFolder folder;
  WriteD4rlHdf5(MakeTestDataset(30000, 500), folder / "ours.hdf5");
  EXPECT_TRUE(RunPython(Script(R"(
a = arrays(30000)
i = np.arange(30000)
last = i % 500 == 499
a['terminals'] = last & (i // 500 % 2 == 1)
a['timeouts'] = last & ~a['terminals']
# Eighths and quarters fit in float32, tenths and thirds do not.
types = {k: v.dtype for k, v in a.items()} | {'actions': np.dtype('f4'), 'rewards': np.dtype('f4')}
with h5py.File('ours.hdf5') as f:
    names = []
    f.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    assert sorted(names) == sorted(a), names
    for name, value in a.items():
        assert f[name].dtype == types[name], (name, f[name].dtype)
        assert f[name].compression == 'gzip', name
        assert f[name].shape == value.shape and (f[name][()] == value).all(), name
)"),
                        folder));
}

TEST(D4rlHdf5, GivesBackWhatWasWrittenAndWritesEqualBytes) {
  const TestFolder folder;
  const Dataset dataset = MakeTestDataset(3000, 70);
  WriteD4rlHdf5(dataset, folder / "a.hdf5");
  WriteD4rlHdf5(dataset, folder / "b.hdf5");
  EXPECT_TRUE(SameTransitions(ReadD4rlHdf5(folder / "a.hdf5"), dataset));
  EXPECT_EQ(Sha256OfFile(folder / "a.hdf5"), Sha256OfFile(folder / "b.hdf5"));
}

TEST(D4rlHdf5, ValuesBeyondFloat32AreKept) {
  const TestFolder folder;
  Dataset dataset = MakeTestDataset(20, 10);
  dataset.actions(3, 0) = 1e-60;
  dataset.rewards[5] = 1e-300;
  WriteD4rlHdf5(dataset, folder / "a.hdf5");
  EXPECT_TRUE(SameTransitions(ReadD4rlHdf5(folder / "a.hdf5"), dataset));
}

TEST(D4rlHdf5, WrongShapesAndTypesNameTheField) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
def vary(path, **changes):
    a = arrays(20)
    for name, value in changes.items():
        name = name.replace('__', '/')
        if value is None: del a[name]
        else: a[name] = value
    write(path, a)
vary('no_actions', actions=None)
vary('no_qvel', infos__qvel=None)
vary('images', observations=np.zeros((20, 8, 8, 3)))
vary('short', rewards=np.zeros(19))
vary('wide', rewards=np.zeros((20, 2)))
vary('narrow_next', next_observations=np.zeros((20, 2)))
vary('flag', terminals=np.full(20, 0.5))
vary('nan_flag', timeouts=np.full(20, np.nan))
vary('text', actions=np.full(20, b'x'))
vary('scalar', rewards=1.0)
vary('rows', observations=np.zeros((0, 3)))
vary('group', observations=None, observations__position=np.zeros((20, 2)))
write('minari', {'episode_0/observations': np.zeros((3, 2)), 'episode_0/actions': np.zeros((2, 1))})
)"),
                        folder));
  const auto message = [&](const char* name) { return ReadMessage(folder / name); };
  EXPECT_THAT(message("no_actions"),
              AllOf(HasSubstr("no_actions' has no 'actions'"), HasSubstr("D4RL's layout needs")));
  EXPECT_THAT(message("no_qvel"), HasSubstr("only one of infos/qpos"));
  EXPECT_THAT(message("images"), HasSubstr("observations has shape (20, 8, 8, 3)"));
  EXPECT_THAT(message("short"), HasSubstr("rewards has shape (19), wanted 20 rows"));
  EXPECT_THAT(message("wide"), HasSubstr("rewards has shape (20, 2), wanted (N) or (N, 1)"));
  EXPECT_THAT(message("narrow_next"), HasSubstr("next_observations has 2 columns"));
  EXPECT_THAT(message("flag"), HasSubstr("terminals[0] is 0.5, wanted 0 or 1"));
  EXPECT_THAT(message("nan_flag"), HasSubstr("timeouts[0] is nan"));
  EXPECT_THAT(message("text"), HasSubstr("actions does not hold numbers"));
  EXPECT_THAT(message("scalar"), HasSubstr("rewards is not an array"));
  EXPECT_THAT(message("rows"), HasSubstr("observations has shape (0, 3)"));
  EXPECT_THAT(message("group"), HasSubstr("observations is not an array"));
  EXPECT_THAT(message("minari"), HasSubstr("Minari"));
}

TEST(D4rlHdf5, FieldsThatClaimMoreThanTheFileHoldsAreRefused) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
def claim(path, shape, **options):
    a = arrays(20)
    del a['observations']
    write(path, a)
    with h5py.File(path, 'a') as f:
        f.create_dataset('observations', shape=shape, dtype='f8', **options)
claim('contiguous', (10**9, 3))
claim('chunked', (10**9, 3), chunks=(1000, 3), compression='gzip')
claim('huge', (2**62, 2**62), chunks=(1000, 3))
claim('external', (20, 3), external=[('values.bin', 0, 480)])
claim('lzf', (20, 3), chunks=(20, 3), compression='lzf')
claim('bomb', (12 * 10**6, 3), chunks=(10**6, 3), compression='gzip', data=np.zeros((12 * 10**6, 3)))
write('links', arrays(20))
with h5py.File('links', 'a') as f:
    del f['rewards']
    f['rewards'] = h5py.ExternalLink('contiguous', 'rewards')
layout = h5py.VirtualLayout(shape=(20, 3), dtype='f8')
layout[:] = h5py.VirtualSource('links', 'observations', shape=(20, 3))
write('virtual', arrays(20))
with h5py.File('virtual', 'a') as f:
    del f['observations']
    f.create_virtual_dataset('observations', layout)
)"),
                        folder));
  const auto message = [&](const char* name) { return ReadMessage(folder / name); };
  EXPECT_THAT(message("contiguous"), HasSubstr("claims 24000000000 bytes but stores 0"));
  EXPECT_THAT(message("chunked"), HasSubstr("claims 24000000000 bytes but stores 0"));
  EXPECT_THAT(message("huge"), HasSubstr("claims more than 64 GiB"));
  EXPECT_THAT(message("external"), HasSubstr("observations keeps its values in another file"));
  EXPECT_THAT(message("lzf"), HasSubstr("HDF5 filter 32000"));
  EXPECT_THAT(message("bomb"), HasSubstr("observations brings the file's numbers to 288000000 bytes"));
  EXPECT_THAT(message("links"), HasSubstr("rewards is a link to another file"));
  EXPECT_THAT(message("virtual"), HasSubstr("observations is a view of other files"));
}

TEST(D4rlHdf5, TruncatedAndForeignFilesAreDataErrorsAndPrintNothing) {
  const TestFolder folder;
  WriteD4rlHdf5(MakeTestDataset(200, 50), folder / "good.hdf5");
  const std::string good = ReadFile(folder / "good.hdf5");
  testing::internal::CaptureStderr();
  for (int i = 0; i < 40; ++i) {
    WriteFileAtomically(folder / "cut.hdf5", good.substr(0, good.size() * static_cast<size_t>(i) / 40));
    EXPECT_THAT(ReadMessage(folder / "cut.hdf5"), HasSubstr("cut.hdf5'"));
  }
  WriteFileAtomically(folder / "text.hdf5", std::string(4096, 'x'));
  EXPECT_THAT(ReadMessage(folder / "text.hdf5"), HasSubstr("is not an HDF5 file"));
  std::filesystem::create_directory(folder / "folder.hdf5");
  EXPECT_THAT(ReadMessage(folder / "folder.hdf5"), HasSubstr("folder.hdf5'"));
  EXPECT_THAT(ReadMessage(folder / "missing.hdf5"), HasSubstr("missing.hdf5'"));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(D4rlHdf5, AFailedWriteLeavesNothingBehind) {
  const TestFolder folder;
  // A folder cannot be replaced by a file.
  const std::string target = folder / "taken.hdf5";
  std::filesystem::create_directories(target + "/inside");
  EXPECT_THROW(WriteD4rlHdf5(MakeTestDataset(10, 5), target), DataError);
  WriteFileAtomically(folder / "file", "x");
  EXPECT_THROW(WriteD4rlHdf5(MakeTestDataset(10, 5), folder / "file/below.hdf5"), DataError);
  int entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++entries;
  EXPECT_EQ(entries, 2);
}

TEST(D4rlHdf5, ThreadsMayReadAndWriteAtOnce) {
#if defined(__SANITIZE_ADDRESS__)
  // glibc hands a forked child a usable allocator; GCC 12's sanitizer does not when another thread was inside its own.
  GTEST_SKIP() << "the address sanitizer's allocator does not survive a fork beside busy threads";
#endif
  const TestFolder folder;
  const Dataset dataset = MakeTestDataset(500, 50);
  std::vector<int> same(4, 0);
  {
    std::vector<std::jthread> threads;
    for (size_t t = 0; t < same.size(); ++t) {
      threads.emplace_back([&, t] {
        const std::string path = folder / (std::to_string(t) + ".hdf5");
        for (int i = 0; i < 5; ++i) {
          WriteD4rlHdf5(dataset, path);
          same[t] += SameTransitions(ReadD4rlHdf5(path), dataset);
        }
      });
    }
  }
  EXPECT_EQ(same, std::vector<int>(4, 5));
}

}  // namespace oted::d4rl_hdf5_test
