#pragma once
/// The behaviour policy of Fisher-BRC (Kostrikov et al. 2021): every action dimension has a mixture of its own, of five
/// normals squashed by tanh. Densities and their gradients by hand, in double precision: where a component is sharp,
/// log mu changes by thousands over a small step in a.

#include <array>
#include <span>
#include <vector>

#include "oted/base/rng.h"

namespace oted {

inline constexpr int kMixtureComponents = 5;
/// Actions are clipped this far inside of (-1, 1) before their density is taken; there it does not depend on them.
inline constexpr double kMixtureMargin = 1e-6;

/// One dimension's mixture, as the columns of a network's output hold it: logits, means and log standard deviations,
/// the latter clamped to [kLogStdMin, kLogStdMax].
struct ActionMixture {
  using Values = std::array<double, kMixtureComponents>;
  Values logits, means, log_stds;
};
/// d log mu / d each of them, and d log mu / d a. A clamped standard deviation and a clipped action have none.
struct ActionMixtureGradient : ActionMixture {
  double action = 0;
};

/// log mu(a) of one action in [-1, 1]. @param gradient  may be null
double LogDensity(const ActionMixture& mixture, double action, ActionMixtureGradient* gradient);

/// A draw a ~ mu: `component` by a uniform in [0, 1), then a = tanh(mean + std noise).
struct MixtureDraw {
  int component = 0;
  double u = 0, action = 0;  ///< a = tanh(u), clipped
};
MixtureDraw Draw(const ActionMixture& mixture, double uniform, double noise);

/// d log mu(a~) / d the mixture's numbers where a~ is `draw` and moves with its component: through the density, and
/// through the draw. The choice of the component carries no gradient. @return log mu(a~)
double LogDensityOfDraw(const ActionMixture& mixture, const MixtureDraw& draw, double noise,
                        ActionMixtureGradient* gradient);

/// Of a network with 3 * 5 * act_dim outputs: logits of all dimensions, then means, then log standard deviations.
ActionMixture MixtureOf(std::span<const float> out, int dimension, int act_dim);
/// Adds `weight` times a gradient at its place in dout (3 * 5 * act_dim).
void AddMixtureGradient(const ActionMixture& gradient, double weight, int dimension, int act_dim,
                        std::span<float> dout);

/// log mu(a|s) of every row, summed over the dimensions.
/// @param out       (rows, 15 act_dim)
/// @param actions   (rows, act_dim), rows `stride` numbers apart
/// @param d_actions (rows, act_dim): d log mu / d a; may be empty
void LogDensities(std::span<const float> out, const float* actions, size_t stride, int act_dim,
                  std::vector<double>& log_density, std::span<double> d_actions = {});

}  // namespace oted
