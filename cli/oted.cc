// The program.

#include "cli/main.h"

int main(int argc, char** argv) { return oted::cli::Main(argc, argv); }
