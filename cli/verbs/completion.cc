#include "cli/verbs/completion.h"

#include <fmt/format.h>

#include <memory>

#include "cli/completion_words.h"
#include "cli/console.h"
#include "oted/base/error.h"

namespace oted::cli {
namespace {

/// A shell, and the script that asks this program for what can follow and takes file names where nothing can.
struct Shell {
  const char* name;
  bool explains;       ///< shows what a word means beside it
  char separator;      ///< between the two
  const char* escape;  ///< a character that needs a backslash before it in the word
  const char* script;
};

/// bash breaks words at '=' and ':' and replaces what stands behind the last of them.
constexpr const char* kBash = R"(_oted() {
  local line=${COMP_LINE:0:COMP_POINT} word typed
  local -a words
  read -a words <<<"$line"
  [[ $line == *[$' \t'] ]] && words+=('')
  typed=${words[-1]}
  COMPREPLY=()
  while IFS= read -r word; do
    [[ $word == *= ]] && compopt -o nospace 2>/dev/null
    [[ $typed == *[=:]* ]] && word=${word#"${typed%"${typed##*[=:]}"}"}
    COMPREPLY+=("$word")
  done < <("${words[0]}" completion bash -- "${words[@]:1}" 2>/dev/null)
}
complete -o default -F _oted oted
)";

constexpr const char* kZsh = R"(#compdef oted
_oted() {
  local -a lines open whole
  lines=("${(@f)$("${(Q)words[1]}" completion zsh -- "${(@Q)words[2,CURRENT]}" 2>/dev/null)}")
  lines=(${lines:#})
  if (( ! $#lines )); then
    _files
    return
  fi
  open=(${(M)lines:#*=(|:*)})
  whole=(${lines:#*=(|:*)})
  (( $#whole )) && _describe -V oted whole
  (( $#open )) && _describe -V setting open -S ''
}
if [[ ${funcstack[1]} == _oted ]]; then
  _oted "$@"
else
  compdef _oted oted
fi
)";

constexpr const char* kFish = R"(function __oted_complete
  set -l words (commandline -opc)
  set -l typed (commandline -ct)
  set -l found ($words[1] completion fish -- $words[2..-1] "$typed" 2>/dev/null)
  if test (count $found) -gt 0
    printf '%s\n' $found
  else
    __fish_complete_path $typed
  end
end
complete -c oted -f -a '(__oted_complete)'
)";

constexpr Shell kShells[] = {
    {"bash", false, ' ', "", kBash}, {"zsh", true, ':', ":", kZsh}, {"fish", true, '\t', "", kFish}};

const Shell& ShellNamed(const std::string& name) {
  for (const Shell& shell : kShells) {
    if (name == shell.name) return shell;
  }
  throw InternalError("no shell " + name);
}

void PrintWords(const Shell& shell, const std::vector<CompletionWord>& found) {
  for (const CompletionWord& word : found) {
    std::string text;
    for (const char c : word.text) {
      if (*shell.escape != '\0' && c == *shell.escape) text += '\\';
      text += c;
    }
    if (shell.explains && !word.meaning.empty()) text += shell.separator + word.meaning;
    Print("{}\n", text);
  }
}

}  // namespace

void AddCompletionVerb(Program& program) {
  std::vector<std::string> names;
  for (const Shell& shell : kShells) names.emplace_back(shell.name);
  CLI::App* verb = program.app.add_subcommand("completion", "print what makes a shell complete commands and options");
  struct Words {
    std::string shell;
    std::vector<std::string> typed;
  };
  auto words = std::make_shared<Words>();
  verb->add_option("SHELL", words->shell, "which shell")->required()->check(CLI::IsMember(names));
  verb->add_option("TYPED", words->typed,
                   "after --, the words behind 'oted' as far as they are typed: prints what the last can become");
  verb->footer(
      "In ~/.bashrc:  source <(oted completion bash)\n"
      "In ~/.zshrc, after compinit:  source <(oted completion zsh)\n"
      "Once:  oted completion fish >~/.config/fish/completions/oted.fish");
  verb->callback([&program, words] {
    const Shell& shell = ShellNamed(words->shell);
    if (words->typed.empty()) return PrintText(shell.script);
    PrintWords(shell, CompletionWords(program.app, words->typed));
  });
}

}  // namespace oted::cli
