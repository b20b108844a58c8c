#include "oted/sim/sysid_file.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::sysid_file_test {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kFromSysid = R"(friction:
  frozen: false
  max_value:
  - 2.0
  min_value:
  - 0.2
  name: friction
  nominal:
  - 1.0
  value:
  - 1.5e-01
)";

std::vector<SysidParameter> Read(const std::string& text) {
  TestFolder folder;
  WriteFileAtomically(folder / "params.yaml", text);
  return ReadSysidFile(folder / "params.yaml");
}

std::string With(std::string text, const std::string& what, const std::string& instead) {
  const size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos);
  return text.replace(at, what.size(), instead);
}

std::vector<ParameterSpec> Merge(const std::vector<SysidParameter>& file, std::vector<ParameterSpec> declared = {},
                                 bool has_range = false) {
  const std::vector<bool> ranges(declared.size(), has_range);
  return MergeSysid(file, "params.yaml", declared, ranges);
}

TEST(SysidFile, SysidReadsWhatWasWrittenAndItsOwnCopyIsReadAgain) {
  const std::vector<SysidParameter> written = {
      {.spec = {.name = "friction", .field = "geom/*/friction[0]", .low = 0.2, .high = 2}, .value = 0.549},
      {.spec = {.name = "tiny",
                .field = "actuator/#0/gainprm[0]",
                .low = 1e-7,
                .high = 1e22,
                .scale = ParameterScale::kAbsolute,
                .logarithmic = true,
                .unit = "N \"m\": # 1",
                .nominal = 1e-5},
       .value = 0.1 + 0.2},
      {.spec = {.name = "no", .field = "opt/gravity[2]", .low = -2, .high = 2}, .value = 1, .frozen = true}};
  TestFolder folder;
  WriteFileAtomically(folder / "params.yaml", SysidText(written, "Made by: a test\n- of # hashes"));
  ASSERT_TRUE(RunPython(R"(
from mujoco.sysid._src.parameter import ParameterDict
p = ParameterDict.load_from_disk("params.yaml")
assert p.keys() == ["friction", "tiny", "no"], p.keys()
assert [float(v.value[0]) for v in p.values()] == [0.549, 0.1 + 0.2, 1]
assert [v.nominal.tolist() for v in p.values()] == [[1], [1e-5], [1]]
assert [b.tolist() for b in p.get_bounds()] == [[0.2, 1e-7], [2, 1e22]], "of the free ones"
assert p["no"].frozen and p.size == 2
p.update_from_vector([0.7, 3])
p.save_to_disk("again.yaml")
)",
                        folder));
  const std::vector<SysidParameter> ours = ReadSysidFile(folder / "params.yaml");
  ASSERT_EQ(ours.size(), 3u);
  for (size_t i = 0; i < ours.size(); ++i) {
    EXPECT_TRUE(ours[i].has_ours);
    EXPECT_EQ(ours[i].spec.name, written[i].spec.name);
    EXPECT_EQ(ours[i].spec.field, written[i].spec.field);
    EXPECT_EQ(ours[i].spec.low, written[i].spec.low);
    EXPECT_EQ(ours[i].spec.high, written[i].spec.high);
    EXPECT_EQ(ours[i].spec.scale, written[i].spec.scale);
    EXPECT_EQ(ours[i].spec.logarithmic, written[i].spec.logarithmic);
    EXPECT_EQ(ours[i].spec.unit, written[i].spec.unit);
    EXPECT_EQ(ours[i].spec.nominal, written[i].spec.nominal);
    EXPECT_EQ(ours[i].value, written[i].value);
    EXPECT_EQ(ours[i].frozen, written[i].frozen);
  }
  // mujoco.sysid sorts by name and knows nothing of fields.
  const std::vector<SysidParameter> theirs = ReadSysidFile(folder / "again.yaml");
  ASSERT_EQ(theirs.size(), 3u);
  EXPECT_EQ(theirs[0].spec.name, "friction");
  EXPECT_EQ(theirs[0].value, 0.7);
  EXPECT_EQ(theirs[2].spec.low, 1e-7);
  EXPECT_TRUE(theirs[1].frozen);
  EXPECT_FALSE(theirs[0].has_ours);
  EXPECT_EQ(theirs[0].spec.field, "");
}

TEST(SysidFile, EachDefectIsAnErrorThatNamesFileAndParameter) {
  const auto message = [](const std::string& text) { return MessageOf<DataError>([&] { Read(text); }); };
  EXPECT_EQ(Read(kFromSysid).size(), 1u);
  EXPECT_THAT(message(""), HasSubstr("no table"));
  EXPECT_THAT(message("- 1\n- 2\n"), HasSubstr("params.yaml"));
  EXPECT_THAT(message("a: [1, 2\nb: }"), HasSubstr("is not YAML"));
  EXPECT_THAT(message(std::string(100000, '[')), HasSubstr("is not YAML"));
  EXPECT_THAT(message("friction: 3\n"), HasSubstr("'friction'"));
  EXPECT_THAT(message("? [1, 2]\n: {}\n"), HasSubstr("without a name"));
  EXPECT_THAT(message(With(kFromSysid, "  nominal:\n  - 1.0\n", "")),
              AllOf(HasSubstr("'nominal'"), HasSubstr("'friction'")));
  EXPECT_THAT(message(With(kFromSysid, "- 0.2", "- 3")), HasSubstr("min_value < max_value"));
  EXPECT_THAT(message(With(kFromSysid, "- 0.2", "- .nan")), HasSubstr("finite"));
  EXPECT_THAT(message(With(kFromSysid, "- 0.2", "- {a: 1}")), HasSubstr("finite"));
  EXPECT_THAT(message(With(kFromSysid, "- 0.2", "- 0.2\n  - 0.3")),
              AllOf(HasSubstr("2 numbers"), HasSubstr("one parameter")));
  EXPECT_THAT(message(With(kFromSysid, "frozen: false", "frozen: 7")), HasSubstr("'frozen'"));
  EXPECT_THAT(message(std::string(kFromSysid) + "  field: geom/*/friction[0]\n"), HasSubstr("'scale'"));
  EXPECT_THAT(message(std::string(kFromSysid) + "  field: a/b/c\n  scale: times\n  log: false\n"),
              HasSubstr("'times'"));
  EXPECT_THAT(message(std::string(2 << 20, ' ')), HasSubstr("bytes"));
  EXPECT_THAT(MessageOf<DataError>([] { ReadSysidFile("no/such.yaml"); }), HasSubstr("no/such.yaml"));
}

