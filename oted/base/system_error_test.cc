#include "oted/base/system_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <string>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"

namespace oted::system_error_test {

using testing::AllOf;
using testing::HasSubstr;

std::string Refusal(int error) {
  return MessageOf<FileError>([&] { ThrowSystemError("write", "/logs/a.csv", error); });
}

TEST(ThrowSystemError, SaysWhatWhereWhyAndWhatToDo) {
  EXPECT_THAT(Refusal(ENOSPC),
              AllOf(HasSubstr("cannot write '/logs/a.csv'"), HasSubstr("No space left"), HasSubstr("free some space")));
  EXPECT_THAT(Refusal(EMFILE), HasSubstr("ulimit -n"));
  EXPECT_THAT(Refusal(EFBIG), HasSubstr("ulimit -f"));
  EXPECT_THAT(Refusal(ENOMEM), HasSubstr("free memory"));
  EXPECT_THAT(Refusal(EACCES), HasSubstr("fix its permissions"));
}

TEST(ThrowSystemError, ANameThatNoFileCanHaveIsAWrongRequest) {
  EXPECT_THROW(ThrowSystemError("open", std::string(300, 'a'), ENAMETOOLONG), UsageError);
  EXPECT_THROW(ThrowSystemError("open", "a.csv", EIO), FileError);
}

TEST(ThrowSystemError, AFolderOrALinkToItselfInAFilesPlaceIsNamed) {
  const TestFolder folder;
  std::filesystem::create_directories(folder / "name.json");
  std::filesystem::create_symlink("itself.json", folder / "itself.json");
  EXPECT_THAT(MessageOf<Error>([&] { ReadFile(folder / "name.json"); }),
              AllOf(HasSubstr("name.json"), HasSubstr("give a file")));
  EXPECT_THAT(MessageOf<Error>([&] { WriteFileAtomically(folder / "name.json", "{}"); }),
              HasSubstr("folder that has the file's name"));
  EXPECT_THAT(MessageOf<Error>([&] { ReadFile(folder / "itself.json"); }),
              AllOf(HasSubstr("itself.json"), HasSubstr("it leads to itself")));
}

}  // namespace oted::system_error_test
