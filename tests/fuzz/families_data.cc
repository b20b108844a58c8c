// Logs: HDF5, Minari, npz, CSV; and the arrays and curves of a run in the same containers.

#include <hdf5.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/csv_dataset_write.h"
#include "oted/data/d4rl_hdf5.h"
#include "oted/data/dataset.h"
#include "oted/data/dataset_files.h"
#include "oted/data/gzip.h"
#include "oted/data/libhdf5/handles.h"
#include "oted/data/log_columns.h"
#include "oted/data/minari.h"
#include "oted/data/npy.h"
#include "oted/data/npz.h"
#include "oted/data/zip.h"
#include "oted/matching/discriminator.h"
#include "oted/nn/policy.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/report/curves.h"
#include "tests/fuzz/families.h"

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

/// A child that hangs is stopped early here: inputs are small and many.
DataOptions Options() {
  DataOptions options;
  options.hdf5_limits.cpu_s = 2;
  options.hdf5_limits.wall_s = 20;
  return options;
}

FuzzReader DatasetReader(const std::string& file) {
  return {file, [file](const fs::path& folder) { ReadDataset((folder / file).string(), Options()); }};
}

FuzzFamily Hdf5Family(const fs::path& folder, const Dataset& small) {
  FuzzFamily family{.name = "hdf5"};
  const auto seed = [&](const std::string& file) { family.seeds.push_back(ReadFile(folder / file)); };
  WriteD4rlHdf5(small, (folder / "d4rl.hdf5").string());
  seed("d4rl.hdf5");
  WriteV0(folder / "d4rl.hdf5", small);
  seed("d4rl.hdf5");
  WriteOptions options;
  options.environment = "Hopper-v5";
  fs::remove_all(folder / "set-v0");
  WriteMinari(small, (folder / "set-v0").string(), options);
  seed("set-v0/data/main_data.hdf5");
  family.readers = {DatasetReader("d4rl.hdf5"), DatasetReader("set-v0/data/main_data.hdf5")};
  for (FuzzReader& reader : family.readers) reader.in_child = true;
  return family;
}

/// The folder of a Minari set around a main_data.hdf5 that is whole.
FuzzFamily MinariFamily(const fs::path& folder, const Dataset& small) {
  FuzzFamily family{.name = "minari"};
  fs::remove_all(folder / "meta-v0");
  WriteMinari(small, (folder / "meta-v0").string(), {});
  const std::string file = "meta-v0/data/metadata.json";
  family.seeds = {ReadFile(folder / file)};
  family.readers = {
      {file, [](const fs::path& f) { ReadDataset((f / "meta-v0").string(), Options()); }, {"main_data.hdf5"}}};
  return family;
}

FuzzFamily NpzFamily(const fs::path& folder, const Dataset& small) {
  FuzzFamily family{.name = "npz", .mutate_inside = MutateZipMember};
  WriteDatasetNpz(small, (folder / "set.npz").string());
  TanhGaussianPolicy(Normalizer{{0, 0, 0}, {1, 1, 1}}, {4}, {-1, -1}, {1, 1}).Save(folder / "policy.npz");
  DiscriminatorConfig config;
  config.hidden = {4};
  Rng rng(1);
  const Discriminator discriminator(small.observations, config, rng);
  NpzArrays arrays;
  discriminator.Save(arrays);
  WriteNpz(arrays, folder / "discriminator.npz");
  for (const char* file : {"set.npz", "policy.npz", "discriminator.npz"})
    family.seeds.push_back(ReadFile(folder / file));
  family.seeds.push_back(
      NpzBytes({{"weights", NpyArray(std::vector<double>{1, 2, 3})}, {"step", NpyArray(std::vector<int64_t>{7})}}));
  family.readers = {
      DatasetReader("set.npz"),
      {"policy.npz", [](const fs::path& f) { LoadPolicy(f / "policy.npz"); }},
      {"discriminator.npz",
       [discriminator](const fs::path& f) {
         Discriminator read = discriminator;
         read.Restore(ReadNpz(f / "discriminator.npz"), (f / "discriminator.npz").string());
       }},
      {"checkpoint.npz", [](const fs::path& f) { ReadCheckpoint(f / "checkpoint.npz"); }},
  };
  return family;
}

/// One array, as every member of an npz is read.
FuzzFamily NpyFamily(const Dataset& small) {
  FuzzFamily family{.name = "npy"};
  family.seeds = {NpyBytes(NpyArray(small.actions)), NpyBytes(NpyArray(std::vector<uint8_t>(7, 1))),
                  NpyBytes(NpyArray(std::vector<int64_t>(4, 1)))};
  family.readers = {{"array.npy", [](const fs::path& f) {
                       const std::string path = (f / "array.npy").string();
                       ParseNpy(ReadFile(path), "'" + path + "'");
                     }}};
  return family;
}

std::vector<FuzzReader> CsvReaders(const std::string& ending) {
  const std::string named = "named" + ending, timed = "timed" + ending, columns = "columns" + ending;
  return {DatasetReader("log" + ending),
          {timed,
           [timed](const fs::path& f) {
             DataOptions options = Options();
             options.control_period_s = 0.1;
             options.action_delay = 1;
             ReadDataset((f / timed).string(), options);
           }},
          {named,
           [named](const fs::path& f) {
             DataOptions options = Options();
             options.columns.observations = {"x", "obs0"};
             options.columns.actions = {"act0"};
             options.columns.time = "t";
             ReadDataset((f / named).string(), options);
           }},
          {columns, [columns](const fs::path& f) { ReadLogColumns((f / columns).string()); }}};
}

void AddCsvFamilies(const fs::path& folder, const Dataset& small, std::vector<FuzzFamily>& families) {
  FuzzFamily csv{.name = "csv"};
  Dataset named = small;
  named.observation_names = {"x", "a,b", "\"q\""};
  named.period_s = 0.02;
  WriteCsv(named, (folder / "log.csv").string());
  csv.seeds = {ReadFile(folder / "log.csv"),
               "t,obs0,act0,terminal\r\n0,1,2,0\r\n0.1,1,2,0\r\n0.2,3,4,1\r\n0,1,2,0\r\n0.1,2,,\r\n",
               "step,key,value\n0,a/b,1.5\n1,a/b,nan\n"};
  csv.readers = CsvReaders(".csv");
  csv.readers.push_back({"curves.csv", [](const fs::path& f) { ReadCurves(f / "curves.csv"); }});

  FuzzFamily packed{.name = "csv_gz"};
  for (const std::string& seed : csv.seeds) packed.seeds.push_back(Gzip(seed));
  packed.readers = CsvReaders(".csv.gz");
  packed.mutate_inside = [](const std::string& bytes, uint64_t, const Mutator& mutate) {
    return Gzip(mutate(Gunzip(bytes, "archive")));
  };
  families.push_back(csv);
  families.push_back(packed);
}

}  // namespace

void AddDataFamilies(const fs::path& folder, std::vector<FuzzFamily>& families) {
  const Dataset small = SmallDataset(40, 10);
  families.push_back(Hdf5Family(folder, small));
  families.push_back(MinariFamily(folder, small));
  families.push_back(NpzFamily(folder, small));
  families.push_back(NpyFamily(small));
  AddCsvFamilies(folder, small, families);
}

}  // namespace oted
