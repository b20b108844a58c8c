#include "oted/run/kept_trials.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

Suspect Damping() {
  Suspect suspect;
  suspect.spec.name = "damping";
  suspect.spec.field = "joint/*/damping";
  suspect.value = 1.0 / 3;
  suspect.explains = 20;
  return suspect;
}

TriedSuspect Tried() {
  TriedSuspect tried;
  FreedTrial& trial = tried.trial.emplace();
  trial.value = 0.1;
  trial.std = 1e-17;
  trial.gain = {0.3, 0.1};
  trial.led_by = {"gain"};
  trial.before = {1};
  trial.after = {2};
  tried.costs = TrialCosts{{{{{0, 8}, Eigen::Vector2d(0.1, 1.0 / 7)}}}, {0, 2}};
  return tried;
}

class KeptTrialsOfADesign : public testing::Test {
 protected:
  /// What a second program gets, of a trial that the first one finished. @param fingerprint  of the second's design
  TriedSuspect AfterAStop(const std::string& fingerprint, int* n_made) {
    const auto make = [&] {
      ++*n_made;
      return Tried();
    };
    {
      const RunDirectory directory(folder_.path());
      const Artifact design = Of("aa");
      KeptTrials(directory, design).Tried(1, make);
    }
    const RunDirectory directory(folder_.path());
    const Artifact design = Of(fingerprint);
    return KeptTrials(directory, design).Tried(1, make);
  }
  Artifact Of(const std::string& fingerprint) {
    return {.file = folder_.path() / "design" / "default" / "1" / "q.json",
            .schema = "oted.q/1",
            .fingerprint = fingerprint};
  }

  TestFolder folder_;
};

TEST_F(KeptTrialsOfADesign, AreNotMadeAgain) {
  int n_made = 0;
  const TriedSuspect tried = AfterAStop("aa", &n_made);
  EXPECT_EQ(n_made, 1);
  EXPECT_EQ(TrialRecord{tried}.ToJson(), TrialRecord{Tried()}.ToJson()) << "to the last bit";
}

TEST_F(KeptTrialsOfADesign, AreMadeAgainForADesignOfOtherSettings) {
  int n_made = 0;
  AfterAStop("bb", &n_made);
  EXPECT_EQ(n_made, 2);
}

TEST_F(KeptTrialsOfADesign, AreGoneOnceTheyAreTold) {
  int n_made = 0;
  AfterAStop("aa", &n_made);
  const fs::path folder = Of("aa").file.parent_path();
  EXPECT_TRUE(fs::exists(folder / "trial_1.json"));
  KeptTrials::Remove(folder);
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST(ScreeningRecord, KeepsEachBit) {
  const ScreeningRecord record{{{Damping()}, {{"damping", Eigen::Vector2d(0.1, 1.0 / 3)}}}};
  const ScreeningRecord read =
      ScreeningRecord::FromJson(nlohmann::json::parse(record.ToJson().dump()), "suspects.json");
  ASSERT_EQ(read.screened.suspects.size(), 1U);
  EXPECT_EQ(read.screened.suspects[0].value, 1.0 / 3);
  EXPECT_EQ(read.screened.x_with.at("damping"), Eigen::Vector2d(0.1, 1.0 / 3));
}

TEST(TrialRecord, RefusesCostsOfOtherWindows) {
  nlohmann::json record = TrialRecord{Tried()}.ToJson();
  record["parts"][0]["rows"] = {0};
  EXPECT_THROW(TrialRecord::FromJson(record, "trial_1.json"), DataError);
}

}  // namespace
}  // namespace oted
