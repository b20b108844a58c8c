// hdf5.h by h5py, in this process: a fork beside the threads of other libraries could hang. The class that reads and
// the one that writes are in oted/_hdf5.py.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "oted/base/error.h"
#include "oted/data/hdf5.h"
#include "python/binding.h"

namespace oted {
namespace {

namespace nb = nanobind;
using python::Held;
using python::ToNumpy;

/// Calls into oted._hdf5, whose failures name the file and are DataErrors or UsageErrors; anything else is h5py's.
template <class Call>
auto InPython(const std::string& path, const Call& call) {
  const nb::gil_scoped_acquire acquire;
  try {
    return call();
  } catch (nb::python_error& e) {
    const nb::object errors = nb::module_::import_("oted.errors");
    const std::string message = nb::cast<std::string>(nb::str(e.value()));
    if (e.matches(errors.attr("UsageError"))) throw UsageError(message);
    if (e.matches(errors.attr("DataError"))) throw DataError(message);
    if (e.matches(PyExc_KeyboardInterrupt)) throw Interrupted("interrupted while a file was read");
    throw DataError("'" + path + "': h5py cannot go on: " + message + "; download or write the file again");
  }
}

class H5pyReader : public Hdf5Reader {
 public:
  explicit H5pyReader(const std::string& path) : Hdf5Reader(path), file_(Open(path, "Reader")) {}
  static nb::object Open(const std::string& path, const char* kind) {
    return InPython(path, [&] { return nb::object(nb::module_::import_("oted._hdf5").attr(kind)(path)); });
  }
  bool Has(const std::string& name) const override { return Ask<bool>("has", name); }
  bool IsGroup(const std::string& name) const override { return Ask<bool>("is_group", name); }
  bool HoldsBytes(const std::string& name) const override { return Ask<bool>("holds_bytes", name); }
  std::vector<std::string> Names(const std::string& group) const override {
    return Ask<std::vector<std::string>>("names", group);
  }
  std::vector<int64_t> Shape(const std::string& name) const override {
    return Ask<std::vector<int64_t>>("shape", name);
  }
  void Read(const std::string& name, std::span<double> out) const override {
    InPython(path(), [&] {
      const auto values = nb::cast<python::InArray>(file_.get().attr("read")(name));
      OTED_CHECK(values.size() == out.size());
      std::copy_n(values.data(), values.size(), out.begin());
    });
  }

 private:
  template <class T>
  T Ask(const char* what, const std::string& name) const {
    return InPython(path(), [&] { return nb::cast<T>(file_.get().attr(what)(name)); });
  }
  Held file_;
};

class H5pyOutput : public Hdf5Output {
 public:
  H5pyOutput(const std::string& temporary_path, const std::string& path)
      : path_(path), file_(H5pyReader::Open(temporary_path, "Writer")) {}
  void Group(const std::string& name) override { Call("group", name); }
  void Attribute(const std::string& group, const char* name, int64_t value) override {
    Call("attribute", group, name, value);
  }
  void Numbers(const std::string& name, const Array2<double>& m, bool as_float32) override {
    Write(name, m.values(), {m.rows(), m.cols()}, as_float32 ? "float32" : "float64");
  }
  void Numbers(const std::string& name, std::span<const double> v, bool as_float32) override {
    Write(name, v, {static_cast<int64_t>(v.size())}, as_float32 ? "float32" : "float64");
  }
  void Integers(const std::string& name, std::span<const double> v, const std::vector<int64_t>& shape,
                bool as_bytes) override {
    Write(name, v, shape, as_bytes ? "uint8" : "int64");
  }
  void Flags(const std::string& name, std::span<const uint8_t> flags) override {
    Write(name, std::vector<double>(flags.begin(), flags.end()), {static_cast<int64_t>(flags.size())}, "bool");
  }
  void Close() { Call("close"); }

 private:
  template <class... Arguments>
  void Call(const char* what, const Arguments&... arguments) {
    InPython(path_, [&] { file_.get().attr(what)(arguments...); });
  }
  void Write(const std::string& name, std::span<const double> values, const std::vector<int64_t>& shape,
             const char* kind) {
    InPython(path_, [&] { file_.get().attr("write")(name, ToNumpy<double>(values, {values.size()}), shape, kind); });
  }
  std::string path_;
  Held file_;
};

}  // namespace

Dataset ReadHdf5File(const std::string& file, const ChildLimits&,
                     const std::function<Dataset(const Hdf5Reader&)>& read) {
  return read(H5pyReader(file));
}

void WriteHdf5File(const std::string& temporary_path, const std::string& path,
                   const std::function<void(Hdf5Output&)>& write) {
  H5pyOutput output(temporary_path, path);
  write(output);
  output.Close();
}

}  // namespace oted
