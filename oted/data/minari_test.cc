#include "oted/data/minari.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/data/testing.h"

namespace oted::minari_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::string ReadMessage(const std::string& path) {
  return MessageOf<DataError>([&] { ReadDataset(path); });
}

// Minari itself, writing into and reading from the test's folder. MakeTestDataset(40, 10)'s values, episode by episode.
constexpr const char* kPrelude = R"(
import os
os.environ['MINARI_DATASETS_PATH'] = os.getcwd()
import h5py, json, minari, numpy as np
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer
box = lambda n, dtype='float64': spaces.Box(-np.inf, np.inf, (n,), dtype)
def episodes(n=40, episode=10, wrap=lambda o: o, infos=True):
    for e in range(n // episode):
        i = np.arange(float(e * episode), float((e + 1) * episode + 1))
        obs, t = 0.1 * i[:, None] + np.arange(3), i[:-1]
        last = np.arange(episode) == episode - 1
        yield EpisodeBuffer(id=e, seed=e, observations=wrap(obs), actions=((t % 8) / 8)[:, None] - np.arange(2),
            rewards=list(t / 4), terminations=list(last & (e % 2 == 1)), truncations=list(last & (e % 2 == 0)),
            infos={'qpos': 0.3 * i[:, None] - np.arange(2), 'qvel': (i / 3)[:, None], 'note': i} if infos else None)
def create(name, buffers, observations, **options):
    return minari.create_dataset_from_buffers(name, list(buffers), observation_space=observations,
        action_space=box(2), algorithm_name='test', code_permalink='https://example.org', author='A', author_email='a@b', **options)
)";

std::string Script(const std::string& body) { return kPrelude + body; }

TEST(Minari, ReadsWhatMinariWrites) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script("create('test/plain-v0', episodes(), box(3))"), folder));
  const Dataset expected = MakeTestDataset(40, 10);
  const Dataset read = ReadDataset(folder / "test/plain-v0");
  EXPECT_TRUE(SameTransitions(read, expected));
  EXPECT_EQ(read.Episodes().size(), 4u);
  EXPECT_THAT(read.remarks, ElementsAre());
  EXPECT_EQ(read.sha256, Sha256OfDataset(folder / "test/plain-v0"));
  // Its data folder and its file stand for the dataset as well.
  EXPECT_TRUE(SameTransitions(ReadDataset(folder / "test/plain-v0/"), expected));
  EXPECT_TRUE(SameTransitions(ReadDataset(folder / "test/plain-v0/data"), expected));
  EXPECT_TRUE(SameTransitions(ReadDataset(folder / "test/plain-v0/data/main_data.hdf5"), expected));
  std::filesystem::copy_file(folder / "test/plain-v0/data/main_data.hdf5", folder / "alone.hdf5");
  EXPECT_TRUE(SameTransitions(ReadDataset(folder / "alone.hdf5"), expected));
}

TEST(Minari, ADatasetWithOtherMetadataIsAnotherOne) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script("create('test/plain-v0', episodes(), box(3))"), folder));
  const std::string before = ReadDataset(folder / "test/plain-v0").sha256;
  // It says which column is which, for one.
  const std::string metadata = folder / "test/plain-v0/data/metadata.json";
  WriteFileAtomically(metadata, ReadFile(metadata) + " ");
  EXPECT_NE(ReadDataset(folder / "test/plain-v0").sha256, before);
}

TEST(Minari, ElevenEpisodesComeInTheOrderOfTheirNumbers) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script("create('many-v0', episodes(120, 10), box(3))"), folder));
  EXPECT_TRUE(SameTransitions(ReadDataset(folder / "many-v0"), MakeTestDataset(120, 10)));
}

