#include "oted/stages/design/trajectories/suspects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/replay/kept_aside.h"
#include "oted/stages/design/trajectories/best_freed.h"
#include "oted/stages/design/trajectories/freed.h"
#include "oted/stages/design/trajectories/trajectory_matching.h"

namespace oted::suspects_test {

constexpr double kDamping = 0.5, kIdle = 0.5;  // of the model

TEST(FirstApart, KeepsAnInertiaBesideTheMassThatItIsTiedTo) {
  std::vector<Suspect> suspects;
  for (const char* field : {"body/*/mass + body/*/inertia", "body/*/mass", "opt/gravity[2]", "body/*/inertia", "a/b"}) {
    suspects.push_back({.spec = {.name = field, .field = field}});
  }
  std::vector<std::string> apart;
  for (const Suspect& suspect : FirstApart(suspects, 3)) apart.push_back(suspect.spec.field);
  EXPECT_THAT(apart, testing::ElementsAre("body/*/mass + body/*/inertia", "opt/gravity[2]", "body/*/inertia"));
}

/// The point mass with its gain alone as a parameter; behind it, where there is more, multiples of its damping, of its
/// idle, or of the gain once more (a gear, that is).
class GainOfPointMass : public PointMass {
 public:
  GainOfPointMass(std::vector<ParameterSpec> more, int n_lanes, int n_threads)
      : PointMass(PointMassOptions{}, n_lanes, n_threads), more_(std::move(more)) {}
  void SetParameters(int lane, std::span<const double> z) override {
    std::vector<double> all = {z[0], kDamping, kIdle};
    for (size_t k = 0; k < more_.size(); ++k) {
      const std::string& field = more_[k].field;
      all[field == "env/gear" ? 0 : field == "env/damping" ? 1 : 2] *= z[k + 1];
    }
    PointMass::SetParameters(lane, all);
  }

 private:
  std::vector<ParameterSpec> more_;
};

class GainFactory : public PointMassFactory {
 public:
  explicit GainFactory(const std::vector<std::string>& suspects = {"damping", "idle"},
                       const std::vector<ParameterSpec>& more = {}, double high = 2.0)
      : suspects_(suspects), more_(more), high_(high) {
    std::vector<ParameterSpec> specs = {PointMass::MakeParameters()[0]};
    specs.insert(specs.end(), more.begin(), more.end());
    parameters_ = ParameterSpace(specs);
  }
  const ParameterSpace& parameters() const override { return parameters_; }
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<GainOfPointMass>(more_, n_lanes, n_threads);
  }
  std::vector<ParameterSpec> Suspects() const override {
    std::vector<ParameterSpec> specs;
    for (const std::string& name : suspects_) {
      specs.push_back({.name = name, .field = "env/" + name, .high = high_});
    }
    return specs;
  }
  std::unique_ptr<SimulatorFactory> With(const std::vector<ParameterSpec>& more) const override {
    return std::make_unique<GainFactory>(suspects_, more, high_);
  }

 private:
  std::vector<std::string> suspects_;
  std::vector<ParameterSpec> more_;
  double high_;  // end of each suspect's range
  ParameterSpace parameters_;
};

/// The names of suspects that are fitted.
class AskedNames : public NullSink {
 public:
  void Progress(std::string_view, std::string_view label, int64_t, int64_t, std::string_view note) override {
    if (label == "asked") names.emplace(note);
  }
  std::set<std::string> names;
};

/// Noisy logs of a target whose damping is `factor` times the model's.
Dataset LogsWith(double factor, int n_episodes, uint64_t seed) {
  return WithSensorNoise(PointMassLogs({1.3, factor * kDamping, kIdle}, n_episodes), 0.02, RngKey(seed));
}

using Freeing = std::vector<Suspect> (*)(const FreedProblem&, int);

/// What is suspected where the model's gain alone is searched.
std::vector<Suspect> SuspectsIn(const Dataset& logs, uint64_t seed, std::set<std::string>* asked = nullptr,
                                double high = 2.0, Freeing free = TrySuspects) {
  AskedNames log;
  const RunContext context{.log = &log, .n_threads = 1};
  const GainFactory factory({"damping", "idle"}, {}, high);
  const Prior prior = Prior::Uniform(1);
  const ReplayFit fit =
      MatchTrajectories({factory, logs, prior, RngKey(seed), [](int, int, const Eigen::VectorXd&) {}, context},
                        {.rows = 400, .starts = 2, .coarse = 16});
  TrialKeeper keeper;
  const FreedProblem problem = {.factory = factory,
                                .dataset = logs,
                                .prior = prior,
                                .fit = *fit.evidence,
                                .z = ToZ(factory.parameters(), fit.mean),
                                .kept_aside = RngKey(seed),
                                .context = context,
                                .keeper = keeper};
  const std::vector<Suspect> suspects = free(problem, 3);
  if (asked != nullptr) *asked = log.names;
  return suspects;
}

