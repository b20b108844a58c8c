#include "oted/data/d4rl_hdf5.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <span>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/d4rl_layout.h"
#include "oted/data/hdf5_handles.h"

namespace oted {
namespace {

// A byte of deflate holds at most 1,032 bytes; a field that claims more than this per stored byte is damaged.
constexpr uint64_t kMaxCompression = 1100;
// The largest block that libhdf5 may be made to allocate for a chunk whatever the file's size.
constexpr uint64_t kUnsuspiciousBytes = uint64_t{1} << 26;
constexpr uint64_t kMaxFieldBytes = uint64_t{1} << 36;

/// The arrays of an open HDF5 file.
class Hdf5Source : public ArraySource {
 public:
  explicit Hdf5Source(const std::string& path) : path_(path), file_(Open(path)) {
    std::error_code error;
    file_bytes_ = std::filesystem::file_size(path, error);
    if (error) throw DataError(fmt::format("cannot read '{}': {}; check the path", path, error.message()));
  }

  bool Has(const std::string& name) const override {
    // H5Lexists wants every group on the way to exist.
    for (size_t end = name.find('/');; end = name.find('/', end + 1)) {
      const std::string part = name.substr(0, end);
      if (H5Lexists(file_.id(), part.c_str(), H5P_DEFAULT) <= 0) return false;
      H5L_info_t info;
      if (H5Lget_info(file_.id(), part.c_str(), &info, H5P_DEFAULT) < 0) Fail(part, "cannot be looked up", kDamaged);
      if (info.type != H5L_TYPE_HARD && info.type != H5L_TYPE_SOFT) {
        Fail(part, "is a link to another file", "copy that file's content into this one");
      }
      if (end == std::string::npos) return true;
    }
  }

  std::vector<int64_t> Shape(const std::string& name) const override {
    const Hdf5Handle field = OpenField(name);
    const Hdf5Handle type(H5Dget_type(field.id()), H5Tclose);
    const H5T_class_t kind = type.ok() ? H5Tget_class(type.id()) : H5T_NO_CLASS;
    if (kind != H5T_FLOAT && kind != H5T_INTEGER && kind != H5T_ENUM) {
      Fail(name, "does not hold numbers", "store it as float, integer or bool");
    }
    const Hdf5Handle space(H5Dget_space(field.id()), H5Sclose);
    if (!space.ok() || H5Sget_simple_extent_type(space.id()) != H5S_SIMPLE) {
      Fail(name, "is not an array", "store one row per transition");
    }
    hsize_t dims[H5S_MAX_RANK] = {};
    const int rank = H5Sget_simple_extent_dims(space.id(), dims, nullptr);
    if (rank < 1) Fail(name, "has no readable shape", kDamaged);
    unsigned __int128 bytes = H5Tget_size(type.id());
    std::vector<int64_t> shape;
    for (int i = 0; i < rank; ++i) {
      bytes = std::min<unsigned __int128>(bytes * dims[i], kMaxFieldBytes + 1);
      if (dims[i] > static_cast<hsize_t>(std::numeric_limits<int64_t>::max())) bytes = kMaxFieldBytes + 1;
      shape.push_back(static_cast<int64_t>(dims[i]));
    }
    if (bytes > kMaxFieldBytes) Fail(name, "claims more than 64 GiB", kDamaged);
    CheckStorage(name, field, static_cast<uint64_t>(bytes));
    return shape;
  }

  void Read(const std::string& name, std::span<double> out) const override {
    const Hdf5Handle field = OpenField(name);
    const Hdf5Handle space(H5Dget_space(field.id()), H5Sclose);
    OTED_CHECK(H5Sget_simple_extent_npoints(space.id()) == static_cast<hssize_t>(out.size()));
    if (H5Dread(field.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
      Fail(name, "cannot be read", kDamaged);
    }
  }

 private:
  static constexpr const char* kDamaged = "the file is damaged: download or write it again";

  static Hdf5Handle Open(const std::string& path) {
    const htri_t is_hdf5 = H5Fis_hdf5(path.c_str());
    if (is_hdf5 < 0) throw DataError(fmt::format("cannot open '{}'; check the path and its permissions", path));
    if (is_hdf5 == 0) {
      throw DataError(fmt::format("'{}' is not an HDF5 file; give a dataset in D4RL's layout, or .npz", path));
    }
    const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    // Some network file systems know no locks; a reader can do without.
    H5Pset_file_locking(access.id(), true, true);
    Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id()), H5Fclose);
    if (!file.ok()) {
      throw DataError(
          fmt::format("'{}' is an HDF5 file that cannot be opened (truncated, damaged, or still being "
                      "written); download or write it again",
                      path));
    }
    return file;
  }

