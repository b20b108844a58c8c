#pragma once
/// Where a monotone condition turns false.

namespace oted {

/// Halves [low, high] `n_steps` times, towards where `is_below` turns from true to false. @return the middle of what is
/// left
template <class IsBelow>
double Bisect(double low, double high, int n_steps, const IsBelow& is_below) {
  for (int step = 0; step < n_steps; ++step) {
    const double middle = 0.5 * (low + high);
    (is_below(middle) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace oted
