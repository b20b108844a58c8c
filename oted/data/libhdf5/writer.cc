#include "oted/data/libhdf5/writer.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/unpack_budget.h"

namespace oted {
namespace {

constexpr const char* kNoMemory = "is there enough memory?";
constexpr size_t kMoreMemory = size_t{1} << 20;
constexpr unsigned kDeflate = 4;

Hdf5Handle CreateInMemory() {
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  const bool in_memory = H5Pset_fapl_core(access.id(), kMoreMemory, /*backing_store=*/false) >= 0;
  return {in_memory ? H5Fcreate("in memory", H5F_ACC_TRUNC, H5P_DEFAULT, access.id()) : H5I_INVALID_HID, H5Fclose};
}

}  // namespace

Hdf5Writer::Hdf5Writer(const std::string& temporary_path, const std::string& path)
    : temporary_path_(temporary_path), path_(path), file_(CreateInMemory()) {
  if (!file_.ok()) Fail("the file", kNoMemory);
}

void Hdf5Writer::Fail(const std::string& what, const char* remedy) const {
  throw DataError(fmt::format("'{}': cannot write {}; {}", path_, what, remedy));
}

void Hdf5Writer::Group(const std::string& name) {
  const Hdf5Handle group(H5Gcreate2(file_.id(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  if (!group.ok()) Fail(name, kNoMemory);
}

void Hdf5Writer::Attribute(const std::string& group, const char* name, int64_t value) {
  const Hdf5Handle object(H5Oopen(file_.id(), group.c_str(), H5P_DEFAULT), H5Oclose);
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(H5Acreate2(object.id(), name, H5T_STD_I64LE, space.id(), H5P_DEFAULT, H5P_DEFAULT),
                             H5Aclose);
  if (!attribute.ok() || H5Awrite(attribute.id(), H5T_NATIVE_INT64, &value) < 0) Fail(group, kNoMemory);
}

void Hdf5Writer::Numbers(const std::string& name, const Array2<double>& m, bool as_float32) {
  const hsize_t dims[2] = {static_cast<hsize_t>(m.rows()), static_cast<hsize_t>(m.cols())};
  Write(name, as_float32 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, dims, m.data());
}

void Hdf5Writer::Numbers(const std::string& name, std::span<const double> v, bool as_float32) {
  const hsize_t dims[1] = {v.size()};
  Write(name, as_float32 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, dims, v.data());
}

void Hdf5Writer::Integers(const std::string& name, std::span<const double> v, const std::vector<int64_t>& shape,
                          bool as_bytes) {
  const std::vector<hsize_t> dims(shape.begin(), shape.end());
  Write(name, as_bytes ? H5T_STD_U8LE : H5T_STD_I64LE, H5T_NATIVE_DOUBLE, dims, v.data());
}

void Hdf5Writer::Flags(const std::string& name, std::span<const uint8_t> flags) {
  const Hdf5Handle type(H5Tenum_create(H5T_STD_I8LE), H5Tclose);
  const int8_t no = 0;
  const int8_t yes = 1;
  if (H5Tenum_insert(type.id(), "FALSE", &no) < 0 || H5Tenum_insert(type.id(), "TRUE", &yes) < 0) Fail(name, kNoMemory);
  std::vector<int8_t> values(flags.size());
  std::ranges::transform(flags, values.begin(), [](uint8_t flag) { return static_cast<int8_t>(flag != 0); });
  const hsize_t dims[1] = {values.size()};
  Write(name, type.id(), type.id(), dims, values.data());
}

void Hdf5Writer::Close() {
  const ssize_t size = H5Fflush(file_.id(), H5F_SCOPE_GLOBAL) < 0 ? -1 : H5Fget_file_image(file_.id(), nullptr, 0);
  if (size <= 0) Fail("the file", kNoMemory);
  std::string bytes(static_cast<size_t>(size), '\0');
  if (H5Fget_file_image(file_.id(), bytes.data(), bytes.size()) != size || !file_.Reset()) Fail("the file", kNoMemory);
  OpenFile(temporary_path_, O_WRONLY | O_CREAT | O_TRUNC).Write(bytes);
}

void Hdf5Writer::Write(const std::string& name, hid_t file_type, hid_t memory_type, std::span<const hsize_t> dims,
                       const void* values) {
  uint64_t claims = sizeof(double);
  for (const hsize_t size : dims) claims *= size;
  uint64_t stored = Write(name, file_type, memory_type, dims, values, true);
  if (claimed_ + claims > Hdf5Budget(stored_ + stored)) {
    if (H5Ldelete(file_.id(), name.c_str(), H5P_DEFAULT) < 0) Fail(name, kNoMemory);
    stored = Write(name, file_type, memory_type, dims, values, false);
  }
  claimed_ += claims;
  stored_ += stored;
}

uint64_t Hdf5Writer::Write(const std::string& name, hid_t file_type, hid_t memory_type, std::span<const hsize_t> dims,
                           const void* values, bool deflates) {
  const int rank = static_cast<int>(dims.size());
  const Hdf5Handle space(H5Screate_simple(rank, dims.data(), nullptr), H5Sclose);
  const Hdf5Handle create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  // Chunks of about 64,000 numbers: small enough for libhdf5's chunk cache, large enough to compress well.
  hsize_t width = 1;
  for (const hsize_t size : dims.subspan(1)) width *= size;
  std::vector<hsize_t> chunk(dims.begin(), dims.end());
  chunk[0] = std::clamp<hsize_t>(64000 / width, 1, dims[0]);
  const bool prepared = H5Pset_chunk(create.id(), rank, chunk.data()) >= 0 && H5Pset_shuffle(create.id()) >= 0 &&
                        (!deflates || H5Pset_deflate(create.id(), kDeflate) >= 0) &&
                        H5Pset_obj_track_times(create.id(), false) >= 0;
  if (!prepared) Fail(name, kNoMemory);
  Hdf5Handle field(H5Dcreate2(file_.id(), name.c_str(), file_type, space.id(), H5P_DEFAULT, create.id(), H5P_DEFAULT),
                   H5Dclose);
  if (!field.ok()) Fail(name, kNoMemory);
  if (H5Dwrite(field.id(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) Fail(name, kNoMemory);
  if (H5Dflush(field.id()) < 0) Fail(name, kNoMemory);
  const uint64_t stored = H5Dget_storage_size(field.id());
  if (!field.Reset()) Fail(name, kNoMemory);
  return stored;
}

}  // namespace oted