std::vector<Suspect> SuspectsOf(double factor, uint64_t seed, std::set<std::string>* asked = nullptr, double high = 2.0,
                                Freeing free = TrySuspects) {
  return SuspectsIn(LogsWith(factor, 20, seed), seed, asked, high, free);
}

TEST(TrySuspects, NamesWhatIsOffAndByHowMuchAndSaysWhatFreeingItBuys) {
  for (const double factor : {0.6, 1.5}) {
    const std::vector<Suspect> suspects = SuspectsOf(factor, 3);
    ASSERT_FALSE(suspects.empty());
    EXPECT_EQ(suspects[0].spec.field, "env/damping");
    ASSERT_TRUE(suspects[0].trial.has_value());
    EXPECT_TRUE(suspects[0].trial->kept);
    EXPECT_NEAR(suspects[0].trial->value, factor, 0.1);
    EXPECT_LT(suspects[0].trial->after[0], suspects[0].trial->before[0]);
    EXPECT_EQ(BestFreed(suspects), suspects.data());
  }
}

TEST(TryAsked, FreesWhatTheWindowsOfTheFitAskAndNothingWhereTheyAskForNothing) {
  const std::vector<Suspect> asked = SuspectsOf(1.4, 3, nullptr, 2.0, TryAsked);
  ASSERT_EQ(asked.size(), 1);
  EXPECT_EQ(asked[0].spec.field, "env/damping");
  EXPECT_TRUE(asked[0].IsLikely());
  ASSERT_TRUE(asked[0].trial.has_value());
  EXPECT_TRUE(asked[0].trial->kept);
  EXPECT_NEAR(asked[0].trial->value, 1.4, 0.1);
  EXPECT_TRUE(SuspectsOf(1.0, 3, nullptr, 2.0, TryAsked).empty());
}

/// Five episodes, of which the one that is kept aside ends after half a second.
Dataset WithAShortJudge(const Dataset& logs, RngKey kept_aside) {
  const std::vector<Episode> episodes = logs.Episodes();
  for (size_t e = 0; e < episodes.size(); ++e) {
    std::vector<Episode> cut = episodes;
    cut[e] = {cut[e].begin, cut[e].begin + 6, false};
    Dataset with_cut = logs.Select(cut);
    if (KeepAside(with_cut, 0.1, kept_aside).judge.size() == 6) return with_cut;
  }
  throw DataError("no episode judges alone");
}

TEST(TrySuspects, AsksTheWindowsThatLearnedWhereTooFewWereKeptAside) {
  const std::vector<Suspect> suspects = SuspectsIn(WithAShortJudge(LogsWith(1.6, 5, 3), RngKey(3)), 3);
  ASSERT_FALSE(suspects.empty());
  EXPECT_EQ(suspects[0].spec.field, "env/damping");
  ASSERT_TRUE(suspects[0].trial.has_value());
  ASSERT_TRUE(suspects[0].trial->nats.has_value());
  EXPECT_TRUE(IsLikelier(*suspects[0].trial));
  EXPECT_TRUE(suspects[0].trial->kept);
}

TEST(TrySuspects, KeepsNothingThatEndsAtItsBound) {
  const std::vector<Suspect> suspects = SuspectsOf(2.0, 3, nullptr, 1.5);
  ASSERT_FALSE(suspects.empty());
  ASSERT_TRUE(suspects[0].trial.has_value());
  EXPECT_GT(suspects[0].trial->gain.value, 2 * suspects[0].trial->gain.error) << "it predicts surely better";
  EXPECT_FALSE(suspects[0].trial->kept);
}

Suspect Freed(const std::string& name, bool kept, std::vector<std::string> led_by = {}) {
  FreedTrial trial;
  trial.kept = kept;
  trial.led_by = std::move(led_by);
  return {.spec = {.name = name, .field = "env/" + name}, .trial = trial};
}

