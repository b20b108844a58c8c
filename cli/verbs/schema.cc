#include "cli/verbs/schema.h"

#include "cli/console.h"
#include "oted/config/task_file_schema.h"

namespace oted::cli {

void AddSchemaVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand("schema", "print the JSON schema of the task file, for editors");
  verb->footer(
      "docs/task_files.md says how an editor finds it. 'oted init --schema' writes it beside a new task file.");
  verb->callback([] { PrintText(TaskFileSchemaText()); });
}

}  // namespace oted::cli
