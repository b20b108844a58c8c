#pragma once
/// Which program, on which processor, when: what the record of a run says.

#include <filesystem>
#include <string>

namespace oted::cli {

/// The processor's name: what speeds in the record mean.
std::string Cpu();
/// The time, for the record: UTC, ISO 8601.
std::string Now();
/// versions.json of a run directory: which versions ran what, where and since when.
void WriteVersions(const std::filesystem::path& run_directory, const std::string& command_line,
                   const std::string& started);
/// The program's command line, as typed.
std::string CommandLine(int argc, char** argv);

}  // namespace oted::cli
