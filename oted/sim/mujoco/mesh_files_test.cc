#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "oted/base/error.h"
#include "oted/sim/mujoco/model.h"

namespace oted::mesh_files_test {

namespace fs = std::filesystem;

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kTetrahedron = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 4 3\nf 1 2 4\nf 2 3 4\n";

class MeshFiles : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "arm_description/urdf");
    fs::create_directories(folder_ / "arm_description/meshes");
    std::ofstream(folder_ / "arm_description/meshes/link.obj") << kTetrahedron;
  }
  void TearDown() override {
    fs::remove_all(folder_);
    unsetenv("ROS_PACKAGE_PATH");
    unsetenv("AMENT_PREFIX_PATH");
  }

  /// An arm of one link with a mesh, as ROS writes it.
  int MeshesOf(const fs::path& urdf, const std::string& mesh) {
    std::ofstream(urdf, std::ios::trunc)
        << "<robot name='arm'><link name='base'/><link name='link'><inertial><mass value='1'/>"
        << "<inertia ixx='.01' iyy='.01' izz='.01' ixy='0' ixz='0' iyz='0'/></inertial><collision><geometry><mesh "
           "filename='"
        << mesh << "'/></geometry></collision></link><joint name='j' type='continuous'><parent link='base'/>"
        << "<child link='link'/><axis xyz='0 1 0'/></joint></robot>";
    return static_cast<int>(LoadModel(urdf).model->nmesh);
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / "oted_mesh_files_test";
};

TEST_F(MeshFiles, APackageIsFoundAboveTheModelAndBesideTheFoldersAbove) {
  EXPECT_EQ(MeshesOf(folder_ / "arm_description/urdf/arm.urdf", "package://arm_description/meshes/link.obj"), 1);
  fs::create_directories(folder_ / "bringup/config");
  EXPECT_EQ(MeshesOf(folder_ / "bringup/config/arm.urdf", "package://arm_description/meshes/link.obj"), 1);
}

TEST_F(MeshFiles, APackageIsFoundWhereRosSaysThatPackagesAre) {
  const fs::path elsewhere = folder_ / "robot";
  fs::create_directories(elsewhere / "ws/share");
  fs::rename(folder_ / "arm_description", elsewhere / "ws/share/arm_description");
  fs::create_directories(folder_ / "mine");
  const auto meshes = [&] { return MeshesOf(folder_ / "mine/arm.urdf", "package://arm_description/meshes/link.obj"); };
  EXPECT_THAT(meshes, ThrowsMessage<DataError>(AllOf(HasSubstr("package://arm_description/meshes/link.obj"),
                                                     HasSubstr((folder_ / "mine/arm_description").string()),
                                                     HasSubstr("ROS_PACKAGE_PATH"))));
  setenv("ROS_PACKAGE_PATH", ("/nowhere:" + (elsewhere / "ws/share").string()).c_str(), 1);
  EXPECT_EQ(meshes(), 1);
  unsetenv("ROS_PACKAGE_PATH");
  setenv("AMENT_PREFIX_PATH", (elsewhere / "ws").c_str(), 1);
  EXPECT_EQ(meshes(), 1);
}

TEST_F(MeshFiles, AFileUrlIsTheFile) {
  const fs::path mesh = folder_ / "arm_description/meshes/link.obj";
  EXPECT_EQ(MeshesOf(folder_ / "arm.urdf", "file://" + mesh.string()), 1);
}

}  // namespace oted::mesh_files_test
