#pragma once
/// The whole program as a function: a program with a task of its own registers it and calls this
/// (examples/custom_task).

namespace oted::cli {

/// @return the exit code (docs/exit_codes.md)
int Main(int argc, char** argv);

}  // namespace oted::cli