  [[noreturn]] void Fail(const std::string& name, std::string_view what, std::string_view remedy) const {
    throw DataError(fmt::format("'{}': {} {}; {}", path_, name, what, remedy));
  }

  Hdf5Handle OpenField(const std::string& name) const {
    Hdf5Handle object(H5Oopen(file_.id(), name.c_str(), H5P_DEFAULT), H5Oclose);
    if (!object.ok()) Fail(name, "cannot be opened", kDamaged);
    if (H5Iget_type(object.id()) != H5I_DATASET) {
      Fail(name, "is not an array", "flatten nested spaces into one array, as D4RL's layout wants");
    }
    return object;
  }

  /// Holds what the field claims against what the file stores, so that a damaged header cannot make us allocate.
  void CheckStorage(const std::string& name, const Hdf5Handle& field, uint64_t bytes) const {
    const Hdf5Handle created(H5Dget_create_plist(field.id()), H5Pclose);
    const H5D_layout_t layout = created.ok() ? H5Pget_layout(created.id()) : H5D_LAYOUT_ERROR;
    const uint64_t stored = H5Dget_storage_size(field.id());
    const auto fail_size = [&] {
      Fail(name, fmt::format("claims {} bytes but stores {} in a file of {}", bytes, stored, file_bytes_), kDamaged);
    };
    if (layout == H5D_COMPACT) return;
    if (layout == H5D_CONTIGUOUS) {
      if (H5Pget_external_count(created.id()) != 0) {
        Fail(name, "keeps its values in another file", "copy them into this one");
      }
      const haddr_t offset = H5Dget_offset(field.id());
      const bool fits = stored == bytes && bytes <= file_bytes_ && (bytes == 0 || offset <= file_bytes_ - bytes);
      if (!fits) fail_size();
      return;
    }
    if (layout != H5D_CHUNKED) Fail(name, "is a view of other files", "copy their values into this one");
    CheckFilters(name, created);
    hsize_t chunk[H5S_MAX_RANK] = {};
    const int rank = H5Pget_chunk(created.id(), H5S_MAX_RANK, chunk);
    const Hdf5Handle type(H5Dget_type(field.id()), H5Tclose);
    unsigned __int128 chunk_bytes = H5Tget_size(type.id());
    for (int i = 0; i < rank; ++i) chunk_bytes = std::min<unsigned __int128>(chunk_bytes * chunk[i], kMaxFieldBytes);
    const uint64_t most = stored > file_bytes_ ? 0 : stored * (H5Pget_nfilters(created.id()) > 0 ? kMaxCompression : 1);
    if (bytes > most || chunk_bytes > std::max(most, kUnsuspiciousBytes)) fail_size();
  }

  void CheckFilters(const std::string& name, const Hdf5Handle& created) const {
    const int n_filters = H5Pget_nfilters(created.id());
    for (int i = 0; i < n_filters; ++i) {
      unsigned flags = 0;
      unsigned config = 0;
      size_t n_values = 0;
      const H5Z_filter_t filter =
          H5Pget_filter2(created.id(), static_cast<unsigned>(i), &flags, &n_values, nullptr, 0, nullptr, &config);
      if (filter < 0) Fail(name, "has no readable compression filter", kDamaged);
      if (H5Zfilter_avail(filter) <= 0) {
        Fail(name, fmt::format("is compressed with HDF5 filter {}, which is not built in", static_cast<int>(filter)),
             "write it with compression='gzip'");
      }
    }
  }

