#pragma once
/// What lies between controller and plant, around any simulator: an action delay, and sensors with noise, bias,
/// scale and delay. Each is a parameter of z with the nominal value 0, of a scale 1 (oted/sim/channel_path.h has the
/// paths).
///
/// Action delay d = n + f control steps, 0 <= f < 1, under a zero-order hold: within control period k an actuator sees
/// a[k-n-1] for the first f of it and a[k-n] for the rest (Simulator::StepLate). A plant with several time steps in a
/// control period switches between two of them; in the one that f falls into, it is given the mean of the two actions
/// over it, each within the action bounds, so that what it shows is continuous in d. Whole numbers are exact. A
/// discrete action is delayed by the nearest whole number. Before an episode's first action the actuators hold 0, or
/// the nearest bound.
///
/// Sensor j shows scale_j x_j(t - d_j) + bias_j + noise_std_j N(0, 1): x is what the plant's own observation shows, a
/// fraction of a control step is interpolated, readings from before the episode's start are those of its start, and the
/// noise is drawn anew at every control step.
///
/// Reward, termination and truncation are the plant's, from its true state and the action that reached it.

#include <memory>
#include <span>
#include <vector>

#include "oted/sim/channel_path.h"
#include "oted/sim/wrapped_simulator.h"

namespace oted {

/// What the simulators of one factory share, read-only.
struct ChannelSetup {
  SimulatorSpec spec;  ///< the plant's, with n_past_actions
  ParameterSpace space;
  std::vector<int> to_plant;  ///< which parameters of `space` go to the plant, in its order
  struct Parameter {
    int index;  ///< in `space`
    ChannelField field;
  };
  std::vector<Parameter> channels;
  /// The part of z that is the plant's own.
  std::vector<double> PlantParameters(std::span<const double> z) const;
  int longest_action_delay = 0;       ///< [control steps], rounded up
  int longest_observation_delay = 0;  ///< likewise
  int n_noisy = 0;                    ///< observations that have a noise parameter
  std::vector<bool> is_noisy;         ///< (obs_dim)
};

/// Noise is drawn from one stream per lane: Reset takes it from its Rng, SetStateFromObservation from the observation
/// itself. Lanes with equal starts draw equal noise, scaled by each lane's own noise_std: differences between lanes are
/// then differences of their parameters. Poses, rates and the task's policies are of the plant's true state.
class ChannelSimulator : public WrappedSimulator {
 public:
  ChannelSimulator(std::shared_ptr<const ChannelSetup> setup, std::unique_ptr<Simulator> plant);

  const SimulatorSpec& spec() const override { return setup_->spec; }
  const ParameterSpace& parameters() const override { return setup_->space; }

  void SetParameters(int lane, std::span<const double> z) override;
  void Reset(int lane, Rng& rng) override;
  void ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng& rng) override;
  /// SetStateFromLog where nothing was logged before.
  bool SetStateFromObservation(int lane, std::span<const double> observation) override;
  /// The lane shows `observation` as it was logged, noise and all. Its state is what shows so; the
  /// noise stays in it. With observation delays the readings are of different ages: the plant is set to the last state
  /// that all of them have shown by now, some steps back, and goes on from there with the logged actions. Logged
  /// actions also fill the action delay. Where the episode is too young for that, it begins at its first logged row. A
  /// state that the plant refuses without bias and scale or that far back is set as it was logged.
  bool SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) override;
  /// The plant is set to the state without biases and scales at once, whatever the delays.
  bool SetState(int lane, std::span<const double> state, const LoggedHistory& before) override;
  /// The plant's rule, applied to the observation without bias and scale.
  std::optional<bool> EndsAt(int lane, std::span<const double> observation) override;
  void Step(std::span<const int> lanes, std::span<const double> actions) override;

  std::span<const double> observation(int lane) const override;
  LaneStatus status(int lane) const override;

 private:
  /// The latest rows of a sequence.
  class Memory {
   public:
    void Resize(int n_rows, int width);
    /// As if every row so far had been this one.
    void Fill(std::span<const double> row);
    void Push(std::span<const double> row);
    /// The row of `age` pushes ago; 0 is the latest.
    std::span<const double> Back(int age) const;

   private:
    int n_rows_ = 0, width_ = 0, head_ = 0;
    std::vector<double> values_;
  };
  struct Lane {
    double Shown(size_t j, double x) const { return scale[j] * x + bias[j]; }  ///< without noise
    double True(size_t j, double reading) const { return (reading - bias[j]) / scale[j]; }

    std::vector<double> action_delay;                   // (act_dim)
    std::vector<double> noise_std, bias, scale, delay;  // (obs_dim)
    Memory actions, observations;
    Rng noise{0};
    int clock = 0;    // control steps since the episode's start
    int n_ahead = 0;  // steps that the plant had made by then
    std::vector<double> shown;
  };
  Lane& At(int lane) { return lanes_.at(static_cast<size_t>(lane)); }
  const Lane& At(int lane) const { return lanes_.at(static_cast<size_t>(lane)); }

  void Begin(Lane& lane, Rng noise);
  void BeginAtPlant(int lane, Rng& rng);
  /// Row of `actions` that the lane is given: what reaches the plant now goes to actions_, before_ and late_share_.
  void PushAction(int lane, std::span<const double> action);
  void StepPlant(std::span<const int> lanes);
  void Show(int lane);
  void FillActions(Lane& lane, const LoggedHistory& before, int end) const;
  /// What the plant was given before row `end` of the history: late, and each row the mean over its period. Nothing
  /// where no start of the plant depends on it. Valid until the next call.
  LoggedHistory OfPlant(const Lane& lane, const LoggedHistory& before, int end);
  bool StartBack(int lane, std::span<const double> observation, const LoggedHistory& before, int n_back,
                 bool corrected);

  std::shared_ptr<const ChannelSetup> setup_;
  std::vector<double> neutral_;  // (act_dim)
  std::vector<Lane> lanes_;
  std::vector<double> actions_, before_;  // (n_lanes, act_dim), what reaches the plant: late, and until then
  std::vector<double> late_share_;        // likewise, of the control period
  std::vector<double> late_history_;      // OfPlant's
};

}  // namespace oted
