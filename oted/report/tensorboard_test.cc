#include "oted/report/tensorboard.h"

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::tensorboard_test {

TEST(Crc32cTest, MatchesThePublishedTestVectors) {
  // RFC 3720, appendix B.4, and the check value of the CRC catalogue.
  EXPECT_EQ(Crc32c("123456789"), 0xE3069283u);
  EXPECT_EQ(Crc32c(std::string(32, '\0')), 0x8A9136AAu);
  EXPECT_EQ(Crc32c(std::string(32, '\xff')), 0x62A8AB43u);
}

TEST(TfRecordTest, FramesDataWithItsLengthAndTwoChecksums) {
  const std::string record = TfRecord("abc");
  ASSERT_EQ(record.size(), 8u + 4 + 3 + 4);
  EXPECT_EQ(record.substr(0, 8), std::string("\x03\0\0\0\0\0\0\0", 8));
  EXPECT_EQ(record.substr(12, 3), "abc");
}

TEST(EventFileWriterTest, TensorBoardReadsBackTheSameScalars) {
  TestFolder folder;
  {
    EventFileWriter writer(folder.path());
    for (int step = 0; step < 20; ++step) writer.Scalar("eval/mean_reward", 1000 * step, 0.5 * step - 3);
    writer.Scalar("train/ent_coef", int64_t{1} << 40, 0.1);
    writer.Scalar("train/ent_coef", -1, -2.5e-8);
  }
  EXPECT_TRUE(RunPython(R"(
import glob, numpy
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
(name,) = glob.glob('events.out.tfevents.*')
events = list(EventFileLoader(name).Load())
assert events[0].file_version == 'brain.Event:2', events[0]
assert len(events) == 1 + 20 + 2, len(events)
assert all(abs(e.wall_time - events[0].wall_time) < 3600 and e.wall_time > 1.6e9 for e in events)
accumulator = EventAccumulator('.', size_guidance={'scalars': 0})
accumulator.Reload()
assert sorted(accumulator.Tags()['scalars']) == ['eval/mean_reward', 'train/ent_coef'], accumulator.Tags()
got = [(s.step, s.value) for s in accumulator.Scalars('eval/mean_reward')]
assert got == [(1000 * i, 0.5 * i - 3) for i in range(20)], got
values = [e for e in events if e.summary.value and e.summary.value[0].tag == 'train/ent_coef']
got = [(e.step, e.summary.value[0].tensor.float_val[0] if e.summary.value[0].HasField('tensor')
        else e.summary.value[0].simple_value) for e in values]
assert [(s, numpy.float32(v)) for s, v in got] == [(2**40, numpy.float32(0.1)), (-1, numpy.float32(-2.5e-8))], got
)",
                        folder));
}

TEST(EventFileWriterTest, TwoWritersOfOneSecondKeepTheirOwnFiles) {
  TestFolder folder;
  const EventFileWriter first(folder.path());
  const EventFileWriter second(folder.path());
  EXPECT_NE(first.path(), second.path());
  EXPECT_TRUE(first.path().filename().string().starts_with("events.out.tfevents."));
}

TEST(EventFileWriterTest, NamesAFolderThatCannotBeWritten) {
  TestFolder folder;
  WriteFileAtomically(folder / "taken", "a file");
  const std::string message = MessageOf<DataError>([&] { EventFileWriter writer(folder.path() / "taken" / "inner"); });
  EXPECT_NE(message.find("taken"), std::string::npos) << message;
}

}  // namespace oted::tensorboard_test