TEST(RivalsOfBest, AreThoseKeptThatTheBestDoesNotSurelyLead) {
  const std::vector<Suspect> suspects = {Freed("gravity", true),
                                         Freed("armature", true),
                                         Freed("inertia", false),
                                         Freed("damping", true, {"gravity"}),
                                         {}};
  ASSERT_EQ(BestFreed(suspects), &suspects[0]) << "the first, where the next does not surely lead it";
  EXPECT_EQ(RivalsOfBest(suspects), std::vector<const Suspect*>{&suspects[1]});
  const std::vector<Suspect> led = {Freed("gravity", true, {"armature"}), Freed("armature", true)};
  EXPECT_EQ(BestFreed(led), &led[1]);
  EXPECT_TRUE(RivalsOfBest(led).empty());
  const std::vector<Suspect> by_one_left = {Freed("gravity", true, {"inertia"}), Freed("inertia", false)};
  EXPECT_EQ(BestFreed(by_one_left), by_one_left.data()) << "what is not kept takes no place";
  EXPECT_TRUE(RivalsOfBest({Freed("gravity", true)}).empty());
  EXPECT_TRUE(RivalsOfBest({}).empty());
}

TEST(TrySuspects, FreesNothingWhereTheSearchedParametersExplainTheLogs) {
  for (uint64_t seed = 0; seed < 10; ++seed) EXPECT_EQ(BestFreed(SuspectsOf(1.0, seed)), nullptr) << seed;
}

/// The point mass's idle acts on nothing: its derivatives are zero, as a contact's are where nothing touches.
TEST(TrySuspects, AsksOnlyWhatTheLogsDependOn) {
  std::set<std::string> asked;
  SuspectsOf(1.0, 1, &asked);
  EXPECT_EQ(asked, std::set<std::string>{"damping"}) << "none is favoured, so that all are asked";
}

FitEvidence EvidenceOf(const std::vector<std::string>& suspects, double noise, double damping = kDamping) {
  const Dataset logs = WithSensorNoise(PointMassLogs({1.3, damping, kIdle}, 20), noise, RngKey(1));
  NullSink log;
  const RunContext context{.log = &log, .n_threads = 1};
  const GainFactory factory(suspects);
  const Prior prior = Prior::Uniform(1);
  return MatchTrajectories({factory, logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
                           {.rows = 400, .starts = 2, .coarse = 16})
      .evidence.value();
}

std::vector<Condition> ConditionsOf(const std::vector<std::string>& suspects, double noise) {
  return EvidenceOf(suspects, noise).conditions;
}

TEST(IsExcluded, WhereATenthOffIsMuchLessLikelyThanTheModelsValue) {
  EXPECT_TRUE(IsExcluded(0.0953, 0, 0.0953 / 1.7));
  EXPECT_FALSE(IsExcluded(0.0953, 0, 0.0953 / 1.6)) << "the interval of what is as in the model reaches it";
  // A servo's kv was a tenth off: all six values with it, and the interval about the likeliest kv just missed the
  // truth.
  EXPECT_FALSE(IsExcluded(0.0953, 0.0412, 0.026)) << "as likely as the model's value";
  EXPECT_FALSE(IsExcluded(0.0953, -0.0412, 0.026)) << "to either side";
}

TEST(FindConditions, NamesWhatTheLogsDoNotTellFromTheParameterAndWhereItWouldBe) {
  for (const double noise : {1e-9, 0.002}) {
    const std::vector<Condition> conditions = ConditionsOf({"gear", "damping", "idle"}, noise);
    ASSERT_EQ(conditions.size(), 1);
    EXPECT_EQ(conditions[0].parameter, 0);
    EXPECT_EQ(conditions[0].spec.field, "env/gear");
    EXPECT_NEAR(conditions[0].off, 1.1, 1e-9);
    EXPECT_NEAR(conditions[0].value, 1.3 / 1.1, 0.01) << "gain and gear act as a product";
  }
}

TEST(FindConditions, NamesNothingThatTheLogsThemselvesShowToBeAsInTheModel) {
  for (const double noise : {1e-9, 0.002}) {
    EXPECT_TRUE(ConditionsOf({"damping", "idle"}, noise).empty()) << "the damping is told to less than a tenth";
  }
}

TEST(FindConditions, SaysWhatTheWindowsAskBesideTheParameter) {
  for (const double noise : {0.002, 0.01}) {
    EXPECT_TRUE(EvidenceOf({"damping", "idle"}, noise).asked.empty());
    const FitEvidence off = EvidenceOf({"damping", "idle"}, noise, 1.4 * kDamping);
    ASSERT_EQ(off.asked.size(), 1);
    EXPECT_EQ(off.asked[0].spec.field, "env/damping");
    EXPECT_GT(off.asked[0].value, 1.25);
    EXPECT_TRUE(off.asked[0].IsLikely());
    ASSERT_TRUE(off.unseen.has_value());
    EXPECT_GT(std::abs(off.unseen->z[0] - 1.3), 0.06) << "the gain alone";
  }
}

}  // namespace oted::suspects_test
