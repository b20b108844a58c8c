#pragma once
/// The final tables on the terminal.

#include <filesystem>
#include <vector>

#include "cli/options.h"
#include "oted/run/design_record.h"
#include "oted/run/design_step.h"

namespace oted::cli {

/// Decimals with which returns are printed: three where all of them are small, as a grid world's are.
int ReturnDecimals(const std::vector<double>& returns, int otherwise);

/// Prints what the design found; nothing where JSON is wanted, which comes in one piece.
/// @param truth  of each parameter, where that is known: its errors are printed
void PrintDesign(const DesignRecord& design, const Options& options, const std::vector<double>& truth = {});
/// The values of designs that nothing has judged yet; empty where JSON is wanted.
std::string UnjudgedInWords(const std::vector<Design>& designs, const Options& options);
/// Prints the final tables of a run directory (or its JSON) and where its files lie, and returns the exit code that its
/// verdict stands for.
/// @param report  the folder of report.html
int PrintResult(const std::filesystem::path& run_directory, const Options& options,
                const std::filesystem::path& report);
/// With the report in the run directory.
int PrintResult(const std::filesystem::path& run_directory, const Options& options);

}  // namespace oted::cli
