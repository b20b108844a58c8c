#pragma once
/// What the sources of the module share. Each adds its part of `oted._core`; the package in python/oted makes of it
/// what users see. The module hands over arrays, texts and JSON, and computes nothing itself.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "oted/base/error.h"

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

/// A Python object that may be dropped on any thread.
class Held {
 public:
  explicit Held(nb::object object) : object_(std::move(object)) {}
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  ~Held() {
    const nb::gil_scoped_acquire acquire;
    object_.reset();
  }
  const nb::object& get() const { return object_; }

 private:
  nb::object object_;
};

/// What a user's own code raised while the library called it, on whichever thread: Python sees `message` as a DataError
/// whose cause is the user's exception, with its traceback.
class PythonFailure : public DataError {
 public:
  PythonFailure(const std::string& message, std::shared_ptr<const Held> cause)
      : DataError(message), cause_(std::move(cause)) {}
  const nb::object& cause() const { return cause_->get(); }

 private:
  std::shared_ptr<const Held> cause_;
};

/// Ctrl-C within a user's own code.
class PythonInterrupt : public Interrupted {
 public:
  PythonInterrupt() : Interrupted("interrupted") {}
};

}  // namespace oted::python
