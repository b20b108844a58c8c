#include "oted/proposal/task_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "oted/base/error.h"
#include "oted/config/parameters_toml.h"
#include "oted/config/toml_writer.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr size_t kLine = 120;

std::string Toml(const std::string& text) {
  std::ostringstream out;
  WriteTomlValue(out, text);
  return out.str();
}

template <class T>
std::string Toml(const std::vector<T>& values) {
  std::string list;
  for (const T& value : values) list += (list.empty() ? "" : ", ") + json(value).dump();
  return "[" + list + "]";
}

/// From the file's folder where both are near, otherwise from the root.
std::string PathFrom(const std::filesystem::path& file, const std::string& path) {
  if (path.starts_with("package:")) return path;
  const std::filesystem::path from = std::filesystem::absolute(file).parent_path();
  const std::string near = std::filesystem::absolute(path).lexically_normal().lexically_relative(from).string();
  return near.empty() || near.starts_with("../../..") ? std::filesystem::absolute(path).lexically_normal().string()
                                                      : near;
}

/// As comments, broken into lines.
void WriteComment(std::ostream& out, const std::string& text) {
  std::istringstream words(Printable(text));
  std::string line = "#", word;
  while (words >> word) {
    if (line.size() + 1 + word.size() > kLine) {
      out << line << "\n";
      line = "#  ";
    }
    line += " " + word;
  }
  out << line << "\n";
}

void WriteComments(std::ostream& out, const std::string& title, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  out << "# " << title << "\n";
  for (const std::string& line : lines) WriteComment(out, "- " + line);
}

/// A list of columns, each with the number that it is.
void WriteColumns(std::ostream& out, const char* key, const std::vector<ColumnMap::Entry>& entries) {
  size_t widest = 0;
  for (const ColumnMap::Entry& entry : entries) widest = std::max(widest, json(entry.column).dump().size());
  out << key << " = [\n";
  for (const ColumnMap::Entry& entry : entries) {
    out << fmt::format("  {:<{}}  # {}{}\n", json(entry.column).dump() + ",", widest + 1, Printable(entry.path),
                       entry.by_order ? " (by its number: check)" : "");
  }
  out << "]\n";
}

void WriteTask(std::ostream& out, const Proposal& proposal, const std::filesystem::path& file) {
  const ModelTask& task = proposal.config.task.model;
  const ModelTask plain;
  out << "[task]\n";
  out << "model = " << Toml(PathFrom(file, task.model)) << "\n";
  out << fmt::format("control_period = {:.10g}  # [s]\n", task.control_period);
  out << "observations = " << Toml(task.observations) << "\n";
  if (!task.unobserved.empty()) {
    out << "unobserved = " << Toml(task.unobserved)
        << "  # not in the logs: they keep their start values, or follow by an equality\n";
  }
  if (!task.motors.empty()) out << "motors = " << Toml(task.motors) << "  # the model has no actuators\n";
  if (task.actions != plain.actions) out << "actions = " << Toml(task.actions) << "\n";
  if (!task.action_range.empty()) {
    out << "action_range = " << Toml(task.action_range) << "  # as far as the logs go; write what the drive can\n";
  }
  out << "start = " << Toml(task.start) << "\n";
  if (task.max_episode_steps != plain.max_episode_steps) {
    out << "max_episode_steps = " << task.max_episode_steps << "  # the longest episode of the logs\n";
  }
  out << "# reward = \"...\"  # agents need one, the design does not (docs/task_files.md)\n";
}

void WriteData(std::ostream& out, const Proposal& proposal, const std::filesystem::path& file) {
  const DataConfig& data = proposal.config.data;
  out << "\n[data]\n";
  if (data.recordings.empty()) {
    out << "path = " << Toml(PathFrom(file, data.path)) << "\n";
  } else {
    out << "recordings = [\n";
    for (const DataConfig::Recording& recording : data.recordings) {
      out << "  { path = " << Toml(PathFrom(file, recording.path)) << " },\n";
    }
    out << "]\n";
  }
  // What has the model's names the reader finds by itself.
  const auto has_names = [](const std::vector<ColumnMap::Entry>& entries, const std::string& prefix) {
    return std::ranges::all_of(entries, [&](const ColumnMap::Entry& entry) {
      return entry.column == entry.path || entry.column == prefix + entry.path;
    });
  };
  const bool known = has_names(proposal.columns.observations, "obs.") && has_names(proposal.columns.actions, "act.");
  if (!known && !data.columns.observations.empty()) {
    WriteColumns(out, "observations", proposal.columns.observations);
    WriteColumns(out, "actions", proposal.columns.actions);
  }
  if (!data.columns.episode.empty()) out << "episode = " << Toml(data.columns.episode) << "\n";
  if (!data.columns.time.empty()) out << "time = " << Toml(data.columns.time) << "\n";
  if (!data.unwrap.empty()) out << "unwrap = " << Toml(data.unwrap) << "\n";
  WriteComments(out, "Columns that are not used:", proposal.columns.unused);
}

void WriteParameters(std::ostream& out, const Proposal& proposal) {
  out << "\n[parameters]  # multiples of nominal unless scale = \"absolute\"; narrow each range to what you know\n";
  size_t widest = 0;
  for (const ParameterSpec& spec : proposal.config.parameters) widest = std::max(widest, spec.name.size());
  for (const ParameterSpec& spec : proposal.config.parameters) out << ParameterLine(spec, widest) << "\n";
  if (proposal.NamesActuated()) out << "# @actuated: " << Proposal::kActuated << "\n";
  if (proposal.left_out.empty()) return;
  out << "# Not freed. What has a line of its own acts as others do: to free it, take the # off its line, and put one\n"
         "# before the line of one of these.\n";
  for (const ParameterChoice::LeftOut& of : proposal.left_out) {
    WriteComment(out, "- " + of.why);
    if (of.alternative) out << "# " << ParameterLine(*of.alternative) << "\n";
  }
}

}  // namespace

std::string TaskText(const Proposal& proposal, const std::filesystem::path& file) {
  std::ostringstream out;
  out << fmt::format("# A first task file. Read it, correct it, then: oted data check {0}; oted design {0} --out RUN\n",
                     Printable(file.filename().string()));
  WriteComments(out, "Guessed, so check it:", proposal.guessed);
  WriteComments(out, "Look at this before a design:", proposal.suspicious);
  out << "\n";
  WriteTask(out, proposal, file);
  WriteData(out, proposal, file);
  WriteParameters(out, proposal);
  return out.str();
}

}  // namespace oted
