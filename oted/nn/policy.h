#pragma once
/// What clones and agents have in common: observations in, actions out.

#include <filesystem>
#include <memory>
#include <span>

#include "oted/base/rng.h"

namespace oted {

/// Whether actions are drawn from a policy's distribution, or are its most likely ones.
enum class ActionNoise { kSampled, kMean };

/// Where the noise of a batch of actions comes from: one stream, drawn from row by row, or a stream for each row.
class ActionStreams {
 public:
  // Implicit: most callers have one stream.
  ActionStreams(Rng& one) : streams_(&one, 1) {}  // NOLINT(google-explicit-constructor)
  explicit ActionStreams(std::span<Rng> of_rows) : streams_(of_rows) {}
  Rng& of(int row) const { return streams_.size() == 1 ? streams_[0] : streams_[static_cast<size_t>(row)]; }
  /// Standard normals (n_rows, any width), each row's from its stream.
  void FillNormal(std::span<float> out, int n_rows) const {
    if (streams_.size() == 1) return streams_[0].FillNormal(out);
    const size_t width = out.size() / static_cast<size_t>(n_rows);
    for (int i = 0; i < n_rows; ++i) of(i).FillNormal(out.subspan(static_cast<size_t>(i) * width, width));
  }

 private:
  std::span<Rng> streams_;
};

/// Evaluates one policy on batches of lanes; owns the scratch memory. One per thread.
class PolicyActor {
 public:
  virtual ~PolicyActor() = default;
  /// observations (n, obs_dim), raw -> actions (n, act_dim).
  virtual void Act(std::span<const double> observations, int n, ActionStreams streams, std::span<double> actions) = 0;
  /// What an actor that remembers is told: `n` rows begin episodes; or the rows `rows` (ascending) of the last Act go
  /// on and the others are over.
  virtual void Begin(int n) { static_cast<void>(n); }
  virtual void Keep(std::span<const int> rows) { static_cast<void>(rows); }
};

/// A distribution over actions for every observation: TanhGaussianPolicy for continuous actions, CategoricalPolicy for
/// discrete ones; or a PlannerPolicy.
class Policy {
 public:
  virtual ~Policy() = default;
  virtual int obs_dim() const = 0;
  virtual int act_dim() const = 0;
  /// @param noise_scale multiplies the spread when sampling: 1 is the policy itself. The policy must outlive the actor.
  virtual std::unique_ptr<PolicyActor> MakeActor(ActionNoise noise, double noise_scale = 1.0) const = 0;
  /// Whether it can be an ONNX graph (onnx_export.h).
  virtual bool has_onnx() const { return true; }
  /// Writes the policy as .npz. @throws DataError
  virtual void Save(const std::filesystem::path& path) const = 0;
};

/// Whichever policy of this program lies at `path`. @throws DataError
std::unique_ptr<Policy> LoadPolicy(const std::filesystem::path& path);

}  // namespace oted