TEST(SysidFile, MutatedBytesGiveADataErrorOrParametersOfFiniteNumbers) {
  const std::string whole = SysidText({{.spec = {.name = "friction", .field = "geom/*/friction[0]"}, .value = 0.5},
                                       {.spec = {.name = "gain", .field = "actuator/#0/gear[0]"}, .value = 1e-5}},
                                      "two");
  TestFolder folder;
  Rng rng = RngKey(3).Stage("mutations").MakeRng();
  int refused = 0;
  for (int i = 0; i < 600; ++i) {
    std::string text = whole;
    for (uint64_t n = 1 + rng.Below(4); n > 0; --n) {
      const size_t at = rng.Below(text.size());
      switch (rng.Below(3)) {
        case 0:
          text[at] = static_cast<char>(rng.Below(256));
          break;
        case 1:
          text.erase(at, 1 + rng.Below(20));
          break;
        default:
          text.insert(at, text.substr(rng.Below(text.size()), rng.Below(40)));
      }
    }
    std::ofstream(folder / "params.yaml", std::ios::binary) << text;
    try {
      for (const SysidParameter& p : ReadSysidFile(folder / "params.yaml")) {
        EXPECT_TRUE(std::isfinite(p.spec.nominal) && std::isfinite(p.value) && p.spec.low < p.spec.high) << text;
      }
    } catch (const DataError& e) {
      ++refused;
      EXPECT_THAT(e.what(), AllOf(HasSubstr("params.yaml"), testing::Not(HasSubstr("\n"))));
    }
  }
  EXPECT_GT(refused, 100);
  EXPECT_LT(refused, 600);
}

TEST(MergeSysid, AFieldComesFromTheConfigurationOrFromTheFileAndElseIsAskedFor) {
  const std::vector<SysidParameter> file = Read(kFromSysid);
  EXPECT_THAT(MessageOf<UsageError>([&] { Merge(file); }),
              AllOf(HasSubstr("'friction'"), HasSubstr("field ="), HasSubstr("[parameters]")));
  const auto declared = Merge(file, {{.name = "friction", .field = "geom/*/friction[0]", .low = 0.5, .high = 0.6}});
  ASSERT_EQ(declared.size(), 1u);
  EXPECT_EQ(declared[0].field, "geom/*/friction[0]");
  EXPECT_EQ(declared[0].low, 0.2) << "the file's";
  EXPECT_EQ(declared[0].high, 2);
  const auto ranged = Merge(file, {{.name = "friction", .field = "geom/*/friction[0]", .low = 0.5, .high = 0.6}}, true);
  EXPECT_EQ(ranged[0].low, 0.5) << "the configuration's, where it gives one";
  const auto recorded =
      Merge(Read(std::string(kFromSysid) + "  field: opt/gravity[2]\n  scale: nominal\n  log: true\n"),
            {{.name = "mass", .field = "body/*/mass"}});
  ASSERT_EQ(recorded.size(), 2u) << "others of the configuration stay";
  EXPECT_EQ(recorded[0].field, "opt/gravity[2]");
  EXPECT_TRUE(recorded[0].logarithmic);
  EXPECT_EQ(recorded[1].name, "mass");
}

TEST(MergeSysid, NominalValuesThatCannotBeMeantAreRefused) {
  const std::vector<SysidParameter> file = Read(With(kFromSysid, "- 1.0", "- 0.8"));
  EXPECT_THAT(MessageOf<UsageError>([&] { Merge(file, {{.name = "friction", .field = "geom/*/friction[0]"}}); }),
              AllOf(HasSubstr("0.8"), HasSubstr("absolute")));
  const auto absolute =
      Merge(file, {{.name = "friction", .field = "geom/*/friction[0]", .scale = ParameterScale::kAbsolute}});
  EXPECT_EQ(absolute[0].wanted_nominal, 0.8) << "for the simulator to compare with the model";
}

// mujoco.sysid skips a frozen parameter whose value is not the model's, silently.
TEST(MergeSysid, AFrozenParameterIsLeftOutAtItsNominalValueAndRefusedElsewhere) {
  const std::string frozen = With(kFromSysid, "frozen: false", "frozen: true");
  EXPECT_THAT(MessageOf<UsageError>([&] { Merge(Read(frozen)); }),
              AllOf(HasSubstr("frozen at 0.15"), HasSubstr("'friction'")));
  EXPECT_TRUE(Merge(Read(With(frozen, "1.5e-01", "1.0"))).empty());
}

}  // namespace oted::sysid_file_test
