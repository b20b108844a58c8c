#pragma once
/// Owners for what HDF5's C interface hands out, and the lock that it needs. Include from .cc files only.

#include <hdf5.h>

#include <mutex>
#include <utility>

namespace oted {

/// Closes an HDF5 identifier.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Hdf5Handle(hid_t id, Close close) : id_(id), close_(close) {}
  ~Hdf5Handle() { (void)Reset(); }
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&&) = delete;
  bool ok() const { return id_ >= 0; }
  hid_t id() const { return id_; }
  /// Closes now; false when that fails.
  [[nodiscard]] bool Reset() {
    const hid_t id = std::exchange(id_, -1);
    return id < 0 || close_(id) >= 0;
  }

 private:
  hid_t id_;
  Close close_;
};

/// libhdf5 is not thread-safe: this process uses it, and forks, under this lock.
inline std::mutex& Hdf5Mutex() {
  static std::mutex mutex;
  return mutex;
}

/// Keeps libhdf5 from printing its error stack. Destroy after every handle.
class Hdf5Quiet {
 public:
  Hdf5Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &print_data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Hdf5Quiet() { H5Eset_auto2(H5E_DEFAULT, print_, print_data_); }
  Hdf5Quiet(const Hdf5Quiet&) = delete;
  Hdf5Quiet& operator=(const Hdf5Quiet&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* print_data_ = nullptr;
};

/// Both: what a writer holds. A reader runs in a child process, whose forking thread holds the lock already.
class Hdf5Session {
 private:
  std::lock_guard<std::mutex> lock_{Hdf5Mutex()};
  Hdf5Quiet quiet_;
};

}  // namespace oted
