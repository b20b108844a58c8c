#include "oted/report/summary.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

namespace oted::summary_test {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

std::string Text(const json& sentences) {
  std::string text;
  for (const json& sentence : sentences) text += sentence.get<std::string>() + "\n";
  return text;
}

json Parameter(const char* name, double mode, const char* verdict) {
  return {{"name", name}, {"mode", mode}, {"std", 0.05}, {"verdict", verdict}};
}

TEST(SummariseTest, TheHeadlineIsTheVerdictsSentenceAsTheDesignWroteIt) {
  const auto headline = [](const json& design) {
    return Summarise({{"design", design}})["headline"].get<std::string>();
  };
  EXPECT_EQ(headline({{"verdict", "gap_narrowed"}, {"sentence", "gap narrowed by 62 %"}}), "Gap narrowed by 62 %.");
  EXPECT_THAT(headline({{"verdict", "gap_closed"}}), HasSubstr("no verdict was recorded"));
  EXPECT_THAT(Summarise(json::object())["headline"].get<std::string>(), HasSubstr("yet"));
}

TEST(SummariseTest, NamesWhatTheLogsPinDownAndWhatTheyDoNot) {
  const json summary = Summarise({{"design", {{"verdict", "gap_closed"}}},
                                  {"dataset", {{"n_episodes", 5}, {"n_transitions", 1749}}},
                                  {"parameters",
                                   {Parameter("gain", 1.297, "identified"), Parameter("friction", 0.7, "weak"),
                                    Parameter("damping", 1, "not_identified")}}});
  EXPECT_EQ(summary["asked"],
            "Which values of gain, friction and damping make the simulator behave as in the 5 logged episodes (1,749 "
            "steps)?");
  EXPECT_THAT(Text(summary["found"]),
              HasSubstr("determine gain (1.297\u00a0±\u00a00.050), if what was not searched is as in the model."));
  EXPECT_THAT(Text(summary["found"]), HasSubstr("roughly what friction is"));
  EXPECT_THAT(Text(summary["found"]), Not(HasSubstr("damping")));
  EXPECT_THAT(Text(summary["unknown"]), HasSubstr("do not tell damping"));
  EXPECT_THAT(Text(summary["unknown"]), HasSubstr("where the other parameters go with them"));
}

TEST(SummariseTest, APolicyThatWasNotEvaluatedIsToldWhereThereIsOne) {
  json report = {{"design", {{"verdict", "gap_closed"}}}};
  EXPECT_THAT(Text(Summarise(report)["unknown"]), Not(HasSubstr("policy")));
  report["policy_selection"] = {{"selected", 1}};
  EXPECT_THAT(Text(Summarise(report)["unknown"]), HasSubstr("No policy was evaluated in the target"));
}

TEST(SummariseTest, ChannelsThatTheRobotShowsLateAreToldToWhoUsesAPolicy) {
  const json channel = {{"name", "hip_vel"}, {"judged", false}};
  const json design = {{"verdict", "gap_closed"}, {"validation", {{"horizons", {{{"channels", {channel}}}}}}}};
  EXPECT_THAT(Text(Summarise({{"design", design}})["unknown"]),
              HasSubstr("Simulators show hip_vel exactly and at once"));
}

TEST(SummariseTest, WithATruthItStatesTheErrors) {
  json parameter = Parameter("gain", 1.2, "identified");
  parameter["truth"] = 1.3;
  parameter["absolute_error"] = 0.1;
  json other = parameter;
  other["name"] = "friction";
  other["absolute_error"] = 0.3;
  const json summary = Summarise({{"design", json::object()}, {"parameters", {parameter, other}}});
  EXPECT_THAT(Text(summary["trust"]),
              HasSubstr("The design did not see the truth. Its errors: gain 0.100 and friction 0.300."));
}

TEST(SummariseTest, ScoresAreGivenRelativeToAPerfectMatch) {
  const double log2 = std::log(2.0);
  const json design = {
      {"verdict", "gap_closed"},
      {"selected", "b"},
      {"log2", log2},
      {"nominal_common", log2 - 0.25},
      {"settings", {{{"name", "a"}, {"common", log2 - 0.9}}, {{"name", "b"}, {"common", log2 - 0.03}}}}};
  const json summary = Summarise({{"design", design}});
  EXPECT_THAT(Text(summary["trust"]),
              HasSubstr("\u22120.030 for the designed simulator and \u22120.250 for the nominal one"));
}

TEST(SummariseTest, AFitTellsTheNoiseOrTheChannelsThatDisagree) {
  const auto summary = [](bool drifts) {
    const json channels = {{{"name", "height"}, {"noise_std", 0.01}, {"disagrees", false}},
                           {{"name", "speed"}, {"noise_std", 0.2}, {"disagrees", drifts}}};
    return Summarise({{"design", {{"fit", {{"explained", 0.95}, {"channels", channels}}}}}});
  };
  EXPECT_THAT(Text(summary(false)["trust"]), HasSubstr("explains 95% of the logged windows"));
  EXPECT_THAT(Text(summary(false)["trust"]), HasSubstr("of 0.0100 to 0.200"));
  EXPECT_THAT(Text(summary(true)["found"]), HasSubstr("the error of speed is more than the sensors explain"));
  EXPECT_THAT(Text(summary(true)["trust"]), Not(HasSubstr("explains")));
}

TEST(SummariseTest, SaysNoMoreOfWhatIsLeftThanTheLogsTell) {
  const auto unknown = [](bool disagrees) {
    const json channels = {{{"name", "hip"}, {"noise_std", 0.01}, {"disagrees", disagrees}}};
    return Text(Summarise({{"design", {{"verdict", "gap_narrowed"}, {"fit", {{"channels", channels}}}}}})["unknown"]);
  };
  EXPECT_THAT(unknown(true), HasSubstr("More error is left than the sensors explain"));
  EXPECT_THAT(unknown(false), HasSubstr("Whether the sensors explain what is left these logs do not tell"));
}

TEST(SummariseTest, WhatIsNotSearchedAndOffByTheLogsIsNamedWithTheLineThatFreesIt) {
  const json kept = {{"field", "action/delay"},
                     {"sentence", "with action/delay freed: better"},
                     {"line", "delay = {}"},
                     {"freed", {{"kept", true}}}};
  const json fit = {{"explained", 0.9}, {"suspects", {kept, {{"sentence", "with b freed: no better"}, {"line", "b"}}}}};
  const json grown = {{{"name", "wear"}, {"field", "joint/*/damping"}}};
  const json summary = Summarise({{"design", {{"fit", fit}, {"grown", grown}}}});
  const std::string found = Text(summary["found"]), unknown = Text(summary["unknown"]);
  EXPECT_THAT(found, HasSubstr("with action/delay freed: better. Add this line to them: delay = {}"));
  EXPECT_THAT(unknown, HasSubstr("with b freed: no better."));
  EXPECT_THAT(unknown + found, Not(HasSubstr("no better. Add this line")));
  EXPECT_THAT(found, HasSubstr("The parameter wear (joint/*/damping) was added by the design itself"));
  EXPECT_THAT(found, Not(HasSubstr("Add the first"))) << "there is one";
  const json two = Summarise({{"design", {{"fit", {{"explained", 0.9}, {"suspects", {kept, kept}}}}}}});
  EXPECT_THAT(Text(two["found"]), HasSubstr("Add the first of these lines alone and design again"));
  json led = kept;
  led.update({{"name", "late"}, {"line", "late = {}"}, {"freed", {{"kept", true}, {"led_by", {"delay"}}}}});
  json leads = kept;
  leads["name"] = "delay";
  const json one = Summarise({{"design", {{"fit", {{"explained", 0.9}, {"suspects", {leads, led}}}}}}});
  EXPECT_THAT(Text(one["found"]), HasSubstr("Add this line to them: delay = {}"));
  EXPECT_THAT(Text(one["found"]), Not(HasSubstr("late = {}"))) << "the two may stand for one cause";
}

TEST(SummariseTest, SaysWhichFormWasTakenWhereItWasLeftOpenAndWhy) {
  const json choices = {{{"method", "transitions"}, {"picked", "a-transitions"}, {"reason", "it is nearer"}},
                        {{"method", "paper"}, {"picked", "b"}, {"reason", "nothing else can be done"}}};
  const std::string trust =
      Text(Summarise({{"design", {{"selected", "a-transitions"}, {"method_choices", choices}}}})["trust"]);
  EXPECT_THAT(trust, HasSubstr("method transitions: it is nearer."));
  EXPECT_THAT(trust, Not(HasSubstr("paper"))) << "of a setting that was not selected";
}

TEST(SummariseTest, AValueAtABoundIsNotTrusted) {
  const json summary =
      Summarise({{"parameters", {Parameter("friction", 1.99, "at_bound"), Parameter("gain", 1.9, "identified")}}});
  EXPECT_THAT(Text(summary["unknown"]), HasSubstr("friction ended at the edge"));
  EXPECT_THAT(Text(summary["found"]), Not(HasSubstr("friction")));
}

TEST(SummariseTest, SaysHowFarTheReplaysEndFromTheLogs) {
  json replay = {{"n_steps", 50},
                 {"n_windows", 32},
                 {"error", {{"nominal", {{"median", {0, 1, 2.5}}}}, {"designed", {{"median", {0, 0.1, 0.25}}}}}}};
  EXPECT_THAT(
      Text(Summarise({{"replay", replay}})["trust"]),
      testing::AllOf(HasSubstr("50 replayed actions"), HasSubstr("designed simulator is 0.250 standard deviations"),
                     HasSubstr("nominal one 2.50 standard"), HasSubstr("median of 32")));
  EXPECT_THAT(Text(Summarise({{"replay", replay}})["unknown"]), Not(HasSubstr("no nearer")));
  replay["error"]["designed"]["median"][2] = 3;
  EXPECT_THAT(Text(Summarise({{"replay", replay}})["unknown"]), HasSubstr("no nearer"));
  replay["error"]["nominal"]["median"][2] = nullptr;
  EXPECT_THAT(Text(Summarise({{"replay", replay}})["trust"]), HasSubstr("broke down"));
}

TEST(SummariseTest, ComparesThePoliciesByName) {
  const json summary = Summarise({{"policies",
                                   {{{"name", "oted_sac"}, {"mean_return", 1731.5}},
                                    {{"name", "clone"}, {"mean_return", 904.1}},
                                    {{"name", "sac_nominal"}, {"mean_return", 612.8}}}}});
  EXPECT_THAT(Text(summary["found"]), testing::AllOf(HasSubstr("returns 1,732"),
                                                     HasSubstr("clone of the logged "
                                                               "behaviour 904"),
                                                     HasSubstr("nominal simulator 613")));
}

TEST(SummariseTest, BaselinesFollow) {
  const json summary = Summarise({{"policies",
                                   {{{"name", "bc_dr"}, {"mean_return", 301}},
                                    {{"name", "sac_dr"}, {"mean_return", 302}},
                                    {{"name", "sac_is"}, {"mean_return", 303}},
                                    {{"name", "oted_sac"}, {"mean_return", 1731.5}}}}});
  EXPECT_THAT(Text(summary["found"]),
              testing::AllOf(HasSubstr("returns 1,732"), HasSubstr("clone of logs and randomised simulators 301"),
                             HasSubstr("domain randomisation 302"), HasSubstr("interval search 303.")));
}

TEST(SummariseTest, AgentsOfEitherAlgorithmAreNamed) {
  const json summary = Summarise({{"policies",
                                   {{{"name", "ppo_nominal"}, {"mean_return", 0.917}},
                                    {{"name", "oted_ppo"}, {"mean_return", 0.929}},
                                    {{"name", "expert"}, {"mean_return", 0.96}}}}});
  EXPECT_THAT(Text(summary["found"]), testing::AllOf(HasSubstr("returns 0.929"), HasSubstr("nominal simulator 0.917")));
}

}  // namespace oted::summary_test
