#include "cli/completion_words.h"

#include "cli/value_kinds.h"

namespace oted::cli {
namespace {

using Words = std::vector<std::string>;

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

/// "TEXT:{sac,crossq}" is what CLI11 makes of a check for names.
Words CheckedNames(const std::string& type) {
  Words names;
  const size_t begin = type.find('{'), end = type.rfind('}');
  if (begin == std::string::npos || end == std::string::npos) return names;
  for (const std::string& name : CLI::detail::split(type.substr(begin + 1, end - begin - 1), ','))
    names.push_back(name);
  return names;
}

std::vector<CompletionWord> Values(const CLI::Option& option, const std::string& before, const std::string& typed) {
  const std::string type = option.get_type_name();
  std::vector<CompletionWord> found;
  for (const Words& values : {CheckedNames(type), ValuesOfKind(type, typed)}) {
    for (const std::string& value : values) {
      if (value.starts_with(typed)) found.push_back({before + value, ""});
    }
  }
  return found;
}

/// Where a command line stands behind some words.
struct Place {
  const CLI::App* command;
  const CLI::Option* open = nullptr;  ///< the option whose value comes next, or may go on
  bool must_follow = false;           ///< the value must come next
  size_t n_positional = 0;            ///< words of no option so far
};

void Step(Place& place, const std::string& word) {
  if (place.must_follow) {
    place.must_follow = false;
    if (!place.open->get_allow_extra_args()) place.open = nullptr;
  } else if (word.starts_with('-')) {
    const size_t equals = word.find('=');
    const CLI::Option* option = place.command->get_option_no_throw(word.substr(0, equals));
    const bool takes_value = option != nullptr && option->get_items_expected_max() > 0;
    place.open = takes_value && equals == std::string::npos ? option : nullptr;
    place.must_follow = place.open != nullptr;
  } else if (place.open == nullptr) {
    const auto is_it = [&](const CLI::App* command) { return command->check_name(word); };
    const auto commands = place.command->get_subcommands(is_it);
    if (commands.empty()) {
      ++place.n_positional;
    } else {
      place.command = commands.front();
    }
  }
}

std::vector<CompletionWord> OptionNames(const CLI::App& command, const std::string& typed) {
  std::vector<CompletionWord> found;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      if (("--" + name).starts_with(typed)) found.push_back({"--" + name, FirstLine(option->get_description())});
    }
  }
  return found;
}

std::vector<CompletionWord> CommandNames(const CLI::App& command, const std::string& typed) {
  std::vector<CompletionWord> found;
  for (const CLI::App* verb : command.get_subcommands([](const CLI::App*) { return true; })) {
    if (verb->get_name().starts_with(typed)) found.push_back({verb->get_name(), FirstLine(verb->get_description())});
  }
  return found;
}

}  // namespace

std::vector<CompletionWord> CompletionWords(const CLI::App& app, const std::vector<std::string>& typed) {
  Place place{&app};
  for (size_t i = 0; i + 1 < typed.size(); ++i) Step(place, typed[i]);
  const std::string& last = typed.back();
  if (!place.must_follow && last.starts_with('-')) {
    const size_t equals = last.find('=');
    if (equals == std::string::npos) return OptionNames(*place.command, last);
    const CLI::Option* option = place.command->get_option_no_throw(last.substr(0, equals));
    if (option == nullptr) return {};
    return Values(*option, last.substr(0, equals + 1), last.substr(equals + 1));
  }
  if (place.open != nullptr) return Values(*place.open, "", last);
  std::vector<CompletionWord> found;
  if (place.n_positional == 0) found = CommandNames(*place.command, last);
  if (!found.empty()) return found;
  const auto positional = place.command->get_options([](const CLI::Option* o) { return o->get_positional(); });
  if (place.n_positional < positional.size()) return Values(*positional[place.n_positional], "", last);
  return {};
}

}  // namespace oted::cli
