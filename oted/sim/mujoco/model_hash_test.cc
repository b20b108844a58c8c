#include "oted/sim/mujoco/model_hash.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "oted/base/files.h"
#include "oted/base/testing.h"

namespace oted::model_hash_test {

constexpr const char* kModel = R"(<mujoco>
  <asset><mesh name="wedge" file="wedge.obj"/></asset>
  <worldbody><body><freejoint/><geom type="mesh" mesh="wedge" density="700"/></body></worldbody>
</mujoco>)";
constexpr const char* kWedge =
    "v -0.2 -0.1 -0.1\nv 0.2 -0.1 -0.1\nv 0 0.1 -0.1\nv 0.05 0 0.15\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

TEST(ModelSha256, IsThatOfTheModelWhereverItLiesAndHoweverItIsNamed) {
  const TestFolder folder;
  for (const char* place : {"here", "there"}) {
    WriteFileAtomically(folder.path() / place / "model.xml", kModel);
    WriteFileAtomically(folder.path() / place / "wedge.obj", kWedge);
  }
  const std::string here = LoadModel(folder.path() / "here/model.xml").sha256;
  EXPECT_EQ(LoadModel(folder.path() / "there/model.xml").sha256, here);
  EXPECT_EQ(LoadModel(folder.path() / "there/../here/model.xml").sha256, here);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path() / "here");
  const std::string in_its_own_folder = LoadModel("model.xml").sha256;
  std::filesystem::current_path(before);
  EXPECT_EQ(in_its_own_folder, here);

  std::string wider = kWedge;
  wider.replace(wider.find("0.15"), 4, "0.16");
  // Elsewhere: MuJoCo keeps what it has read of a file.
  WriteFileAtomically(folder.path() / "wider/model.xml", kModel);
  WriteFileAtomically(folder.path() / "wider/wedge.obj", wider);
  EXPECT_NE(LoadModel(folder.path() / "wider/model.xml").sha256, here);
}

TEST(ModelSha256, IsOfTheMjbFileWhereNothingComesFromFiles) {
  const TestFolder folder;
  WriteFileAtomically(folder.path() / "model.xml", "<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>");
  const LoadedModel loaded = LoadModel(folder.path() / "model.xml");
  loaded.model->opt.disableflags = loaded.disable_flags;
  EXPECT_EQ(loaded.sha256, Sha256(SerializeModel(*loaded.model)));
}

}  // namespace oted::model_hash_test
