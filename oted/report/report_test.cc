#include "oted/report/report.h"

#include <gmock/gmock.h>

#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/data/gzip.h"
#include "oted/report/gather.h"
#include "oted/report/sample_run.h"

namespace oted::report_test {

using nlohmann::json;
using testing::HasSubstr;

// Stands in for plotly.js (5 MB) where the page around it is looked at.
constexpr const char* kStandIn = "/* stand-in for plotly */";

// Says what was looked for when it is not there, and not the whole page.
testing::AssertionResult Contains(const std::string& page, const std::string& part) {
  if (page.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "the page has no '" << part << "'";
}

class WriteReportTest : public testing::Test {
 protected:
  void SetUp() override {
    WriteFileAtomically(plotly_ / "plotly.min.js", kStandIn);
    ::setenv("OTED_PLOTLY_JS", (plotly_ / "plotly.min.js").c_str(), 1);
  }
  void TearDown() override { ::unsetenv("OTED_PLOTLY_JS"); }
  std::string Page() const { return ReadFile(folder_ / "report.html"); }

  TestFolder folder_;
  TestFolder plotly_;
  SampleRun run_{folder_.path()};
};

// An HTML parser of its own: elements balance, figures hold JSON, nothing points outside, links of the contents bar
// lead somewhere.
constexpr const char* kCheckPage = R"(
import html.parser, json
VOID = {'meta', 'link', 'br', 'img', 'input'}
class Page(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.ids, self.hrefs, self.tags, self.figures = [], set(), [], set(), 0
        self.pictures = []
        self.json = False
    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.add(tag)
        for name, value in attributes.items():
            assert not name.startswith('on'), (tag, name)
            if name in ('src', 'href', 'srcset', 'action', 'data', 'poster'):
                if tag == 'img':
                    assert name == 'src' and value.startswith('data:image/webp;base64,'), (tag, name, value)
                    self.pictures.append(value.split(',')[1])
                    continue
                assert name == 'href' and value.startswith(('#', 'data:,')), (tag, name, value)
                self.hrefs.append(value)
        if 'id' in attributes:
            assert attributes['id'] not in self.ids
            self.ids.add(attributes['id'])
        if tag not in VOID: self.open.append(tag)
        self.json = tag == 'script' and attributes.get('type') == 'application/json'
    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, (tag, self.getpos())
        self.json = False
    def handle_data(self, data):
        if self.json:
            figure = json.loads(data)
            assert figure['data'], 'an empty figure'
            self.figures += 1
page = Page()
text = open('report.html', encoding='utf-8').read()
page.feed(text)
page.close()
assert not page.open, page.open
for href in page.hrefs:
    assert href.startswith('data:') or href[1:] in page.ids, href
assert '@import' not in text and 'url(' not in text
assert 'http:' not in text and 'https:' not in text
)";

TEST_F(WriteReportTest, TheJsonIsWhatTheFilesHoldWithASummary) {
  run_.WriteAll();
  WriteReport(folder_.path());
  json report = ReadJson(folder_ / "report.json");
  for (const char* own : {"seal", "files"}) EXPECT_EQ(report.erase(own), 1u) << own;
  EXPECT_THAT(report["summary"]["headline"].get<std::string>(), HasSubstr("Gap closed: over 0.5 s"));
  report.erase("summary");
  EXPECT_EQ(report, GatherReport(folder_.path()));
}

TEST_F(WriteReportTest, NoHeadingSpeaksOfLogsKeptAsideWhereNoneWere) {
  for (const bool learned : {false, true}) {
    run_.WriteDesign();
    json design = ReadJson(folder_ / "design.json");
    design["validation"] = {
        {"n_recordings", 1},
        {"horizons", {{{"seconds", 0.5}, {"n_windows", 5}, {"learned", learned}, {"channels", json::array()}}}}};
    Seal(design);
    WriteJson(folder_ / "design.json", design);
    WriteReport(folder_.path());
    EXPECT_EQ(Page().find("logs that it did not see") == std::string::npos, learned);
    EXPECT_EQ(Page().find("Held-out logs") == std::string::npos, learned);
  }
}

TEST_F(WriteReportTest, BaselinesStandBesideTheAgents) {
  run_.WriteAll();
  std::filesystem::create_directories(folder_ / "baselines/is");
  std::filesystem::copy(folder_ / "nominal/2", folder_ / "baselines/is/2", std::filesystem::copy_options::recursive);
  WriteReport(folder_.path());
  EXPECT_TRUE(RunPython(std::string(kCheckPage) + R"(
assert 'agent 2, interval search' in text, 'its curve'
assert '>interval search<' in text, 'its row'
)",
                        folder_));
}

TEST_F(WriteReportTest, AWholeRunGivesAWellFormedPageThatNeedsNothingElse) {
  run_.WriteAll();
  WriteReport(folder_.path());
  EXPECT_TRUE(RunPython(std::string(kCheckPage) + R"(
assert page.ids == {'top', 'parameters', 'policies', 'warnings', 'design', 'discriminator', 'selection', 'agents',
                    'policy-selection', 'data', 'clone', 'run'}, page.ids
assert page.figures == 1 + 3 + 1 + 2 + 1 + 1 + 1 + 1 + 1, page.figures
)",
                        folder_));
  const std::string page = Page();
  EXPECT_TRUE(Contains(page, "1.297\u00a0±\u00a00.012"));
  EXPECT_TRUE(Contains(page, "default-src 'none'"));
  EXPECT_TRUE(Contains(page, kStandIn));
  EXPECT_TRUE(Contains(page, "prefers-color-scheme: dark"));
}