  std::string path_;
  Hdf5Handle file_;
  uint64_t file_bytes_ = 0;
};

bool FitsFloat32(std::initializer_list<std::span<const double>> arrays) {
  return std::ranges::all_of(arrays, [](std::span<const double> values) {
    return std::ranges::all_of(values, [](double value) {
      return std::abs(value) <= std::numeric_limits<float>::max() &&
             static_cast<double>(static_cast<float>(value)) == value;
    });
  });
}

/// Writes the arrays of one new file. Every failure names the file that the user asked for.
class Hdf5Writer {
 public:
  Hdf5Writer(const std::string& temporary_path, const std::string& path)
      : path_(path), file_(H5Fcreate(temporary_path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose) {
    if (!file_.ok()) Fail("the file", "is its folder writable?");
  }

  void Group(const char* name) {
    const Hdf5Handle group(H5Gcreate2(file_.id(), name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
    if (!group.ok()) Fail(name, kFull);
  }

  void Numbers(const char* name, const Array2<double>& m, bool as_float32) {
    const hsize_t dims[2] = {static_cast<hsize_t>(m.rows()), static_cast<hsize_t>(m.cols())};
    Write(name, as_float32 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, dims, m.data());
  }

  void Numbers(const char* name, const std::vector<double>& v, bool as_float32) {
    const hsize_t dims[1] = {v.size()};
    Write(name, as_float32 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, dims, v.data());
  }

  /// h5py's bool: an enumeration of FALSE and TRUE over one byte.
  void Flags(const char* name, const std::vector<uint8_t>& flags) {
    const Hdf5Handle type(H5Tenum_create(H5T_STD_I8LE), H5Tclose);
    const int8_t no = 0;
    const int8_t yes = 1;
    if (H5Tenum_insert(type.id(), "FALSE", &no) < 0 || H5Tenum_insert(type.id(), "TRUE", &yes) < 0) Fail(name, kFull);
    std::vector<int8_t> values(flags.size());
    std::ranges::transform(flags, values.begin(), [](uint8_t flag) { return static_cast<int8_t>(flag != 0); });
    const hsize_t dims[1] = {values.size()};
    Write(name, type.id(), type.id(), dims, values.data());
  }

  void Close() {
    if (!file_.Reset()) Fail("the file", kFull);
  }

 private:
  static constexpr const char* kFull = "is the disk full?";

  [[noreturn]] void Fail(const char* what, const char* remedy) const {
    throw DataError(fmt::format("'{}': cannot write {}; {}", path_, what, remedy));
  }

  void Write(const char* name, hid_t file_type, hid_t memory_type, std::span<const hsize_t> dims, const void* values) {
    const int rank = static_cast<int>(dims.size());
    const Hdf5Handle space(H5Screate_simple(rank, dims.data(), nullptr), H5Sclose);
    const Hdf5Handle create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    // Chunks of about 64,000 numbers: small enough for libhdf5's chunk cache, large enough to compress well.
    const hsize_t width = dims.size() == 2 ? dims[1] : 1;
    const hsize_t chunk[2] = {std::clamp<hsize_t>(64000 / width, 1, dims[0]), width};
    const bool prepared = H5Pset_chunk(create.id(), rank, chunk) >= 0 && H5Pset_shuffle(create.id()) >= 0 &&
                          H5Pset_deflate(create.id(), 4) >= 0 && H5Pset_obj_track_times(create.id(), false) >= 0;
    if (!prepared) Fail(name, kFull);
    Hdf5Handle field(H5Dcreate2(file_.id(), name, file_type, space.id(), H5P_DEFAULT, create.id(), H5P_DEFAULT),
                     H5Dclose);
    if (!field.ok()) Fail(name, kFull);
    if (H5Dwrite(field.id(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) Fail(name, kFull);
    if (!field.Reset()) Fail(name, kFull);
  }

  std::string path_;
  Hdf5Handle file_;
};

}  // namespace

Dataset ReadD4rlHdf5(const std::string& path) {
  const Hdf5Session session;
  const Hdf5Source source(path);
  if (!source.Has("observations") && source.Has("episode_0")) {
    throw DataError(
        fmt::format("'{}' is in Minari's layout (one group per episode), wanted D4RL's flat arrays; "
                    "concatenate its episodes first",
                    path));
  }
  return ReadD4rlArrays(source, path);
}

void WriteD4rlHdf5(const Dataset& dataset, const std::string& path) {
  dataset.Check();
  AtomicFile file(path);
  {
    const Hdf5Session session;
    Hdf5Writer writer(file.temporary_path().string(), path);
    const Array2<double>& obs = dataset.observations;
    const Array2<double>& next_obs = dataset.next_observations;
    const bool obs_fit = FitsFloat32({obs.values(), next_obs.values()});
    writer.Numbers("observations", obs, obs_fit);
    writer.Numbers("next_observations", next_obs, obs_fit);
    writer.Numbers("actions", dataset.actions, FitsFloat32({dataset.actions.values()}));
    if (!dataset.rewards.empty()) writer.Numbers("rewards", dataset.rewards, FitsFloat32({dataset.rewards}));
    writer.Flags("terminals", dataset.terminals);
    writer.Flags("timeouts", dataset.timeouts);
    if (dataset.has_states()) {
      const bool states_fit = FitsFloat32({dataset.qpos.values(), dataset.qvel.values()});
      writer.Group("infos");
      writer.Numbers("infos/qpos", dataset.qpos, states_fit);
      writer.Numbers("infos/qvel", dataset.qvel, states_fit);
    }
    writer.Close();
  }
  file.Commit();
}

}  // namespace oted
