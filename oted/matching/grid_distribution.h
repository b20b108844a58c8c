#pragma once
/// A categorical q(z): for each parameter, independently, probabilities of the multiples of a step within its bounds,
/// as in the paper's MiniGrid experiment (steps of 0.05). The prior is uniform over them, or has probabilities of its
/// own.

#include <span>
#include <vector>

#include "oted/base/rng.h"
#include "oted/sim/parameter_space.h"

namespace oted {

class GridDistribution {
 public:
  /// No value's probability falls below this share of the uniform one: what was given up once can come back.
  static constexpr double kFloor = 0.02;

  GridDistribution() = default;
  /// Uniform. @throws UsageError where the range of a parameter holds fewer than two multiples of `step`
  GridDistribution(const ParameterSpace& space, double step);

  int size() const { return static_cast<int>(values_.size()); }
  const std::vector<double>& values(int i) const { return values_[static_cast<size_t>(i)]; }
  const std::vector<double>& probabilities(int i) const { return probabilities_[static_cast<size_t>(i)]; }
  /// @throws InternalError unless there is one positive number per value; they are divided by their sum
  void SetProbabilities(int i, std::vector<double> probabilities);
  /// The prior's probabilities of the values of each parameter; {} for the uniform one.
  /// @throws InternalError unless there is one positive number per value; they are divided by their sum
  void SetPrior(std::vector<std::vector<double>> probabilities);
  const std::vector<std::vector<double>>& prior() const { return prior_; }
  /// As State, of the prior.
  std::vector<double> PriorState() const;
  /// Probabilities of all parameters, one after the other.
  std::vector<double> State() const;
  void SetState(std::span<const double> state);

  /// The indices of one draw.
  std::vector<double> Draw(Rng& rng) const;
  /// `n` draws that share out the probabilities evenly: each value comes floor or ceil of n q times.
  std::vector<std::vector<double>> DrawEvenly(int n, Rng& rng) const;
  std::vector<double> ValuesAt(std::span<const double> indices) const;

  /// The most probable value of each parameter; the first of equals.
  std::vector<double> Mode() const;
  std::vector<double> Mean() const;
  std::vector<double> Std() const;
  /// P(z_i < x) + P(z_i = x) / 2, with each value's probability spread evenly over the step around it.
  double Cumulative(int i, double x) const;
  double KlToPrior() const;

  /// One natural-gradient step on E[R] - lambda KL: the logit of a value moves by the mean advantage of its draws (0
  /// without any) and towards the prior, by at most 1.
  void Ascend(const std::vector<std::vector<double>>& draws, std::span<const double> advantages, double lambda,
              double step);

 private:
  std::vector<double> low_, high_, step_;  // per parameter
  std::vector<std::vector<double>> values_, probabilities_, prior_;
};

}  // namespace oted