TEST_F(WriteReportTest, TheMotionIsInThePageAsCurvesAndPictures) {
  run_.WriteMotion();
  WriteReport(folder_.path());
  EXPECT_TRUE(RunPython(std::string(kCheckPage) + R"(
import base64
assert page.ids == {'top', 'replay'}, page.ids
assert page.figures == 2 + 1, page.figures
names = [base64.b64decode(picture) for picture in page.pictures]
assert names == [b'frames of logged', b'frames of nominal', b'frames of designed'], names
assert 'data-period="0.008"' in text and 'aria-label="Designed' in text
)",
                        folder_));
  EXPECT_TRUE(Contains(Page(), "The stretch shown starts at step 24 of episode 1"));
  // report.json names the files: no megabytes of pictures in it.
  const json report = ReadJson(folder_ / "report.json");
  EXPECT_EQ(report["motion"]["panels"][0], (json{{"name", "logged"}, {"file", "logged.webp"}}));
}

TEST_F(WriteReportTest, WithoutPicturesThePageSaysWhy) {
  run_.WriteMotion();
  WriteJson(folder_ / "motion/motion.json", {{"schema", "oted.motion/1"}, {"note", "no OpenGL <here>"}});
  WriteReport(folder_.path());
  EXPECT_TRUE(RunPython(std::string(kCheckPage) + "assert page.figures == 3 and not page.pictures\n", folder_));
  EXPECT_TRUE(Contains(Page(), "No pictures of the motion: no OpenGL &lt;here&gt;."));
  WriteJson(folder_ / "motion/replay.json", {{"schema", "oted.replay/1"}, {"note", "Nothing to replay."}});
  WriteReport(folder_.path());
  EXPECT_TRUE(Contains(Page(), "<p>Nothing to replay.</p>"));
}

TEST_F(WriteReportTest, IndependentParametersGetNoCorrelationPlot) {
  run_.WriteDesign();
  WriteReport(folder_.path());
  EXPECT_TRUE(Contains(Page(), "How the parameters trade off"));
  json design = ReadJson(folder_ / "design.json");
  design["correlation"] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  WriteJson(folder_ / "design.json", design);
  WriteReport(folder_.path());
  EXPECT_FALSE(Contains(Page(), "How the parameters trade off"));
}

TEST_F(WriteReportTest, FormsThatWereTriedStandWithTheirErrorsAndTheTakenOneIsMarked) {
  run_.WriteDesign();
  json design = ReadJson(folder_ / "design.json");
  const auto tried = [](const char* form, double error, double gain) {
    return json{{"method", form}, {"error", error}, {"gain", gain}, {"gain_std", 0.01}};
  };
  design["method_choices"] = {{{"setting", "paper"},
                               {"method", "transitions"},
                               {"picked", "paper"},
                               {"reason", "it is nearest"},
                               {"n_windows", 48},
                               {"n_steps", 10},
                               {"nominal_error", 9.75},
                               {"tried", {tried("trajectories", 3.25, 0), tried("transitions", 2.5, 0.26)}}}};
  WriteJson(folder_ / "design.json", design);
  WriteReport(folder_.path());
  EXPECT_TRUE(RunPython(kCheckPage, folder_));
  const std::string page = Page();
  for (const char* part : {"replayed 48 windows of 10 steps", ">3.25<", ">2.50<", ">9.75<", "it is nearest."}) {
    EXPECT_TRUE(Contains(page, part)) << part;
  }
}

TEST_F(WriteReportTest, TheFilePlotlyComesInIsTheRealOneByDefault) {
  ::unsetenv("OTED_PLOTLY_JS");
  run_.WriteClone();
  WriteReport(folder_.path());
  const std::string page = Page();
  EXPECT_GT(page.size(), 1'000'000u);
  EXPECT_TRUE(Contains(page, "plotly.js v"));
}

