#include "oted/plan/plan.h"

#include <gmock/gmock.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/plan/child_program.h"
#include "oted/plan/indices.h"
#include "oted/plan/slurm.h"

namespace oted {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

PlanLine LineNamed(const std::string& name) {
  PlanLine line;
  line.key = UnitKey(name);
  line.name = name;
  line.words = {"design", "a b.toml", "--seed", "1"};
  line.labels = {{"seed", "1"}, {"data", "a.csv"}};
  line.inputs = {{"/data/a.csv", std::string(64, 'a')}};
  line.needs = {2, 300, 7};
  return line;
}

TEST(Plan, IsReadAsItWasWrittenAndGivesTheSameBytes) {
  const TestFolder folder;
  Plan plan;
  plan.kind = PlanKind::kStudy;
  plan.command = {"reproduce", "table1"};
  plan.lines = {LineNamed("one"), LineNamed("two")};
  WriteFileAtomically(folder / "plan.jsonl", plan.ToText());
  const Plan read = Plan::Read(folder / "plan.jsonl");
  EXPECT_EQ(read.ToText(), plan.ToText());
  EXPECT_EQ(read.lines.at(1).labels, plan.lines[1].labels);
  EXPECT_EQ(read.MostNeeds().memory_mib, 300);
}

TEST(Plan, AnEditedOneIsRefused) {
  const TestFolder folder;
  Plan plan;
  plan.lines = {LineNamed("one"), LineNamed("two")};
  std::string text = plan.ToText();
  const auto message = [&](const std::string& content) {
    WriteFileAtomically(folder / "plan.jsonl", content);
    return MessageOf<DataError>([&] { Plan::Read(folder / "plan.jsonl"); });
  };
  EXPECT_THAT(message(text.substr(0, text.rfind('{'))), HasSubstr("not as it was written"));
  EXPECT_THAT(message("{}\n"), HasSubstr("no head of a plan"));
  EXPECT_THAT(message(""), HasSubstr("no head of a plan"));
  plan.kind = PlanKind::kStudy;
  EXPECT_THAT(message(plan.ToText()), HasSubstr("names no command"));
  text.replace(text.find("a b.toml"), 1, "c");
  EXPECT_THAT(message(text), HasSubstr("not as it was written"));
}

TEST(Plan, TheSameWorkTwiceIsRefused) {
  Plan plan;
  plan.lines = {LineNamed("one"), LineNamed("one")};
  plan.lines[1].name = "other name";
  EXPECT_THAT(MessageOf<UsageError>([&] { plan.ToText(); }), HasSubstr("'other name' are the same work"));
  plan.lines.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { plan.ToText(); }), HasSubstr("no units"));
}

TEST(PlanInput, IsTheContentOfAFileOrOfAllFilesOfAFolder) {
  const TestFolder folder;
  WriteFileAtomically(folder / "a/x", "1");
  WriteFileAtomically(folder / "b/x", "1");
  EXPECT_EQ(PlanInput::Of(folder / "a/x").sha256, Sha256("1"));
  EXPECT_EQ(PlanInput::Of(folder / "a").sha256, PlanInput::Of(folder / "b").sha256);
  WriteFileAtomically(folder / "b/y", "");
  EXPECT_NE(PlanInput::Of(folder / "a").sha256, PlanInput::Of(folder / "b").sha256);
  EXPECT_THAT(MessageOf<DataError>([&] { PlanInput::Of(folder / "none"); }), HasSubstr("does not exist"));
}

TEST(Indices, AreRangesAsSchedulersTakeThem) {
  EXPECT_EQ(IndexRanges({}), "");
  EXPECT_EQ(IndexRanges({5}), "5");
  EXPECT_EQ(IndexRanges({0, 1, 2, 3, 7, 9, 10}), "0-3,7,9-10");
}

TEST(Indices, AboveAnArraysLimitGoIntoFurtherArrays) {
  const std::vector<IndexChunk> chunks = ChunksOf({0, 9, 10, 25}, 10);
  ASSERT_EQ(chunks.size(), 3u);
  EXPECT_THAT(chunks[0].indices, ElementsAre(0, 9));
  EXPECT_EQ(chunks[1].offset, 10);
  EXPECT_THAT(chunks[1].indices, ElementsAre(0));
  EXPECT_EQ(chunks[2].offset + chunks[2].indices[0], 25);
}

TEST(ChildProgram, EndsWithItsCodeOrItsSignal) {
  const TestFolder folder;
  const auto code_of = [&](const std::string& script) {
    ChildProgram child({"sh", "-c", script}, folder / "log");
    while (true) {
      if (const auto code = child.Poll()) return *code;
    }
  };
  EXPECT_EQ(code_of("echo out; echo err >&2; exit 3"), 3);
  EXPECT_EQ(code_of("kill -9 $$"), 137);
  EXPECT_EQ(ReadFile(folder / "log"), "out\nerr\n");
  ChildProgram none({"/no/such/program"}, folder / "log");
  std::optional<int> code;
  while (!(code = none.Poll())) {
  }
  EXPECT_EQ(*code, 127);
}

TEST(ChildProgram, IsSeenToEndWhereTheSystemKeepsNoStatus) {
  const TestFolder folder;
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  ChildProgram child({"sh", "-c", "exit 3"}, folder / "log");
  std::optional<int> code;
  for (int i = 0; i < 2000 && !(code = child.Poll()); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  std::signal(SIGCHLD, before);
  EXPECT_EQ(code, ChildProgram::kUnknownEnd);
}

TEST(ChildProgram, OutputIsWhatItPrintsAndAFailureSaysWhy) {
  EXPECT_EQ(OutputOf({"echo", "it's", "a  b"}), "it's a  b\n");
  EXPECT_THAT(MessageOf<DataError>([] {
                OutputOf({"sh", "-c", "echo why >&2; exit 5"});
              }),
              testing::AllOf(HasSubstr("ended with 5"), HasSubstr("why")));
  EXPECT_THAT(MessageOf<DataError>([] { OutputOf({"no-such-program"}); }), HasSubstr("not installed"));
}

}  // namespace
}  // namespace oted
