#pragma once
/// The simulator parameters z of the paper (Sec. 3, M(z)): what may vary, within which bounds.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/rng.h"

namespace oted {

enum class ParameterScale {
  kNominal,   ///< z multiplies the nominal value
  kAbsolute,  ///< z is the value itself, in the model's unit
};

/// One parameter as the user declares it.
struct ParameterSpec {
  std::string name;   ///< "friction"
  std::string field;  ///< "geom/*/friction[0]": shared by everything that the path matches
  double low = 0.2;   ///< bounds of z, low < high
  double high = 2.0;
  ParameterScale scale = ParameterScale::kNominal;
  bool logarithmic = false;        ///< search in log z; needs low > 0
  std::string unit = "x nominal";  ///< shown in reports; "x damping" where it multiplies what that parameter gives
  double nominal = 1.0;            ///< z of the nominal simulator; filled in by the simulator for kAbsolute
  /// What a parameter file takes the nominal value of a kAbsolute to be: a model with another is refused.
  std::optional<double> wanted_nominal = std::nullopt;
  /// What is believed of z before any log is read: mean and standard deviation, in z's unit.
  struct Belief {
    double mean = 0, std = 0;
  };
  std::optional<Belief> prior = std::nullopt;
  bool is_known = false;  ///< a constant, whose values come with the recordings: the bounds are no range

  bool IsMultiple() const { return scale == ParameterScale::kNominal; }
  /// Whether it is a multiple of what other parameters give: UnitOfMultiple names them.
  bool MultipliesOthers() const { return IsMultiple() && unit != ParameterSpec().unit; }
  /// @throws UsageError: empty name or field, bounds not finite or not low < high, log of a non-positive bound,
  /// a prior whose mean is not between the bounds or whose std is not positive.
  void Check() const;
};

/// "x damping": of a multiple of what other parameters give; "x nominal" without them.
std::string UnitOfMultiple(const std::vector<std::string>& others);

/// The paths that a field ties together: "body/hand/mass + body/hand/inertia" names two.
std::vector<std::string> TiedPaths(const std::string& field);

/// Reads "name=path:low:high[:log][:absolute][:prior=MEAN,STD]". @throws UsageError
ParameterSpec ParseParameterSpec(const std::string& text);

/// An ordered list of parameters. z is in their units, within their bounds; u is z mapped to the unit cube.
class ParameterSpace {
 public:
  ParameterSpace() = default;
  /// @throws UsageError on a defect of one of them or on a name given twice.
  explicit ParameterSpace(std::vector<ParameterSpec> specs);

  int size() const { return static_cast<int>(specs_.size()); }
  const ParameterSpec& operator[](int i) const { return specs_[static_cast<size_t>(i)]; }
  const std::vector<ParameterSpec>& specs() const { return specs_; }
  std::vector<double> Nominal() const;

  /// u in [0, 1]^d -> z, and back. Values outside are clamped to the bounds.
  std::vector<double> FromUnit(std::span<const double> u) const;
  std::vector<double> ToUnit(std::span<const double> z) const;
  /// Uniform over the unit cube.
  std::vector<double> SampleUniform(Rng& rng) const;
  /// @throws UsageError when `z` has the wrong length or leaves the bounds.
  void CheckInside(std::span<const double> z) const;

 private:
  std::vector<ParameterSpec> specs_;
};

}  // namespace oted
