#include "tests/fuzz/fuzzing.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/config/run_config.h"
#include "oted/data/csv_dataset.h"
#include "oted/data/csv_dataset_write.h"
#include "oted/data/d4rl_hdf5.h"
#include "oted/data/dataset.h"
#include "oted/data/dataset_files.h"
#include "oted/data/gzip.h"
#include "oted/data/libhdf5/handles.h"
#include "oted/data/minari.h"
#include "oted/data/npy.h"
#include "oted/data/npz.h"
#include "oted/data/zip.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/report/gather.h"
#include "oted/report/sample_run.h"
#include "tests/fuzz/fuzz_models.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

Dataset SmallDataset(int n, int episode) {
  Dataset d;
  for (int i = 0; i < n; ++i) {
    d.observations.AppendRow(std::vector<double>{0.1 * i, 1.0 + i, -2.0 * i});
    d.next_observations.AppendRow(std::vector<double>{0.1 * (i + 1), 2.0 + i, -2.0 * (i + 1)});
    d.actions.AppendRow(std::vector<double>{(i % 8) / 8.0, 0.5});
    d.qpos.AppendRow(std::vector<double>{0.3 * i});
    d.qvel.AppendRow(std::vector<double>{i / 3.0});
    d.rewards.push_back(i / 4.0);
    const bool last = i % episode == episode - 1;
    d.terminals.push_back(last && (i / episode) % 2 == 1);
    d.timeouts.push_back(last && !d.terminals.back());
  }
  return d;
}

