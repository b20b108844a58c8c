#pragma once
/// A dense row-major matrix on 64-byte aligned storage. The alignment keeps matrix products reproducible: BLAS may
/// choose another order of summation for another alignment.

#include <cstddef>
#include <new>
#include <span>
#include <vector>

namespace oted {

template <class T>
struct AlignedAllocator {
  using value_type = T;
  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}
  T* allocate(size_t n) { return static_cast<T*>(::operator new (n * sizeof(T), std::align_val_t{64})); }
  void deallocate(T* p, size_t) { ::operator delete (p, std::align_val_t{64}); }
  bool operator==(const AlignedAllocator&) const { return true; }
};

template <class T>
using AlignedVector = std::vector<T, AlignedAllocator<T>>;

/// (rows, cols), row-major.
template <class T>
class Array2 {
 public:
  Array2() = default;
  Array2(int rows, int cols, T value = T{})
      : rows_(rows), cols_(cols), values_(static_cast<size_t>(rows) * static_cast<size_t>(cols), value) {}

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  bool empty() const { return values_.empty(); }
  T* data() { return values_.data(); }
  const T* data() const { return values_.data(); }
  std::span<T> values() { return {values_.data(), values_.size()}; }
  std::span<const T> values() const { return {values_.data(), values_.size()}; }
  std::span<T> row(int i) { return {values_.data() + Offset(i), static_cast<size_t>(cols_)}; }
  std::span<const T> row(int i) const { return {values_.data() + Offset(i), static_cast<size_t>(cols_)}; }
  T& operator()(int i, int j) { return values_[Offset(i) + static_cast<size_t>(j)]; }
  T operator()(int i, int j) const { return values_[Offset(i) + static_cast<size_t>(j)]; }
  /// Appends one row; sets the width when the matrix is still empty.
  void AppendRow(std::span<const T> row) {
    if (rows_ == 0) cols_ = static_cast<int>(row.size());
    values_.insert(values_.end(), row.begin(), row.end());
    ++rows_;
  }
  /// Changes the number of rows, keeping the leading ones.
  void ResizeRows(int rows) {
    rows_ = rows;
    values_.resize(Offset(rows));
  }
  bool operator==(const Array2&) const = default;

 private:
  size_t Offset(int i) const { return static_cast<size_t>(i) * static_cast<size_t>(cols_); }
  int rows_ = 0;
  int cols_ = 0;
  AlignedVector<T> values_;
};

}  // namespace oted
