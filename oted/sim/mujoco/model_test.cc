#include "oted/sim/mujoco/model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "oted/base/error.h"
#include "oted/sim/mujoco/task.h"

namespace oted::model_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

TEST(LoadModel, IsSilentAboutDeprecatedAttributes) {
  const std::filesystem::path before = std::filesystem::current_path();
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "oted_model_test";
  std::filesystem::create_directories(folder);
  std::filesystem::current_path(folder);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  // It uses settotalmass, which MuJoCo 4.0 warns about.
  const LoadedModel loaded = LoadModel(AssetFolder() / "half_cheetah.xml");
  EXPECT_EQ(testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(std::filesystem::is_empty(folder)) << "MuJoCo writes MUJOCO_LOG.TXT here when nothing stops it";
  std::filesystem::current_path(before);
  std::filesystem::remove_all(folder);
  EXPECT_DOUBLE_EQ(mj_getTotalmass(loaded.model.get()), 14);
}

TEST(LoadModel, KeepsADivergedStateInsteadOfResettingIt) {
  EXPECT_TRUE(LoadModel(AssetFolder() / "hopper.xml").model->opt.disableflags & mjDSBL_AUTORESET);
}

TEST(LoadModel, EqualFilesGiveEqualFingerprints) {
  const auto hash = [](const char* file) { return LoadModel(AssetFolder() / file).sha256; };
  EXPECT_EQ(hash("hopper.xml"), hash("hopper.xml"));
  EXPECT_NE(hash("walker2d.xml"), hash("walker2d_v5.xml"));
}

TEST(LoadModel, AModelThatASmallFileBlowsUpIsRefused) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "oted_large.xml";
  std::ofstream(path) << "<mujoco><asset><texture name='t' type='2d' builtin='flat' width='7000' height='7000'/>"
                         "</asset><worldbody><geom size='1'/></worldbody></mujoco>";
  EXPECT_THAT([&] { LoadModel(path); },
              ThrowsMessage<DataError>(AllOf(HasSubstr(path.string()), HasSubstr("140 MiB, wanted at most 128"))));
}

TEST(LoadModel, SaysWhyAFileDoesNotCompileInOneLine) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "oted_broken.xml";
  std::ofstream(path) << "<mujoco><worldbody><geom type='sphere' size='-1'/></worldbody></mujoco>";
  EXPECT_THAT([&] { LoadModel(path); },
              ThrowsMessage<DataError>(AllOf(HasSubstr(path.string()), HasSubstr("size"), Not(HasSubstr("\n")))));
  std::ofstream(path, std::ios::trunc) << "<mujoco><worldbody>";
  EXPECT_THAT([&] { LoadModel(path); }, ThrowsMessage<DataError>(Not(HasSubstr("\n"))));
  std::ofstream(path, std::ios::trunc) << "<mujoco><worldbody><geom size='.1' mass='nan'/></worldbody></mujoco>";
  EXPECT_THAT([&] { LoadModel(path); }, ThrowsMessage<DataError>(HasSubstr("NaN"))) << "MuJoCo takes the density";
  std::filesystem::remove(path);
  EXPECT_THROW(LoadModel(path), DataError);
}

}  // namespace oted::model_test