TEST(Minari, NestedSpacesAreFlattenedInTheOrderOfTheirNames) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
wrap = lambda o: {'b': o[:, 2:], 'a': (o[:, 0], o[:, 1:2])}
space = spaces.Dict({'b': box(1), 'a': spaces.Tuple((spaces.Box(-np.inf, np.inf, (), 'float64'), box(1)))})
create('nested-v0', episodes(wrap=wrap, infos=False), space)
eleven = lambda o: tuple(np.full((len(o), 1), float(k)) for k in range(11))
create('tuple-v0', episodes(wrap=eleven, infos=False), spaces.Tuple([box(1)] * 11))
)"),
                        folder));
  const Dataset nested = ReadDataset(folder / "nested-v0");
  EXPECT_THAT(nested.observation_names, ElementsAre("a._index_0", "a._index_1[0]", "b[0]"));
  EXPECT_TRUE(SameTransitions(nested, MakeTestDataset(40, 10, false)));
  const Dataset tuple = ReadDataset(folder / "tuple-v0");
  for (int k = 0; k < 11; ++k) EXPECT_EQ(tuple.observations(0, k), k);
  // Named columns come in the task's order.
  DataOptions options;
  options.observation_names = {"b[0]", "a._index_0", "a._index_1[0]"};
  EXPECT_EQ(ReadDataset(folder / "nested-v0", options).observations(3, 0), nested.observations(3, 2));
}

TEST(Minari, MinariReadsWhatWeWriteExactly) {
  const TestFolder folder;
  Dataset dataset = MakeTestDataset(40, 10);
  WriteOptions options;
  options.environment = "Hopper-v5";
  options.dataset_id = "lab/ours-v3";
  options.action_low = {-1, -2};
  options.action_high = {1, 0.5};
  WriteDataset(dataset, folder / "lab/ours-v3", options);
  dataset.rewards.clear();
  WriteDataset(dataset, folder / "plain-v0");
  EXPECT_TRUE(RunPython(Script(R"(
ours = minari.load_dataset('lab/ours-v3')
assert ours.total_episodes == 4 and ours.total_steps == 40 and ours.spec.dataset_id == 'lab/ours-v3'
assert ours.spec.env_spec.id == 'Hopper-v5' and ours.recover_environment().observation_space.shape == (11,)
assert ours.observation_space == box(3), ours.observation_space
assert ours.action_space == spaces.Box(np.float32([-1, -2]), np.float32([1, 0.5])), ours.action_space
assert ours.storage.metadata['dataset_size'] == ours.storage.get_size()
for ours_e, e in zip(ours.iterate_episodes(), episodes()):
    assert ours_e.id == e.id and ours_e.observations.dtype == 'f8' and ours_e.actions.dtype == 'f4'
    for name in ['observations', 'actions', 'rewards', 'terminations', 'truncations']:
        assert np.array_equal(getattr(ours_e, name), getattr(e, name)), name
    assert np.array_equal(ours_e.infos['qpos'], e.infos['qpos'][:-1])
    assert ours_e.terminations.dtype == bool
assert len(ours.sample_episodes(2)) == 2
plain = minari.MinariDataset('plain-v0/data')
assert plain.spec.env_spec is None and np.isnan(plain[0].rewards).all()
)"),
                        folder));
}

TEST(Minari, GivesBackWhatWasWrittenWithNamesAndPeriod) {
  const TestFolder folder;
  for (const bool with_rewards : {true, false}) {
    Dataset dataset = MakeTestDataset(45, 10, with_rewards, with_rewards);
    dataset.timeouts.back() = 1;
    dataset.observation_names = {"x", "y", "z"};
    dataset.action_names = {"hip", "knee"};
    dataset.period_s = 0.02;
    const std::string path = folder / (with_rewards ? "all-v0" : "few-v0");
    WriteDataset(dataset, path);
    const Dataset read = ReadDataset(path);
    EXPECT_TRUE(SameTransitions(read, dataset));
    EXPECT_EQ(read.observation_names, dataset.observation_names);
    EXPECT_EQ(read.action_names, dataset.action_names);
    EXPECT_EQ(read.period_s, 0.02);
  }
}

TEST(Minari, WhatItsLayoutCannotHoldIsNotWritten) {
  const TestFolder folder;
  Dataset dataset = MakeTestDataset(20, 10);
  WriteDataset(dataset, folder / "a-v0");
  EXPECT_THAT(MessageOf<DataError>([&] { WriteDataset(dataset, folder / "a-v0"); }),
              AllOf(HasSubstr("exists already"), HasSubstr("next version")));
  dataset.next_observations(3, 0) += 1;
  EXPECT_THAT(MessageOf<DataError>([&] { WriteDataset(dataset, folder / "b-v0"); }),
              AllOf(HasSubstr("b-v0"), HasSubstr("next_observations[3] is not observations[4]")));
  int entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++entries;
  EXPECT_EQ(entries, 1);
}

