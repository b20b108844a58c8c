#pragma once
/// Numbers as a vector of Eigen.

#include <Eigen/Dense>
#include <span>

namespace oted {

/// A view: what it is of must outlive it.
inline Eigen::Map<const Eigen::VectorXd> AsVector(std::span<const double> numbers) {
  return {numbers.data(), static_cast<Eigen::Index>(numbers.size())};
}

}  // namespace oted
