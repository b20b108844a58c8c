#pragma once
/// What the sources of the module share. Each adds its part of `oted._core`; the package in python/oted makes of it
/// what users see. The module hands over arrays, texts and JSON, and computes nothing itself.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "oted/config/run_config.h"

namespace oted::python {

namespace nb = nanobind;

/// A C-ordered array of doubles, converted where it was another kind.
using InArray = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
/// The same, handed out; NumPy frees it.
using OutArray = nb::ndarray<nb::numpy, double>;

inline std::span<const double> Values(const InArray& array) { return {array.data(), array.size()}; }

/// A copy that NumPy owns.
template <class T>
nb::ndarray<nb::numpy, T> ToNumpy(std::span<const T> values, std::initializer_list<size_t> shape) {
  auto* owned = new std::vector<T>(values.begin(), values.end());
  const nb::capsule owner(owned, [](void* memory) noexcept { delete static_cast<std::vector<T>*>(memory); });
  return nb::ndarray<nb::numpy, T>(owned->data(), shape, owner);
}

/// What a call from Python says of a run: the TOML of a task file, whose relative paths start from that file's folder,
/// and what the call gives beside it, [data] and [parameters], which come before the file's. Paths in `given` start
/// from the working folder.
struct Study {
  std::string toml, file_name, given;

  /// @throws UsageError, DataError
  RunConfig Config() const;
};

void AddStudies(nb::module_& m);
void AddErrors(nb::module_& m);
void AddFiles(nb::module_& m);
void AddLogs(nb::module_& m);
void AddSession(nb::module_& m);
void AddDesigns(nb::module_& m);
void AddSimulators(nb::module_& m);
void AddPolicies(nb::module_& m);

}  // namespace oted::python
