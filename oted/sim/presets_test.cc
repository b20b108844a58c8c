#include "oted/sim/presets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "oted/base/error.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/testing.h"

namespace oted::presets_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A point mass that claims to have the numbers behind some paths.
class Claims : public PointMassFactory {
 public:
  /// @param same  of a path: another one that names the same numbers
  explicit Claims(std::map<std::string, std::vector<double>> fields, std::map<std::string, std::string> same = {})
      : fields_(std::move(fields)), same_(std::move(same)) {}
  PathInfo Describe(const std::string& path) const override {
    const auto found = fields_.find(path);
    if (found == fields_.end()) throw UsageError("no " + path);
    PathInfo info;
    for (size_t i = 0; i < found->second.size(); ++i) {
      const std::string& number = same_.contains(path) ? same_.at(path) : path;
      info.places.push_back({number + "#" + std::to_string(i), found->second[i]});
    }
    return info;
  }

 private:
  std::map<std::string, std::vector<double>> fields_;
  std::map<std::string, std::string> same_;
};

std::vector<std::string> Names(const std::vector<ParameterSpec>& specs) {
  std::vector<std::string> names;
  for (const ParameterSpec& spec : specs) names.push_back(spec.name);
  return names;
}

const std::map<std::string, std::vector<double>> kArm = {
    {"joint/@actuated/damping", {0.5, 0}},
    {"joint/@actuated/frictionloss", {0, 0}},
    {"joint/@actuated/armature", {0.1, 0.1}},
    {"actuator/*/gainprm[0]", {1, 1}},
    {"body/@actuated/mass + body/@actuated/inertia", {2, 1, 3, 4}}};

TEST(ExpandPresets, GivesWhatTheModelHasWithMultiplesOrWhereTheNominalIsZeroTheValueItself) {
  const ExpandedPresets arm = ExpandPresets({"arm"}, {}, Claims(kArm));
  EXPECT_THAT(Names(arm.parameters), ElementsAre("damping", "frictionloss", "armature", "gain", "mass", "delay"));
  EXPECT_THAT(arm.skipped, ElementsAre(AllOf(HasSubstr("servo_stiffness"), HasSubstr("has none")))) << "motors";
  const ParameterSpec &damping = arm.parameters[0], &loss = arm.parameters[1], &delay = arm.parameters[5];
  EXPECT_EQ(damping.scale, ParameterScale::kNominal);
  EXPECT_TRUE(damping.logarithmic);
  EXPECT_LT(damping.low * damping.high, 1.0001);
  EXPECT_EQ(loss.scale, ParameterScale::kAbsolute) << "both are 0";
  EXPECT_EQ(loss.low, 0);
  EXPECT_FALSE(loss.logarithmic);
  EXPECT_EQ(delay.scale, ParameterScale::kAbsolute);
}

TEST(ExpandPresets, SkipsWhatTheModelLacksAndSaysWhy) {
  auto fields = kArm;
  fields.erase("body/@actuated/mass + body/@actuated/inertia");
  fields["actuator/*/kp"] = {100, 100};
  const ExpandedPresets arm = ExpandPresets({"arm"}, {}, Claims(fields, {{"actuator/*/kp", "actuator/*/gainprm[0]"}}));
  EXPECT_THAT(Names(arm.parameters), ElementsAre("damping", "frictionloss", "armature", "servo_stiffness", "delay"));
  EXPECT_THAT(arm.skipped,
              ElementsAre(AllOf(HasSubstr("gain of preset arm"), HasSubstr("set point")),
                          AllOf(HasSubstr("mass of preset arm (body/@actuated/mass + "), HasSubstr("has none"))));
}

TEST(ExpandPresets, AnOwnParameterReplacesTheEntryOfItsNameAndDropsOneOnTheSameNumbers) {
  const ParameterSpec mine = {.name = "armature", .field = "joint/@actuated/armature", .low = 0.9, .high = 1.1};
  const ParameterSpec other = {.name = "kt", .field = "actuator/*/gainprm[0]", .low = 0.9, .high = 1.1};
  const ExpandedPresets arm = ExpandPresets({"arm"}, {mine, other}, Claims(kArm));
  EXPECT_THAT(Names(arm.parameters), ElementsAre("damping", "frictionloss", "armature", "mass", "delay", "kt"));
  EXPECT_EQ(arm.parameters[2].low, 0.9);
  EXPECT_THAT(arm.skipped, testing::Contains(AllOf(HasSubstr("gain"), HasSubstr("your own"))));
}

TEST(ExpandPresets, OfTwoPresetsTheFirstNamedEntryCounts) {
  const ExpandedPresets both = ExpandPresets({"arm", "gripper"}, {}, Claims(kArm));
  const ExpandedPresets arm = ExpandPresets({"arm"}, {}, Claims(kArm));
  EXPECT_EQ(Names(both.parameters), Names(arm.parameters)) << "no tendons, no geoms: nothing that the arm has not";
  EXPECT_THAT(both.skipped, testing::Contains(HasSubstr("tendon/*/stiffness")));
}

TEST(ExpandPresets, WithoutPresetsOwnParametersStayAsTheyAre) {
  const ParameterSpec mine = {.name = "gain", .field = "actuator/*/gainprm[0]"};
  EXPECT_THAT(Names(ExpandPresets({}, {mine}, Claims(kArm)).parameters), ElementsAre("gain"));
}

TEST(ExpandPresets, AnUnknownPresetNamesTheNearest) {
  EXPECT_THAT([] { ExpandPresets({"amr"}, {}, Claims(kArm)); },
              ThrowsMessage<UsageError>(AllOf(HasSubstr("did you mean 'arm'?"), HasSubstr("gripper"))));
}

TEST(Presets, EveryEntryIsAValidParameterWhoseRangeHoldsTheNominalValue) {
  for (const Preset& preset : Presets()) {
    for (const PresetEntry& entry : preset.entries) {
      EXPECT_TRUE(entry.multiple || entry.absolute || entry.terms != nullptr) << entry.name;
      if (entry.multiple) {
        const ParameterSpec spec{
            entry.name,       entry.field, entry.multiple->low, entry.multiple->high, ParameterScale::kNominal,
            entry.logarithmic};
        EXPECT_NO_THROW(spec.Check()) << preset.name;
        EXPECT_TRUE(spec.low < 1 && 1 < spec.high) << entry.name;
      }
      if (entry.absolute) {
        EXPECT_TRUE(entry.absolute->low <= 0 && 0 < entry.absolute->high) << entry.name;
      }
    }
  }
}

}  // namespace oted::presets_test