TEST_F(WriteReportTest, HostileNamesStayText) {
  const std::string hostile = "</script><script>alert('x')</script><img src=x onerror=alert(1)>\"&";
  run_.names = {hostile, "gain", "gravity"};
  run_.WriteAll();
  json design = ReadJson(folder_ / "design.json");
  design["warnings"] = {hostile};
  design["selected"] = hostile;
  design["settings"][0]["name"] = hostile;
  design["settings"][0]["method"] = hostile;
  design["model"] = {{hostile, hostile}};
  design["method_choices"] = {{{"setting", hostile},
                               {"method", hostile},
                               {"picked", hostile},
                               {"reason", hostile},
                               {"tried", {{{"method", hostile}, {"error", hostile}}}}}};
  WriteJson(folder_ / "design.json", design);
  json evaluation = ReadJson(folder_ / "evaluation.json");
  evaluation["task"] = hostile;
  evaluation["policies"][0]["label"] = hostile;
  evaluation["parameters"][0]["unit"] = hostile;
  WriteJson(folder_ / "evaluation.json", evaluation);
  WriteFileAtomically(folder_ / "run.toml", SealedText(hostile, ""));
  std::filesystem::rename(folder_ / "agents/1", folder_ / "agents/<b onclick=1>");
  WriteReport(folder_.path());
  EXPECT_TRUE(
      RunPython(std::string(kCheckPage) + "assert 'img' not in page.tags and 'b' in page.tags, page.tags\n", folder_));
  const std::string page = Page();
  for (const char* markup : {"<img", "<script>alert", "<b onclick"}) {
    EXPECT_EQ(page.find(markup), std::string::npos) << markup;
  }
  EXPECT_EQ(ReadJson(folder_ / "report.json")["warnings"][0], hostile);
}

TEST_F(WriteReportTest, ASingleStageGivesItsOwnSectionsOnly) {
  const auto expect_ids = [this](const std::string& ids) {
    WriteReport(folder_.path());
    EXPECT_TRUE(RunPython(kCheckPage + fmt::format("assert page.ids == {{'top', {}}}, page.ids\n", ids), folder_));
    std::filesystem::remove_all(folder_.path());
    std::filesystem::create_directories(folder_.path());
  };
  run_.WriteClone();
  expect_ids("'clone'");
  run_.WriteDesignSeeds();
  expect_ids("'design', 'discriminator'");
  run_.WriteDesign();
  expect_ids("'parameters', 'warnings', 'design', 'selection', 'run'");
  run_.WriteAgents();
  expect_ids("'agents', 'policy-selection'");
  run_.WriteEvaluation();
  expect_ids("'parameters', 'policies'");
  run_.WriteDataset();
  expect_ids("'data', 'run'");
}

TEST_F(WriteReportTest, APackedPlotlyGivesTheSamePage) {
  run_.WriteClone();
  WriteReport(folder_.path());
  const std::string page = Page();
  WriteFileAtomically(plotly_ / "plotly.min.js.gz", Gzip(kStandIn));
  ::setenv("OTED_PLOTLY_JS", (plotly_ / "plotly.min.js.gz").c_str(), 1);
  WriteReport(folder_.path());
  EXPECT_EQ(Page(), page);
}

TEST_F(WriteReportTest, NullAndMissingFieldsAreShownAsUnknown) {
  WriteJson(folder_ / "design.json",
            {{"schema", "oted.design/1"}, {"parameters", {{{"name", "x"}, {"mode", nullptr}}}}});
  WriteJson(folder_ / "evaluation.json", {{"schema", "oted.evaluation/1"}, {"policies", {{{"name", "clone"}}}}});
  WriteReport(folder_.path());
  EXPECT_TRUE(RunPython(kCheckPage, folder_));
  EXPECT_TRUE(Contains(Page(), "<td data-label=\"Policy\">clone</td><td class=\"num\" data-label=\"Return\">–</td>"));
}

TEST_F(WriteReportTest, AMissingPlotlyIsAnErrorWithTheRemedyAndWritesNothing) {
  run_.WriteClone();
  ::setenv("OTED_PLOTLY_JS", (plotly_ / "missing.js").c_str(), 1);
  EXPECT_THAT(MessageOf<DataError>([&] { WriteReport(folder_.path()); }),
              testing::AllOf(HasSubstr("missing.js"), HasSubstr("make setup"), HasSubstr("OTED_PLOTLY_JS")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "report.json"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "report.html"));
}

TEST_F(WriteReportTest, TextThatIsNoUtf8IsAnErrorNotACrash) {
  run_.WriteClone();
  WriteFileAtomically(folder_ / "run.toml", SealedText("name = \"\xff\xfe\"\n", ""));
  EXPECT_THAT(MessageOf<DataError>([&] { WriteReport(folder_.path()); }), HasSubstr("UTF-8"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "report.html"));
}

TEST_F(WriteReportTest, TheSameFilesGiveTheSamePage) {
  run_.WriteAll();
  WriteReport(folder_.path());
  const std::string first = Page();
  WriteReport(folder_.path());
  EXPECT_EQ(Page(), first);
}

}  // namespace oted::report_test