TEST(Minari, OtherFormatsImagesAndDefectsNameFileAndRemedy) {
  const TestFolder folder;
  ASSERT_TRUE(RunPython(Script(R"(
image = spaces.Box(0, 255, (32, 32, 3), 'uint8')
def images(wrap): return list(episodes(wrap=wrap, infos=False))
frames = lambda o: np.zeros((len(o), 32, 32, 3), 'uint8')
create('jpeg-v0', images(frames), image)
create('raw-v0', images(lambda o: {'camera': frames(o), 'state': o}), spaces.Dict(camera=image, state=box(3)), jpeg_encoding=False)
def vary(name, change):
    create(name, episodes(), box(3))
    with h5py.File(f'{name}/data/main_data.hdf5', 'a') as f: change(f)
def replace(f, key, value):
    del f[key]
    if value is not None: f[key] = value
vary('no_actions-v0', lambda f: replace(f, 'episode_2/actions', None))
vary('no_plus_one-v0', lambda f: replace(f, 'episode_1/actions', np.zeros((11, 2))))
vary('widths-v0', lambda f: replace(f, 'episode_1/observations', np.zeros((11, 4))))
vary('flag-v0', lambda f: replace(f, 'episode_1/truncations', np.full(10, 2)))
vary('fewer-v0', lambda f: replace(f, 'episode_3', None))
vary('link-v0', lambda f: replace(f, 'episode_1/actions', h5py.ExternalLink('other.hdf5', 'x')))
vary('soft-v0', lambda f: (replace(f, 'out', h5py.ExternalLink('other.hdf5', '/')) if 'out' in f else f.__setitem__('out', h5py.ExternalLink('other.hdf5', '/')), replace(f, 'episode_1/actions', h5py.SoftLink('/out/x'))))
h5py.File('soft-v0/data/other.hdf5', 'w')['x'] = np.zeros((10, 2))
for format in ['arrow', 'parquet']:
    os.makedirs(f'{format}-v0/data')
    json.dump({'data_format': format, 'total_episodes': 1}, open(f'{format}-v0/data/metadata.json', 'w'))
os.makedirs('empty-v0')
)"),
                        folder));
  const auto message = [&](const char* name) { return ReadMessage(folder / name); };
  EXPECT_THAT(message("jpeg-v0"), AllOf(HasSubstr("episode_0/observations"), HasSubstr("JPEG")));
  // An image as it is comes first, then what goes with it.
  EXPECT_EQ(ReadDataset(folder / "raw-v0").obs_dim(), 32 * 32 * 3 + 3);
  EXPECT_THAT(message("no_actions-v0"), HasSubstr("episode_2/actions is missing"));
  EXPECT_THAT(message("no_plus_one-v0"), HasSubstr("episode_1/actions has shape (11, 2), wanted 10 rows"));
  EXPECT_THAT(message("widths-v0"), HasSubstr("episode_1 has observations of 4"));
  EXPECT_THAT(message("flag-v0"), HasSubstr("[0] is 2, wanted 0 or 1"));
  EXPECT_THAT(message("fewer-v0"), HasSubstr("holds 3 episodes but its metadata.json says 4"));
  EXPECT_THAT(message("link-v0"), HasSubstr("is a link to another file"));
  EXPECT_THAT(message("soft-v0"), HasSubstr("episode_1/actions"));
  EXPECT_THAT(message("arrow-v0"), AllOf(HasSubstr("arrow format"), HasSubstr("data_format=\"hdf5\"")));
  EXPECT_THAT(message("parquet-v0"), HasSubstr("parquet format"));
  EXPECT_THAT(message("empty-v0"), HasSubstr("is a folder without main_data.hdf5"));
  EXPECT_THAT(message("missing-v0"), HasSubstr("is neither a file nor a folder"));
}

TEST(Minari, NamesEndInAVersion) {
  for (const char* name : {"a-v0", "x/a-v0/", "half_cheetah-medium-v12"}) EXPECT_TRUE(IsMinariName(name)) << name;
  for (const char* name : {"a", "a-v", "a-v0.hdf5", "-v0", "a b-v0"}) EXPECT_FALSE(IsMinariName(name)) << name;
}

}  // namespace oted::minari_test