/// D4RL's v0 layout as h5py writes it without options: contiguous, (N, 1) rewards, float flags.
void WriteV0(const fs::path& path, const Dataset& d) {
  const Hdf5Session session;
  const Hdf5Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
  const auto write = [&](const char* name, const Array2<double>& m) {
    const hsize_t dims[2] = {static_cast<hsize_t>(m.rows()), static_cast<hsize_t>(m.cols())};
    const Hdf5Handle space(H5Screate_simple(2, dims, nullptr), H5Sclose);
    const Hdf5Handle array(
        H5Dcreate2(file.id(), name, H5T_IEEE_F32LE, space.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
    OTED_CHECK(H5Dwrite(array.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, m.data()) >= 0);
  };
  Array2<double> rewards, terminals;
  for (int i = 0; i < d.size(); ++i) {
    rewards.AppendRow(std::vector<double>{d.rewards[static_cast<size_t>(i)]});
    terminals.AppendRow(std::vector<double>{static_cast<double>(d.terminals[static_cast<size_t>(i)])});
  }
  write("observations", d.observations);
  write("actions", d.actions);
  write("rewards", rewards);
  write("terminals", terminals);
}

/// A child that hangs is stopped early here: mutants are small and many.
DataOptions Options() {
  DataOptions options;
  options.hdf5_limits.cpu_s = 2;
  options.hdf5_limits.wall_s = 20;
  return options;
}

FuzzFormat DatasetFormat(const std::string& name, const std::string& file) {
  FuzzFormat format;
  format.name = name;
  format.file = file;
  format.names = {file};
  format.read = [file](const fs::path& folder) { ReadDataset((folder / file).string(), Options()); };
  return format;
}

/// The same archive with its first member replaced.
std::function<std::string(const std::string&)> ZipWith(const std::string& archive) {
  return [archive](const std::string& content) {
    std::map<std::string, std::string> members = ParseZip(archive, "seed");
    members.begin()->second = content;
    return ZipBytes(members);
  };
}

}  // namespace

std::vector<FuzzFormat> FuzzFormats(const fs::path& folder) {
  fs::create_directories(folder);
  const Dataset small = SmallDataset(40, 10), large = SmallDataset(3000, 100);
  std::vector<FuzzFormat> formats;
  const auto bytes = [&](const std::string& file) { return ReadFile(folder / file); };

  FuzzFormat v2 = DatasetFormat("d4rl-v2", "v2.hdf5");
  for (const Dataset* d : {&small, &large}) {
    WriteD4rlHdf5(*d, (folder / "v2.hdf5").string());
    v2.seeds.push_back(bytes("v2.hdf5"));
  }
  formats.push_back(v2);

  FuzzFormat v0 = DatasetFormat("d4rl-v0", "v0.hdf5");
  for (const Dataset* d : {&small, &large}) {
    WriteV0(folder / "v0.hdf5", *d);
    v0.seeds.push_back(bytes("v0.hdf5"));
  }
  formats.push_back(v0);

  WriteOptions minari_options;
  minari_options.environment = "Hopper-v5";
  fs::remove_all(folder / "set-v0");
  WriteMinari(small, (folder / "set-v0").string(), minari_options);
  FuzzFormat minari = DatasetFormat("minari", "set-v0/data/main_data.hdf5");
  minari.seeds = {bytes(minari.file)};
  formats.push_back(minari);

  fs::copy(folder / "set-v0", folder / "meta-v0", fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  FuzzFormat metadata = DatasetFormat("minari-metadata", "meta-v0/data/metadata.json");
  metadata.seeds = {bytes(metadata.file)};
  metadata.is_text = true;
  metadata.names.push_back("main_data.hdf5");
  metadata.read = [](const fs::path& f) { ReadDataset((f / "meta-v0").string(), Options()); };
  formats.push_back(metadata);

  FuzzFormat npz = DatasetFormat("npz", "set.npz");
  WriteDatasetNpz(small, (folder / "set.npz").string());
  npz.seeds = {bytes("set.npz")};
  npz.inner_seeds = {NpyBytes(NpyArray(small.actions)), NpyBytes(NpyArray(std::vector<int64_t>(40, 1)))};
  npz.pack = ZipWith(npz.seeds[0]);
  formats.push_back(npz);

  FuzzFormat npy;
  npy.name = "npy";
  npy.file = "array.npy";
  npy.names = {npy.file};
  npy.seeds = {NpyBytes(NpyArray(large.actions)), NpyBytes(NpyArray(std::vector<uint8_t>(7, 1)))};
  npy.read = [](const fs::path& f) {
    const std::string path = (f / "array.npy").string();
    ParseNpy(ReadFile(path), fmt::format("'{}'", path));
  };
  formats.push_back(npy);

  FuzzFormat csv = DatasetFormat("csv", "log.csv");
  Dataset named = small;
  named.observation_names = {"x", "a,b", "\"q\""};
  named.period_s = 0.02;
  WriteCsv(named, (folder / "log.csv").string());
  csv.seeds = {bytes("log.csv"), "t,obs0,act0,terminal\r\n0,1,2,0\r\n0.1,1,2,0\r\n0.2,3,4,1\r\n0,1,2,0\r\n0.1,2,,\r\n"};
  csv.is_text = true;
  csv.read = [](const fs::path& f) {
    DataOptions options = Options();
    options.control_period_s = 0.1;
    options.action_delay = 1;
    ReadDataset((f / "log.csv").string(), options);
  };
  formats.push_back(csv);

  FuzzFormat gz = DatasetFormat("csv.gz", "log.csv.gz");
  gz.seeds = {Gzip(csv.seeds[0])};
  gz.inner_seeds = csv.seeds;
  gz.is_text = true;
  gz.pack = Gzip;
  formats.push_back(gz);

  FuzzFormat policy;
  policy.name = "policy";
  policy.file = "policy.npz";
  policy.names = {policy.file};
  TanhGaussianPolicy(Normalizer{{0, 0, 0}, {1, 1, 1}}, {4}, {-1, -1}, {1, 1}).Save(folder / "policy.npz");
  policy.seeds = {bytes("policy.npz")};
  policy.inner_seeds = {NpyBytes(NpyArray(std::vector<double>{-1, -1}))};
  policy.pack = ZipWith(policy.seeds[0]);
  policy.read = [](const fs::path& f) { TanhGaussianPolicy::Load(f / "policy.npz"); };
  formats.push_back(policy);

  FuzzFormat discriminator;
  discriminator.name = "discriminator";
  discriminator.file = "discriminator.npz";
  discriminator.names = {discriminator.file};
  DiscriminatorConfig g_options;
  g_options.hidden = {4};
  Rng g_rng(1);
  const Discriminator g(small.observations, g_options, g_rng);
  NpzArrays g_arrays;
  g.Save(g_arrays);
  WriteNpz(g_arrays, folder / discriminator.file);
  discriminator.seeds = {bytes(discriminator.file)};
  discriminator.inner_seeds = {NpyBytes(g_arrays.begin()->second)};
  discriminator.pack = ZipWith(discriminator.seeds[0]);
  discriminator.read = [g](const fs::path& f) {
    Discriminator read = g;
    read.Restore(ReadNpz(f / "discriminator.npz"), (f / "discriminator.npz").string());
  };
  formats.push_back(discriminator);

  RunConfig config;
  config.task.name = "Hopper-v5";
  config.data.path = "demos.hdf5";
  config.data.columns.observations = {"a", "b"};
  ParameterSpec friction;
  friction.name = "friction";
  friction.field = "geom/*/friction[0]";
  friction.low = 0.2;
  friction.high = 2;
  ParameterSpec gravity = friction;
  gravity.name = "gravity";
  gravity.field = "opt/gravity[2]";
  config.parameters = {friction, gravity};
  config.truth = {{"friction", 1.0}, {"gravity", 1.1}};
  config.settings["a"] = config.design;

  FuzzFormat q;
  q.name = "q.json";
  q.file = "q.json";
  q.names = {q.file};
  const ParameterSpace space(config.parameters);
  Designer with_prior(space, 1.0);
  with_prior.SetPrior(
      Prior::Gaussian(Eigen::VectorXd::Ones(space.size()), Eigen::MatrixXd::Identity(space.size(), space.size())));
  q.seeds = {Designer(space, 1.0).ToJson(0.1).dump(2), with_prior.ToJson(0.1).dump(2)};
  q.is_text = true;
  q.read = [space](const fs::path& f) { Designer::FromJson(ReadJson(f / "q.json"), space, (f / "q.json").string()); };
  formats.push_back(q);

  FuzzFormat toml;
  toml.name = "run.toml";
  toml.file = "run.toml";
  toml.names = {toml.file};
  toml.seeds = {config.ToToml(),
                "[task]\nname = \"Hopper-v5\"\n[data]\npath = 'a.csv'\n[parameters]\ng = { field = "
                "\"opt/gravity[2]\", range = [0.2, 2.0] }\n"};
  toml.is_text = true;
  toml.read = [](const fs::path& f) { RunConfig::FromTomlFile((f / "run.toml").string()); };
  formats.push_back(toml);

  SampleRun(folder / "run").WriteAll();
  for (const char* file : {"design.json", "evaluation.json", "dataset.json", "clone/clone.json", "clone/curves.csv"}) {
    FuzzFormat run;
    run.name = std::string("report: ") + file;
    // Of its own for each: a mutant is not to meet another one's damage.
    const std::string dir = "run-" + fs::path(file).stem().string() + fs::path(file).extension().string();
    fs::copy(folder / "run", folder / dir, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
    run.file = dir + "/" + file;
    run.names = {run.file};
    run.seeds = {bytes("run/" + std::string(file))};
    run.is_text = true;
    run.read = [dir](const fs::path& f) { GatherReport(f / dir); };
    formats.push_back(run);
  }
  AddModelFormats(folder, formats);
  return formats;
}

std::string Mutate(const std::string& content, const std::string& other, bool is_text, Rng& rng) {
  std::string bytes = content;
  const auto at = [&] { return bytes.empty() ? 0 : static_cast<size_t>(rng.Below(bytes.size())); };
  const auto random_bytes = [&](size_t n) {
    std::string block(n, '\0');
    for (char& c : block) c = static_cast<char>(rng.Below(256));
    return block;
  };
  // Small blocks mostly, now and then a large one.
  const auto block_size = [&] { return static_cast<size_t>(1 + rng.Below(uint64_t{1} << rng.Below(12))); };
  static const std::vector<std::string> kTokens = {"nan",
                                                   "-inf",
                                                   "1e999",
                                                   ",",
                                                   "\"",
                                                   "\n",
                                                   "\r",
                                                   ";",
                                                   "[[[[[[[[",
                                                   "{{{{",
                                                   "}",
                                                   "]",
                                                   "null",
                                                   "true",
                                                   "-1",
                                                   "0",
                                                   "''",
                                                   "\\u",
                                                   "#",
                                                   "=",
                                                   ".",
                                                   "\t",
                                                   "e",
                                                   "\xFF",
                                                   "\xEF\xBB\xBF",
                                                   "99999999999999999999",
                                                   "-",
                                                   "+",
                                                   "0x10"};
  const uint64_t n_changes = 1 + rng.Below(uint64_t{1} << rng.Below(5));
  for (uint64_t change = 0; change < n_changes; ++change) {
    switch (rng.Below(is_text ? 9 : 8)) {
      case 0:
        if (!bytes.empty()) bytes[at()] ^= static_cast<char>(1 << rng.Below(8));
        break;
      case 1:
        if (!bytes.empty()) bytes[at()] = static_cast<char>(rng.Below(256));
        break;
      case 2:
        // Rarely: what is cut off cannot be damaged in another way.
        if (rng.Below(4) == 0) bytes.resize(at());
        break;
      case 3:
        bytes.insert(at(), random_bytes(block_size()));
        break;
      case 4:
        if (!bytes.empty()) bytes.erase(at(), block_size());
        break;
      case 5: {
        const std::string block = bytes.substr(at(), block_size());
        const size_t to = at();
        if (rng.Below(2) == 0) {
          bytes.insert(to, block);
        } else {
          bytes.replace(to, std::min(block.size(), bytes.size() - to), block);
        }
        break;
      }
      case 6: {
        if (other.empty()) break;
        const std::string block = other.substr(static_cast<size_t>(rng.Below(other.size())), block_size());
        const size_t to = at();
        bytes.replace(to, std::min(block.size(), bytes.size() - to), block);
        break;
      }
      case 7: {
        const size_t width = size_t{2} << rng.Below(3);
        if (bytes.size() < width) break;
        // Lengths lie at even places, mostly at multiples of their width.
        size_t to = std::min(at(), bytes.size() - width);
        if (rng.Below(4) != 0) to -= to % width;
        uint64_t value = 0;
        std::memcpy(&value, bytes.data() + to, width);
        const uint64_t lengths[] = {0,
                                    1,
                                    ~uint64_t{0},
                                    0x7FFFFFFF,
                                    0x80000000,
                                    uint64_t{1} << 40,
                                    uint64_t{1} << 63,
                                    bytes.size(),
                                    bytes.size() - to,
                                    value + 1,
                                    value - 1,
                                    value * 2,
                                    value << 16,
                                    rng.Next()};
        value = lengths[rng.Below(std::size(lengths))];
        std::memcpy(bytes.data() + to, &value, width);
        break;
      }
      default: {
        std::string token = kTokens[rng.Below(kTokens.size())];
        if (rng.Below(16) == 0) {
          std::string many;
          for (uint64_t i = 0, n = 1 + rng.Below(5000); i < n; ++i) many += token;
          token = many;
        }
        bytes.insert(at(), token);
      }
    }
  }
  return bytes;
}

std::string MakeMutant(const FuzzFormat& format, RngKey key) {
  Rng rng = key.MakeRng();
  const bool inner = format.pack && rng.Below(2) == 0;
  const std::vector<std::string>& seeds = inner ? format.inner_seeds : format.seeds;
  const std::string& content = seeds[rng.Below(seeds.size())];
  const std::string& other = seeds[rng.Below(seeds.size())];
  const std::string mutant = Mutate(content, other, format.is_text && (inner || !format.pack), rng);
  return inner ? format.pack(mutant) : mutant;
}

FuzzResult ReadMutant(const FuzzFormat& format, const fs::path& folder, const std::string& mutant) {
  // Not atomically: it need not survive anything, and waiting for the disk would be most of the time.
  std::ofstream(folder / format.file, std::ios::binary) << mutant;
  const auto judge = [&](const std::string& message) -> FuzzResult {
    const bool named = std::ranges::any_of(
        format.names, [&](const std::string& name) { return message.find(name) != std::string::npos; });
    if (!named) return {FuzzOutcome::kFailed, "the error does not name the file: " + message};
    if (message.find('\n') != std::string::npos) return {FuzzOutcome::kFailed, "the error is not one line: " + message};
    const bool died = message.find(": reading it ") != std::string::npos;
    return {died ? FuzzOutcome::kChildDied : FuzzOutcome::kRefused, message};
  };
  try {
    format.read(folder);
    return {FuzzOutcome::kRead, ""};
  } catch (const DataError& e) {
    return judge(e.what());
  } catch (const UsageError& e) {
    return judge(e.what());
  } catch (const std::exception& e) {
    return {FuzzOutcome::kFailed, std::string("another exception: ") + e.what()};
  }
}

}  // namespace oted
