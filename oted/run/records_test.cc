#include "oted/run/records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/run/design_findings.h"
#include "oted/run/design_record.h"
#include "oted/run/policy_records.h"
#include "oted/run/prediction_words.h"
#include "oted/run/suspect_sentence.h"
#include "oted/run/verdict_sentence.h"

namespace oted::records_test {

using nlohmann::json;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

json Clone() {
  CloneRecord clone;
  clone.method = CloneMethod::kValueDice;
  clone.train_loss = 0.1;
  clone.held_out_loss = 1.0 / 3;
  clone.n_steps = 7;
  clone.choice = {{.held_out_loss = 1, .closeness = {}}, {.held_out_loss = 2, .closeness = 0.5}, 30, "a reason"};
  return clone.ToJson();
}

json Design() {
  DesignRecord design;
  design.task = "Hopper-v5";
  design.warnings = {"one"};
  design.parameters = {{.name = "gain",
                        .field = "actuator/*/gainprm[0]",
                        .unit = "x nominal",
                        .nominal = 1,
                        .low = 0.2,
                        .high = 2,
                        .mode = 1.3,
                        .std = 0.1,
                        .interval90_low = 1.1,
                        .interval90_high = 1.5,
                        .verdict = ParameterVerdict::kWeak}};
  design.correlation = {{1.0}};
  design.selected = "default";
  design.mixture = {{1, {1.3}, {0.1}}};
  design.score_name = SelectionScore::kPaper;
  design.verdict = DesignVerdict::kOutsideFamily;
  design.sentence = "outside the family";
  design.predicts_better = true;
  design.validation = {{{0.5, 25, 7, true, 0.62, true, {{"x", "m", 0.1, 0.02, 0.01}}, {}, 1.7, {1, 4}}}};
  Suspect suspect;
  suspect.spec = {.name = "mass", .field = "body/*/mass", .low = 0.1, .high = 10, .logarithmic = true};
  suspect.value = 1.2;
  suspect.explains = 20;
  design.grown = {suspect};
  suspect.trial =
      FreedTrial{1.25, 0.1, {{0.9, 1.1}}, true, 0.5, 25, 7, false, {0.3, 0.1}, Estimated{40, 5}, {"com"}, {0.2}, {NAN}};
  design.fit = {16, 0.9, {{"x", 0.1, 0.2, 0.3, true}}, {{suspect, "with mass freed", "mass = {}"}}};
  design.method_choices = {
      {.setting = "default", .method = DesignMethod::kTrajectories, .picked = "default", .reason = "why", .tried = {}}};
  DesignRecord::Seed seed;
  seed.seed = 1;
  seed.mode = seed.std = {1.0};
  design.settings = {{.name = "default",
                      .method = "transitions",
                      .common = 0.65,
                      .c = 0.1,
                      .learning_progress = 0.2,
                      .seeds = {seed}}};
  design.dataset = {"demos.hdf5", "ab", 100};
  return design.ToJson();
}

json Agent() {
  AgentRecord agent;
  agent.ground = Ground::kIntervalSearch;
  agent.algorithm = AgentAlgorithm::kCrossq;
  agent.episodes = {{"interval/low/gain", 0.5}};
  return agent.ToJson();
}

json Offline() {
  return OfflineRecord{"mbop", 3, 100, 1403, {{"train/prior_loss", 0.5}, {"train/value_loss", 1.5}}}.ToJson();
}

json PolicySelection() { return PolicySelectionRecord{2, {{1, {1.3}}}, {{1, {10}, 10, 0}, {2, {12}, 12, 1}}}.ToJson(); }

json Evaluation() {
  return EvaluationRecord{
      "Hopper-v5", 20, {{"gain", "x nominal", 1, 1.2, 1.3, 0.1, 0.1}}, {{"clone", "clone of the logs", 5, 1, 0, {}}}}
      .ToJson();
}

template <class Record>
void ExpectRoundTrip(const json& record) {
  EXPECT_EQ(Record::FromJson(record, "here.json").ToJson().dump(), record.dump());
  for (const auto& [field, unused] : record.items()) {
    json changed = record;
    changed[field] = {{"neither", "nor"}};
    try {
      static_cast<void>(Record::FromJson(changed, "here.json").ToJson());
    } catch (const DataError& error) {
      EXPECT_THAT(error.what(), HasSubstr("here.json")) << field;
    }
  }
}

TEST(Records, AreReadAsTheyWereWritten) {
  ExpectRoundTrip<CloneRecord>(Clone());
  ExpectRoundTrip<DesignRecord>(Design());
  ExpectRoundTrip<AgentRecord>(Agent());
  ExpectRoundTrip<OfflineRecord>(Offline());
  ExpectRoundTrip<PolicySelectionRecord>(PolicySelection());
  ExpectRoundTrip<EvaluationRecord>(Evaluation());
}

TEST(Records, AMissingFieldAndAnotherSchemaAreErrorsWithFileAndField) {
  json record = Clone();
  record.erase("train_loss");
  EXPECT_THAT(MessageOf<DataError>([&] { CloneRecord::FromJson(record, "clone.json"); }),
              AllOf(HasSubstr("'clone.json'"), HasSubstr("'train_loss'")));
  record = Clone();
  record["method"] = "dagger";
  EXPECT_THAT(MessageOf<DataError>([&] { CloneRecord::FromJson(record, "clone.json"); }),
              AllOf(HasSubstr("'method'"), HasSubstr("'dagger' is unknown")));
  record["schema"] = "oted.clone/9";
  EXPECT_THAT(MessageOf<DataError>([&] { CloneRecord::FromJson(record, "clone.json"); }),
              AllOf(HasSubstr("oted.clone/9"), HasSubstr("another version")));
  json design = Design();
  design["parameters"][0].erase("mode");
  EXPECT_THAT(MessageOf<DataError>([&] { DesignRecord::FromJson(design, "design.json"); }),
              AllOf(HasSubstr("parameters[0]"), HasSubstr("'mode'")));
}

TEST(Records, ANumberThatIsNotFiniteIsNullAndComesBackAsNan) {
  AgentRecord agent;
  agent.eval_return = NAN;
  const json text = json::parse(agent.ToJson().dump());
  EXPECT_TRUE(text.at("eval_return").is_null());
  EXPECT_TRUE(std::isnan(AgentRecord::FromJson(text, "agent.json").eval_return));
}

TEST(ShownHorizon, IsOneOverWhichTheGainIsSure) {
  DesignRecord::Validation validation;
  for (const double seconds : {0.1, 0.5, 1.0}) validation.horizons.push_back({seconds, 1, 9, false, 0.3, true, {}, {}});
  EXPECT_EQ(ShownHorizon(validation).seconds, 0.5) << "the longest, up to half a second";
  validation.horizons[1].surely_better = false;
  EXPECT_EQ(ShownHorizon(validation).seconds, 0.1);
  validation.horizons[0].surely_better = false;
  EXPECT_EQ(ShownHorizon(validation).seconds, 1.0) << "over which alone it is sure";
  validation.horizons[2].surely_better = false;
  validation.horizons[0].learned = true;
  EXPECT_EQ(ShownHorizon(validation).seconds, 0.5) << "what was learned from tells least";
}

/// Horizons are to be added.
DesignRecord Narrowed() {
  DesignRecord record;
  record.verdict = DesignVerdict::kGapNarrowed;
  record.predicts_better = true;
  record.validation.emplace();
  return record;
}

TEST(VerdictSentence, ClaimsNoMoreThanWasAsked) {
  DesignRecord record = Narrowed();
  DesignRecord::Validation validation;
  validation.horizons.push_back({0.5, 50, 9, false, 0.62, true, {{"servo", "rad", 0.1, 0.04, 0.01, 1}}, {}});
  const auto sentence = [&] {
    record.validation = validation;
    return VerdictSentence(record, {0});
  };
  validation.n_parts = 6;
  EXPECT_THAT(sentence(), HasSubstr("Judged by other parts of the recordings that it learned from: other motions were "
                                    "not tested"));
  validation.n_recordings = 1;
  validation.horizons[0].in_recordings = {4, 0.5, true};
  EXPECT_THAT(sentence(), EndsWith("Judged by 1 recording that it did not learn from, and by other parts of those that "
                                   "it did"));
  validation.horizons[0].surely_better = false;
  EXPECT_THAT(sentence(),
              EndsWith("in that recording alone its error is 50 % less, over all windows that is not sure"));
  validation.horizons[0].surely_better = true;
  validation.horizons[0].in_recordings = {4, -0.1, false};
  EXPECT_THAT(sentence(), EndsWith("in that recording alone it is 10 % worse than the nominal one"));
  validation.n_parts = 0;
  EXPECT_THAT(sentence(), EndsWith("Judged by 1 recording that it did not learn from"));
  validation.horizons[0].learned = true;
  EXPECT_THAT(sentence(), EndsWith("Judged by the logs that it learned from"));
}

TEST(VerdictSentence, WhereTheFloorIsReachedSaysWhichValueIsAtTheEndOfItsRange) {
  DesignRecord record = Narrowed();
  record.verdict = DesignVerdict::kGapClosed;
  record.validation->horizons.push_back({0.5, 50, 9, false, 0.62, true, {{"servo", "rad", 0.1, 0.01, 0.01, 1}}, {}});
  EXPECT_THAT(VerdictSentence(record, {}), Not(HasSubstr("off")));
  DesignRecord::Parameter mass;
  mass.name = "mass";
  mass.field = "body/*/mass";
  mass.nominal = 1;
  mass.low = 0.5;
  mass.high = mass.mode = 2;
  mass.verdict = ParameterVerdict::kAtBound;
  record.parameters = {mass};
  EXPECT_THAT(VerdictSentence(record, {}), HasSubstr("The value of 'mass' is at the end of its range"));
}

TEST(VerdictSentence, SaysHowManyChannelsJudgeNothing) {
  DesignRecord record = Narrowed();
  record.verdict = DesignVerdict::kGapClosed;
  record.validation->horizons.push_back(
      {0.5, 50, 9, false, 0.9, true, {{"servo", "rad", 0.1, 0.1, 0.1, 1}, {"servo_vel", "rad/s", 1, 1, 0.1, 1}}, {}});
  EXPECT_THAT(VerdictSentence(record, {}), Not(HasSubstr("no part in this")));
  record.validation->horizons[0].channels[1].judged = false;
  EXPECT_THAT(VerdictSentence(record, {}), HasSubstr("1 of 2 channels has no part in this, as it is computed"));
}

TEST(VerdictSentence, OfNoGapNamesValuesThatTheFitAsksForAllTheSame) {
  DesignRecord record = Narrowed();
  record.verdict = DesignVerdict::kNoGap;
  record.validation->horizons.push_back({0.5, 50, 9, false, 0.02, false, {{"servo", "rad", 0.1, 0.1, 0.1, 1}}, {}});
  DesignRecord::Parameter damping;
  damping.name = "damping";
  damping.nominal = 1;
  damping.low = 0.1;
  damping.high = 3;
  damping.mode = 1.5;
  damping.std = 0.09;
  damping.verdict = ParameterVerdict::kWeak;
  DesignRecord::Parameter mass = damping;
  mass.name = "mass";
  mass.mode = 1.1;  // a standard deviation
  record.parameters = {damping, mass};
  EXPECT_THAT(VerdictSentence(record, {}), HasSubstr("The fit asks for another value of 'damping' though"));
  record.parameters = {mass};
  EXPECT_THAT(VerdictSentence(record, {}), Not(HasSubstr("asks for")));
}

TEST(WeakenWhatMovesFar, LeavesNothingIdentifiedThatSomethingElseOffWouldMoveFar) {
  const ParameterSpace space(
      {{.name = "hand", .field = "body/hand/mass"}, {.name = "fore", .field = "body/fore/mass"}});
  DesignRecord record;
  record.parameters.resize(2);
  for (DesignRecord::Parameter& p : record.parameters) {
    p.mode = 2;
    p.verdict = ParameterVerdict::kIdentified;
  }
  record.parameters[0].rests_on = {{"hand_pos", "body/hand/pos", 1.1, 1.5, ""}};  // a quarter less
  record.parameters[1].rests_on = {{"gear", "actuator/*/gear[0]", 1.1, 1.8, ""}};
  WeakenWhatMovesFar(space, record);
  EXPECT_EQ(record.parameters[0].verdict, ParameterVerdict::kIdentified) << "nothing was added";
  DesignRecord far = record;
  far.parameters[0].rests_on[0].value = 0.9;
  WeakenWhatMovesFar(space, far);
  EXPECT_EQ(far.parameters[0].verdict, ParameterVerdict::kWeak) << "more than a half";
  record.grown = {Suspect{.spec = {.name = "fore_mass", .field = "body/fore/mass"}}};
  WeakenWhatMovesFar(space, record);
  EXPECT_EQ(record.parameters[0].verdict, ParameterVerdict::kWeak);
  EXPECT_EQ(record.parameters[1].verdict, ParameterVerdict::kIdentified);
}

/// A body that is heavier with its inertia was taken for a smaller mass farther out, both of them sure.
TEST(WeakenWhatMovesFar, LeavesNoNumberOfABodyIdentifiedThatWasAdded) {
  const ParameterSpace space(
      {{.name = "upper_mass", .field = "body/upper/mass"}, {.name = "damping", .field = "joint/*/damping"}});
  DesignRecord record;
  record.parameters.resize(2);
  for (DesignRecord::Parameter& p : record.parameters) p.verdict = ParameterVerdict::kIdentified;
  record.grown = {Suspect{.spec = space[1]}};
  WeakenWhatMovesFar(space, record);
  EXPECT_EQ(record.parameters[0].verdict, ParameterVerdict::kIdentified) << "searched from the start";
  record.grown.push_back(Suspect{.spec = space[0]});
  WeakenWhatMovesFar(space, record);
  EXPECT_EQ(record.parameters[0].verdict, ParameterVerdict::kWeak);
  EXPECT_EQ(record.parameters[1].verdict, ParameterVerdict::kIdentified);
}

TEST(VerdictSentence, NamesTheErrorOfFewWindowsThatNothingIsSureOf) {
  DesignRecord record = Narrowed();
  record.verdict = DesignVerdict::kGapClosed;
  record.predicts_better = true;
  record.validation->horizons = {{0.5,
                                  50,
                                  12,
                                  false,
                                  0.9,
                                  true,
                                  {{"rail", "m", 0.1, 0.0031, 0.003, 1}, {"hook", "rad", 0.1, 0.008, 0.004, 1}},
                                  {}}};
  for (auto& channel : record.validation->horizons[0].channels) channel.judged = true;
  EXPECT_THAT(VerdictSentence(record, {}),
              HasSubstr("In hook it leaves 0.008 rad, the sensors 0.004: in few of these"));
  record.validation->horizons[0].odd_episodes = {1};
  EXPECT_THAT(VerdictSentence(record, {}),
              AllOf(Not(HasSubstr("chance")), HasSubstr("Episode 2 of the logs is far off")));
}

TEST(VerdictSentence, SaysThatTheLogsAskForMoreWhereTheSensorsExplainWhatRemains) {
  DesignRecord record = Narrowed();
  record.validation->horizons.push_back({0.5, 50, 9, false, 0.62, true, {{"servo", "rad", 0.1, 0.01, 0.01, 1}}, {}});
  record.fit.emplace();
  Suspect gain{.spec = {.name = "gain", .field = "actuator/*/gear[0]"}, .value = 1.2, .explains = 5};
  record.fit->suspects = {{gain, "", ""}};
  EXPECT_THAT(VerdictSentence(record, {}), HasSubstr("but not in every recording")) << "few nats, and none tried";
  gain.explains = 9;
  record.fit->suspects = {{gain, "", ""}};
  EXPECT_THAT(VerdictSentence(record, {}),
              HasSubstr("there the sensors explain what remains, but the logs surely ask for something that is not"));
  record.verdict = DesignVerdict::kOutsideFamily;
  record.predicts_better = false;
  EXPECT_THAT(VerdictSentence(record, {}), AllOf(HasSubstr("does not surely predict better"), HasSubstr("surely ask")));
}

TEST(VerdictSentence, OfAClassifierSaysOfTheNominalSimulatorNoMoreThanItTells) {
  DesignRecord record;
  record.verdict = DesignVerdict::kGapClosed;
  record.selected = "default";
  record.dataset.n_transitions = 1000;
  record.settings = {
      {.name = "default", .method = "paper", .common = 0.69, .c = {}, .learning_progress = {}, .seeds = {}}};
  record.nominal_common = 0.3;
  EXPECT_THAT(VerdictSentence(record, {}), EndsWith(". It can tell the nominal one"));
  record.nominal_common = 0.65;
  EXPECT_THAT(VerdictSentence(record, {}), EndsWith(". It can hardly tell the nominal one"));
  record.nominal_common = 0.688;
  EXPECT_THAT(VerdictSentence(record, {}),
              EndsWith("tell neither simulator from the logs, but an identified parameter lies "
                       "off its nominal value"));
  record.verdict = DesignVerdict::kUndecided;
  record.dataset.n_transitions = 3;
  EXPECT_THAT(VerdictSentence(record, {}),
              StartsWith("undecided: 3 transitions, of which none can be predicted, are too few"));
}

TEST(VerdictSentence, NamesChannelsThatAreNoBetterThanAGuess) {
  DesignRecord record = Narrowed();
  record.validation->horizons.push_back(
      {0.1, 10, 9, false, 0.7, true, {{"hip", "rad", 0.2, 0.1, 0.01, 0.4, true, 0.4}}, {}});
  EXPECT_THAT(VerdictSentence(record, {0}), Not(HasSubstr("guess")));
  record.validation->horizons.push_back(
      {0.5, 50, 9, false, 0.3, true, {{"hip", "rad", 0.7, 0.5, 0.01, 0.9, true, 0.4}}, {}});
  EXPECT_THAT(VerdictSentence(record, {0}),
              HasSubstr(". Over 0.5 s it predicts hip no better than a guess (its mean, "));
  record.validation->horizons.push_back(
      {1, 100, 9, false, 0.1, true, {{"hip", "rad", 0.9, 0.8, 0.01, 0.9, true, 0.4}}, {}});
  EXPECT_THAT(VerdictSentence(record, {0}), HasSubstr("goes on as it began), over 1 s likewise"));
  EXPECT_THAT(VerdictSentence(record, {0}), Not(HasSubstr("Nor could any simulator")));
  for (auto& horizon : record.validation->horizons) horizon.channels[0].floor = 0.4;
  EXPECT_THAT(VerdictSentence(record, {0}), HasSubstr("Nor could any simulator"));
}

TEST(VerdictSentence, SaysOverWhichHorizonMoreIsLeftThanSensorsExplain) {
  DesignRecord record = Narrowed();
  record.validation->horizons.push_back({0.1, 10, 9, false, 0.7, true, {{"hip", "rad", 0.2, 0.023, 0.024, 1}}, {}});
  record.validation->horizons.push_back({1, 100, 9, false, 0.1, false, {{"hip", "rad", 0.9, 0.17, 0.11, 1}}, {}});
  EXPECT_THAT(VerdictSentence(record, {0}), AllOf(StartsWith("gap narrowed by 70 % over 0.1 s (9 windows)"),
                                                  HasSubstr("hip 0.17 rad over 1 s (sensors alone: 0.11)")));
  record.validation->horizons[0].channels[0].floor = 0.01;
  EXPECT_THAT(VerdictSentence(record, {0}), HasSubstr(": hip 0.023 rad (sensors alone: 0.01)"));
}

TEST(VerdictSentence, OfADesignThatGuessesSayAsMuchAsClaimsNothing) {
  DesignRecord record = Narrowed();
  record.verdict = DesignVerdict::kOutsideFamily;
  record.validation->horizons.push_back(
      {0.1, 10, 9, false, 0.94, true, {{"elbow", "rad", 2, 0.1, 0.01, 1, true, 0.05}}, {}});
  EXPECT_THAT(VerdictSentence(record, {0}),
              HasSubstr("at no horizon does the designed simulator predict better than guesses"));
  EXPECT_THAT(VerdictSentence(record, {0}),
              HasSubstr("Over 0.1 s (9 windows) its error is 94 % less than the nominal simulator's: elbow"));
  EXPECT_THAT(VerdictSentence(record, {}), EndsWith("94 % less than the nominal simulator's"))
      << "its floor is as uncertain";
  record.validation->horizons.push_back(
      {0.5, 50, 9, false, 0.9, true, {{"elbow", "rad", 2, 0.1, 0.01, 1, true, 0.5}}, {}});
  EXPECT_THAT(VerdictSentence(record, {0}), Not(HasSubstr("at no horizon")));
}

TEST(VerdictSentence, OfAFewBriefWindowsThatItLearnedFromClaimsNoFloor) {
  DesignRecord record = Narrowed();
  record.validation->horizons.push_back({0.1, 10, 9, true, 0.9, true, {{"servo", "rad", 0.5, 0.05, 0.05, 1}}, {}, 1.1});
  EXPECT_THAT(
      VerdictSentence(record, {}),
      AllOf(HasSubstr("the design learned from all of them, and it can follow so few rows whatever the truth is. "
                      "Log more. Judged by the logs that it learned from")));
  record.validation->horizons[0].n_windows = 60;
  EXPECT_THAT(VerdictSentence(record, {}), Not(HasSubstr("whatever the truth is")));
}

TEST(VerdictSentence, WhereWindowsDoNotTellTheFloorItSaysHowFarTheErrorMayGoAndWhichEpisodesAreFarOff) {
  DesignRecord record = Narrowed();
  record.validation->horizons.push_back(
      {0.5, 50, 9, false, 0.4, true, {{"servo", "rad", 0.1, 0.06, 0.05, 1}}, {}, 2.1, {1, 4}});
  const char* may_be =
      " logs do not tell whether the sensors explain what remains: over 0.5 s it may be up to 2.1 times";
  EXPECT_THAT(VerdictSentence(record, {}),
              AllOf(StartsWith("gap narrowed by 40 % over 0.5 s (9 windows). These logs do not tell"),
                    HasSubstr(may_be), HasSubstr("Episodes 2, 5 of the logs are far off")));
  record.verdict = DesignVerdict::kUndecided;
  record.predicts_better = false;
  EXPECT_THAT(VerdictSentence(record, {}),
              AllOf(StartsWith("undecided: "), HasSubstr("does not surely predict better"), HasSubstr(may_be)));
  record.validation->horizons[0].odd_episodes.clear();
  EXPECT_THAT(VerdictSentence(record, {}), EndsWith(". Log more"));
  record.verdict = DesignVerdict::kOutsideFamily;
  EXPECT_THAT(VerdictSentence(record, {}), AllOf(Not(HasSubstr("sensors explain")), HasSubstr("ask for something")));
  record.validation->horizons[0].most_times_floor = 1.4;
  record.verdict = DesignVerdict::kGapNarrowed;
  EXPECT_THAT(VerdictSentence(record, {}), Not(HasSubstr("do not tell")));
}

TEST(VerdictSentence, NamesRecordingsThatAFitWithoutThemPredictsWorseThanTheNominalSimulator) {
  DesignRecord record = Narrowed();
  record.validation->horizons.push_back({0.5, 50, 9, false, 0.62, true, {{"servo", "rad", 0.1, 0.04, 0.01, 1}}, {}});
  record.validation->n_recordings = 1;
  record.fit.emplace();
  record.fit->left_out = {{{0.4, true, {0}}, {1.7, true, {3}}, {1.2, false, {4}}}, true};
  EXPECT_THAT(VerdictSentence(record, {0}),
              HasSubstr("1 of 3 recordings (episode 4) is predicted 70 % worse than by the nominal"));
  record.fit->left_out->parts[2].sure = true;
  EXPECT_THAT(VerdictSentence(record, {0}),
              HasSubstr("2 of 3 recordings (episodes 4, 5) are predicted up to 70 % worse"));
  record.fit->left_out->parts[1].episodes = {2, 3};
  EXPECT_THAT(VerdictSentence(record, {0}), HasSubstr("2 of 3 groups of recordings (episodes 3 with 4, 5) are"));
  EXPECT_THAT(VerdictSentence(record, {}),
              HasSubstr("there the sensors explain what remains, but not in every recording"));
  record.fit->left_out->parts = {{0.4, true, {0}}, {1.2, false, {1}}};
  EXPECT_THAT(VerdictSentence(record, {0}), EndsWith("that it did not learn from"));
}

TEST(VerdictSentence, SaysWhereSomeWindowsAloneAreFarOff) {
  DesignRecord record = Narrowed();
  DesignRecord::Validation::Channel hand{"hand", "rad", 0.1, 0.0102, 0.01, 1};
  hand.times_in_some = 4.2;
  record.validation->horizons = {{0.5, 50, 9, false, 0.62, true, {hand, {"box", "m", 0.1, 0.01, 0.01, 1}}, {}}};
  EXPECT_THAT(
      VerdictSentence(record, {0, 1}),
      HasSubstr("hand and box (over 0.5 s up to 4.2 times as much in all windows together, those of the logs that "
                "it learned from as well: some are far off)"));
  record.validation->horizons[0].channels[0].designed = 0.04;
  EXPECT_THAT(VerdictSentence(record, {0, 1}), HasSubstr("hand 0.04 rad (sensors alone: 0.01) and box"))
      << "it shows in the windows that judge";
}

/// Of a mass that was freed and kept.
FreedTrial Kept() {
  FreedTrial trial;
  trial.value = 2;
  trial.kept = true;
  trial.seconds = 0.5;
  trial.gain = {1.4, 0.1};
  return trial;
}

TEST(SuspectSentence, SaysWhatTheSensorsLeaveBesideWhatItBought) {
  FreedTrial trial = Kept();
  trial.before = {0.04};
  trial.after = {0.02};
  const auto sentence = [&](double floor) {
    DesignRecord::Validation::Channel hand{"hand", "rad"};
    hand.floor = floor;
    return SuspectSentence({.spec = {.name = "mass", .field = "body/*/mass"}, .trial = trial}, {hand}, {0});
  };
  EXPECT_THAT(sentence(0.015), EndsWith("hand 0.04 to 0.02 rad (sensors alone: 0.015)"));
  EXPECT_THAT(sentence(0), EndsWith("hand 0.04 to 0.02 rad"));
  EXPECT_THAT(sentence(0.03), EndsWith("(sensors alone: no more)")) << "0.02 is left with it";
  EXPECT_THAT(sentence(0.009),
              HasSubstr("(sensors alone: 0.009); as it leaves more than the sensors do, something else"));
}

TEST(SuspectSentence, SaysWithWhichOtherSurelyMoreIsGained) {
  FreedTrial trial = Kept();
  trial.nats = Estimated{40, 4};
  const auto sentence = [&] {
    return SuspectSentence({.spec = {.name = "mass", .field = "body/*/mass"}, .trial = trial}, {}, {});
  };
  EXPECT_THAT(
      sentence(),
      EndsWith("50 % less error over 0.5 s than without it; the logs are surely likelier with it (by 40 nats)"));
  trial.led_by = {"force_limit"};
  EXPECT_THAT(sentence(), EndsWith("(by 40 nats); the logs are surely likelier yet with 'force_limit' in its place"));
}

TEST(SuspectSentence, SaysAFactorOfASensorOfItsReading) {
  FreedTrial trial = Kept();
  trial.value = 1.03;
  const ParameterSpec scale{.name = "scale", .field = "obs/joint/hip/qpos/scale"};
  EXPECT_THAT(SuspectSentence({.spec = scale, .trial = trial}, {}, {}),
              testing::StartsWith("with obs/joint/hip/qpos/scale freed (1.03 times the model's reading): "));
}

}  // namespace oted::records_test
