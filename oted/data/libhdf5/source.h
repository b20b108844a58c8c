#pragma once
/// The arrays of an open HDF5 file, compared with what the file stores before anything is allocated. For the child
/// process that reads (dataset_pipe.h); never in the program itself. Include from .cc files only.

#include <set>
#include <string>
#include <vector>

#include "oted/data/hdf5.h"
#include "oted/data/libhdf5/handles.h"

namespace oted {

class Hdf5Source : public Hdf5Reader {
 public:
  explicit Hdf5Source(const std::string& path);

  /// Whether there is an object of this name, groups named on the way by '/'.
  bool Has(const std::string& name) const override;
  std::vector<int64_t> Shape(const std::string& name) const override;
  void Read(const std::string& name, std::span<double> out) const override;

  bool IsGroup(const std::string& name) const override;
  bool HoldsBytes(const std::string& name) const override;
  std::vector<std::string> Names(const std::string& group) const override;

 private:
  Hdf5Handle OpenObject(const std::string& name) const;
  Hdf5Handle OpenArray(const std::string& name) const;
  /// Holds what the array claims against what the file stores, so that a damaged header cannot make us allocate, and
  /// what all arrays asked for until now claim against Hdf5Budget.
  void CheckStorage(const std::string& name, const Hdf5Handle& array, uint64_t bytes) const;
  void CheckFilters(const std::string& name, const Hdf5Handle& created) const;

  Hdf5Handle link_access_;
  Hdf5Handle file_;
  uint64_t file_bytes_ = 0;
  mutable std::set<std::string> asked_for_;
  mutable uint64_t claimed_ = 0;  ///< by the arrays asked for [bytes as doubles]
};

}  // namespace oted
