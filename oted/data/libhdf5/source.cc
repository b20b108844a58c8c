#include "oted/data/libhdf5/source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>

#include "oted/base/error.h"
#include "oted/data/unpack_budget.h"

namespace oted {
namespace {

// A byte of deflate holds at most 1,032 bytes; a field that claims more than this per stored byte is damaged.
constexpr uint64_t kMaxCompression = 1100;
// The largest block that libhdf5 may be made to allocate for a chunk whatever the file's size.
constexpr uint64_t kUnsuspiciousBytes = uint64_t{1} << 26;
constexpr uint64_t kMaxFieldBytes = uint64_t{1} << 36;
constexpr const char* kDamaged = "the file is damaged: download or write it again";

herr_t RefuseExternalLink(const char*, const char*, const char*, const char*, unsigned*, hid_t, void*) { return -1; }

/// Looks names up without ever opening another file.
Hdf5Handle LinkAccess() {
  Hdf5Handle access(H5Pcreate(H5P_LINK_ACCESS), H5Pclose);
  OTED_CHECK(access.ok() && H5Pset_elink_cb(access.id(), RefuseExternalLink, nullptr) >= 0);
  return access;
}

Hdf5Handle Open(const std::string& path) {
  const htri_t is_hdf5 = H5Fis_hdf5(path.c_str());
  if (is_hdf5 < 0) throw DataError(fmt::format("cannot open '{}'; check the path and its permissions", path));
  if (is_hdf5 == 0) {
    throw DataError(
        fmt::format("'{}' is not an HDF5 file; give a dataset in D4RL's or Minari's layout, .npz or .csv", path));
  }
  // Filters come from libhdf5 alone: a file cannot make us load a library that lies somewhere on this machine.
  H5PLset_loading_state(0);
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

herr_t CollectName(hid_t, const char* name, const H5L_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

}  // namespace

Hdf5Source::Hdf5Source(const std::string& path) : Hdf5Reader(path), link_access_(LinkAccess()), file_(Open(path)) {
  std::error_code error;
  file_bytes_ = std::filesystem::file_size(path, error);
  if (error) throw DataError(fmt::format("cannot read '{}': {}; check the path", path, error.message()));
}

bool Hdf5Source::Has(const std::string& name) const {
  // H5Lexists wants every group on the way to exist.
  for (size_t end = name.find('/');; end = name.find('/', end + 1)) {
    const std::string part = name.substr(0, end);
    if (H5Lexists(file_.id(), part.c_str(), link_access_.id()) <= 0) return false;
    H5L_info_t info;
    if (H5Lget_info(file_.id(), part.c_str(), &info, link_access_.id()) < 0)
      Fail(part, "cannot be looked up", kDamaged);
    if (info.type != H5L_TYPE_HARD && info.type != H5L_TYPE_SOFT) {
      Fail(part, "is a link to another file", "copy that file's content into this one");
    }
    if (end == std::string::npos) return true;
  }
}

Hdf5Handle Hdf5Source::OpenObject(const std::string& name) const {
  Hdf5Handle object(H5Oopen(file_.id(), name.c_str(), link_access_.id()), H5Oclose);
  if (!object.ok()) Fail(name, "cannot be opened, or lies in another file", kDamaged);
  return object;
}

Hdf5Handle Hdf5Source::OpenArray(const std::string& name) const {
  Hdf5Handle object = OpenObject(name);
  if (H5Iget_type(object.id()) != H5I_DATASET) {
    Fail(name, "is not an array", "flatten nested spaces into one array, as D4RL's layout wants");
  }
  return object;
}

bool Hdf5Source::IsGroup(const std::string& name) const { return H5Iget_type(OpenObject(name).id()) == H5I_GROUP; }

bool Hdf5Source::HoldsBytes(const std::string& name) const {
  const Hdf5Handle array = OpenArray(name);
  const Hdf5Handle type(H5Dget_type(array.id()), H5Tclose);
  return type.ok() && H5Tget_class(type.id()) == H5T_INTEGER && H5Tget_size(type.id()) == 1 &&
         H5Tget_sign(type.id()) == H5T_SGN_NONE;
}

std::vector<std::string> Hdf5Source::Names(const std::string& group) const {
  const Hdf5Handle object = OpenObject(group);
  if (H5Iget_type(object.id()) != H5I_GROUP) Fail(group, "is not a group", kDamaged);
  std::vector<std::string> names;
  hsize_t at = 0;
  if (H5Literate(object.id(), H5_INDEX_NAME, H5_ITER_NATIVE, &at, CollectName, &names) < 0) {
    Fail(group, "cannot be listed", kDamaged);
  }
  std::ranges::sort(names);
  return names;
}

std::vector<int64_t> Hdf5Source::Shape(const std::string& name) const {
  const Hdf5Handle array = OpenArray(name);
  const Hdf5Handle type(H5Dget_type(array.id()), H5Tclose);
  const H5T_class_t kind = type.ok() ? H5Tget_class(type.id()) : H5T_NO_CLASS;
  if (kind != H5T_FLOAT && kind != H5T_INTEGER && kind != H5T_ENUM) {
    Fail(name, "does not hold numbers", "store it as float, integer or bool");
  }
  const Hdf5Handle space(H5Dget_space(array.id()), H5Sclose);
  if (!space.ok() || H5Sget_simple_extent_type(space.id()) != H5S_SIMPLE) {
    Fail(name, "is not an array", "store one row per transition");
  }
  hsize_t dims[H5S_MAX_RANK] = {};
  const int rank = H5Sget_simple_extent_dims(space.id(), dims, nullptr);
  if (rank < 1) Fail(name, "has no readable shape", kDamaged);
  const size_t bytes_of_a_number = H5Tget_size(type.id());
  if (bytes_of_a_number == 0) Fail(name, "holds numbers of no size", kDamaged);
  unsigned __int128 exact = bytes_of_a_number;
  std::vector<int64_t> shape;
  for (int i = 0; i < rank; ++i) {
    exact = std::min<unsigned __int128>(exact * dims[i], kMaxFieldBytes + 1);
    if (dims[i] > static_cast<hsize_t>(std::numeric_limits<int64_t>::max())) exact = kMaxFieldBytes + 1;
    shape.push_back(static_cast<int64_t>(dims[i]));
  }
  const uint64_t bytes = static_cast<uint64_t>(exact);
  if (bytes > kMaxFieldBytes) Fail(name, "claims more than 64 GiB", kDamaged);
  CheckStorage(name, array, bytes);
  if (asked_for_.insert(name).second) claimed_ += bytes / bytes_of_a_number * sizeof(double);
  if (claimed_ > Hdf5Budget(file_bytes_)) {
    Fail(name, fmt::format("brings the file's numbers to {} bytes, from {} on the disk", claimed_, file_bytes_),
         "if that is true, write it again with less compression");
  }
  return shape;
}

void Hdf5Source::Read(const std::string& name, std::span<double> out) const {
  const Hdf5Handle array = OpenArray(name);
  const Hdf5Handle space(H5Dget_space(array.id()), H5Sclose);
  OTED_CHECK(H5Sget_simple_extent_npoints(space.id()) == static_cast<hssize_t>(out.size()));
  if (H5Dread(array.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
    Fail(name, "cannot be read", kDamaged);
  }
}

void Hdf5Source::CheckStorage(const std::string& name, const Hdf5Handle& array, uint64_t bytes) const {
  const Hdf5Handle created(H5Dget_create_plist(array.id()), H5Pclose);
  const H5D_layout_t layout = created.ok() ? H5Pget_layout(created.id()) : H5D_LAYOUT_ERROR;
  const uint64_t stored = H5Dget_storage_size(array.id());
  const auto fail_size = [&] {
    Fail(name, fmt::format("claims {} bytes but stores {} in a file of {}", bytes, stored, file_bytes_), kDamaged);
  };
  if (layout == H5D_COMPACT) return;
  if (layout == H5D_CONTIGUOUS) {
    if (H5Pget_external_count(created.id()) != 0) {
      Fail(name, "keeps its values in another file", "copy them into this one");
    }
    const haddr_t offset = H5Dget_offset(array.id());
    const bool fits = stored == bytes && bytes <= file_bytes_ && (bytes == 0 || offset <= file_bytes_ - bytes);
    if (!fits) fail_size();
    return;
  }
  if (layout != H5D_CHUNKED) Fail(name, "is a view of other files", "copy their values into this one");
  CheckFilters(name, created);
  hsize_t chunk[H5S_MAX_RANK] = {};
  const int rank = H5Pget_chunk(created.id(), H5S_MAX_RANK, chunk);
  const Hdf5Handle type(H5Dget_type(array.id()), H5Tclose);
  unsigned __int128 chunk_bytes = H5Tget_size(type.id());
  for (int i = 0; i < rank; ++i) chunk_bytes = std::min<unsigned __int128>(chunk_bytes * chunk[i], kMaxFieldBytes);
  const uint64_t most = stored > file_bytes_ ? 0 : stored * (H5Pget_nfilters(created.id()) > 0 ? kMaxCompression : 1);
  if (bytes > most || chunk_bytes > std::max(most, kUnsuspiciousBytes)) fail_size();
}

void Hdf5Source::CheckFilters(const std::string& name, const Hdf5Handle& created) const {
  constexpr std::array kFilters = {H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE, H5Z_FILTER_FLETCHER32};
  const int n_filters = H5Pget_nfilters(created.id());
  for (int i = 0; i < n_filters; ++i) {
    unsigned flags = 0;
    unsigned config = 0;
    size_t n_values = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(created.id(), static_cast<unsigned>(i), &flags, &n_values, nullptr, 0, nullptr, &config);
    if (filter < 0) Fail(name, "has no readable compression filter", kDamaged);
    if (std::ranges::find(kFilters, filter) == kFilters.end()) {
      Fail(name,
           fmt::format("is compressed with HDF5 filter {}, wanted gzip, shuffle or fletcher32",
                       static_cast<int>(filter)),
           "write it with compression='gzip'");
    }
  }
}

}  // namespace oted
