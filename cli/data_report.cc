#include "cli/data_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "cli/console.h"
#include "oted/data/checks_dynamics.h"

namespace oted::cli {
namespace {

constexpr size_t kWidth = 110;  // columns of text

/// `label` at the margin of an entry, `text` beside it, wrapped at words.
void PrintWrapped(const std::string& label, const std::string& text) {
  constexpr size_t kIndent = 12;
  std::string line = fmt::format("    {:<8}", label), word;
  std::istringstream words(text);
  bool is_empty = true;
  while (words >> word) {
    if (!is_empty && line.size() + 1 + word.size() > kWidth) {
      Print("{}\n", line);
      line = std::string(kIndent, ' ');
      is_empty = true;
    }
    line += (is_empty ? "" : " ") + word;
    is_empty = false;
  }
  Print("{}\n", line);
}

void PrintHead(const Dataset& dataset, const SimulatorSpec* spec) {
  Print("{:<14}{}\n{:<14}{}\n", "file", dataset.path, "sha256", dataset.sha256);
  if (spec != nullptr) {
    Print("{:<14}{}, one step every {:.4g} s\n", "task", spec->task, spec->control_period_s);
  }
}

/// "row 17 (episode 1, step 18)"; empty for a finding about no row in particular.
std::string Where(const Dataset& dataset, const Finding& finding) {
  if (finding.row < 0) return "";
  const std::vector<Episode> episodes = dataset.Episodes();
  for (size_t e = 0; e < episodes.size(); ++e) {
    if (finding.row >= episodes[e].end) continue;
    return fmt::format("first in row {} (episode {}, step {})", finding.row, e + 1,
                       finding.row - episodes[e].begin + 1);
  }
  return fmt::format("first in row {}", finding.row);
}

void PrintChannels(const char* kind, const std::vector<ChannelSummary>& channels) {
  Print("\n{:<26} {:>12} {:>12} {:>12} {:>12}\n", kind, "lowest", "highest", "mean", "std");
  for (const ChannelSummary& c : channels) {
    Print("{:<26} {:>12.5g} {:>12.5g} {:>12.5g} {:>12.5g}\n", c.name, c.low, c.high, c.mean, c.std);
  }
}

void PrintReturns(const SimulatorSpec* spec, const std::vector<double>& returns) {
  const bool has_score = spec != nullptr && spec->has_score();
  double sum = 0;
  for (const double r : returns) sum += r;
  const double mean = sum / static_cast<double>(returns.size());
  const auto [low, high] = std::minmax_element(returns.begin(), returns.end());
  Print("{:<14}mean {:.1f}, from {:.1f} to {:.1f}", "returns", mean, *low, *high);
  if (has_score) Print("; D4RL score of the mean {:.1f}", spec->NormalizedScore(mean));
  Print("\n");
  constexpr size_t kMostShown = 20;
  if (returns.size() > kMostShown) {
    Print("{:<14}the first {} of {} episodes; --json has all\n", "", kMostShown, returns.size());
  }
  Print("\n{:<10} {:>12}{}\n", "episode", "return", has_score ? fmt::format(" {:>10}", "score") : "");
  for (size_t e = 0; e < std::min(kMostShown, returns.size()); ++e) {
    const std::string score = has_score ? fmt::format(" {:>10.1f}", spec->NormalizedScore(returns[e])) : "";
    Print("{:<10} {:>12.2f}{}\n", e + 1, returns[e], score);
  }
}

/// "joint/hip/qpos [rad]", as far as both are known.
std::vector<std::string> ChannelLabels(const SimulatorSpec* spec, size_t n_channels) {
  const TaskFacts facts = spec != nullptr ? FactsOf(*spec) : TaskFacts{};
  std::vector<std::string> labels(n_channels);
  for (size_t j = 0; j < n_channels; ++j) {
    labels[j] = facts.ObservationName(static_cast<int>(j));
    const bool has_unit = spec != nullptr && j < spec->observation_units.size() && !spec->observation_units[j].empty();
    if (has_unit) labels[j] += fmt::format(" [{}]", spec->observation_units[j]);
  }
  return labels;
}

/// Noise and one-step error, channel by channel, in the channel's unit.
void PrintPerChannel(const SimulatorSpec* spec, const DataCheck& check) {
  if (check.noise.empty() && !check.one_step) return;
  const bool has_one_step = check.one_step && check.one_step->n_rows > 0;
  const size_t n = check.noise.empty() ? check.one_step->rms_error.size() : check.noise.size();
  const std::vector<std::string> labels = ChannelLabels(spec, n);
  size_t widest = 26;
  for (const std::string& label : labels) widest = std::max(widest, label.size());
  Print("\n{:<{}} {:>12} {:>14}{}\n", "channel", widest, "change/row", "noise std",
        has_one_step ? fmt::format(" {:>16} {:>13}", "one-step error", "error/change") : "");
  for (size_t j = 0; j < n; ++j) {
    std::string change = "-", noise = "-", one_step;
    if (!check.noise.empty()) {
      const ChannelNoise& c = check.noise[j];
      change = fmt::format("{:.3g}", c.rms_change);
      if (c.assessable) noise = c.visible ? fmt::format("{:.2g}", c.sigma) : fmt::format("< {:.2g}", c.below);
    }
    if (has_one_step) {
      const double error = check.one_step->rms_error[j], of = check.one_step->rms_change[j];
      one_step = fmt::format(" {:>16.3g} {:>13}", error, of > 0 ? fmt::format("{:.2g}", error / of) : "-");
    }
    Print("{:<{}} {:>12} {:>14}{}\n", labels[j], widest, change, noise, one_step);
  }
  if (has_one_step) {
    Print(
        "one-step error: how far the nominal model, started at a row, ends from the next one\n"
        "error/change: that error over the change from row to row; 1 is no better than to say that nothing moves\n");
  }
}

void PrintFindings(const Dataset& dataset, const DataCheck& check, Severity severity, const char* title) {
  if (CountOf(check.findings, severity) == 0) return;
  Print("\n{}\n", title);
  for (const Finding& f : check.findings) {
    if (f.severity != severity) continue;
    Print("  {}\n", f.check);
    PrintWrapped("found", f.what);
    const std::string where = Where(dataset, f);
    if (!where.empty()) PrintWrapped("where", where);
    PrintWrapped("means", f.meaning);
    if (!f.remedy.starts_with("none needed") || f.remedy.size() > 12) PrintWrapped("do", f.remedy);
  }
}

std::string Plural(int n, const char* thing) { return fmt::format("{} {}{}", n, thing, n == 1 ? "" : "s"); }

/// A small gap of rows may add up to a large one over many.
std::string GapInWords(GapVerdict verdict) {
  if (verdict == GapVerdict::kNone) return "none seen in single rows";
  return verdict == GapVerdict::kSmall ? "small in single rows" : ToString(verdict);
}

}  // namespace

void PrintDataInfo(const Dataset& dataset, const std::string& format, const SimulatorSpec* spec,
                   const DatasetSummary& s) {
  PrintHead(dataset, spec);
  Print("{:<14}{}\n", "format", format);
  Print("{:<14}{} in {}\n", "transitions", s.n_transitions, Plural(s.n_episodes, "episode"));
  Print("{:<14}{} to {} steps, median {:g}\n", "episodes", s.shortest, s.longest, s.median_length);
  Print("{:<14}{} terminal, {} cut by a timeout\n", "ends", s.n_terminals, s.n_timeouts);
  Print("{:<14}rewards {}, qpos and qvel {}\n", "optional", s.returns.empty() ? "no" : "yes",
        s.nq > 0 ? fmt::format("yes ({} and {} numbers)", s.nq, s.nv) : "no");
  if (!s.returns.empty()) PrintReturns(spec, s.returns);
  PrintChannels("observation", s.observations);
  PrintChannels("action", s.actions);
}

void PrintDataCheck(const Dataset& dataset, const SimulatorSpec* spec, const DataCheck& check) {
  PrintHead(dataset, spec);
  Print("{:<14}{} in {}\n", "transitions", dataset.size(),
        Plural(static_cast<int>(dataset.Episodes().size()), "episode"));
  PrintPerChannel(spec, check);
  PrintFindings(dataset, check, Severity::kError, "errors");
  PrintFindings(dataset, check, Severity::kWarning, "warnings");
  PrintFindings(dataset, check, Severity::kNote, "notes");
  if (check.gap) {
    Print("\n{:<14}{}: area under the curve {:.3f} (0.5: logs and simulator cannot be told apart), {} transitions\n",
          "gap", GapInWords(check.Verdict()), check.gap->auc, dataset.size());
  } else if (spec == nullptr) {
    Print("\nwith --task, the check also compares the logs with the simulator\n");
  }
  Print("\n{}, {}, {}\n", Plural(CountOf(check.findings, Severity::kError), "error"),
        Plural(CountOf(check.findings, Severity::kWarning), "warning"),
        Plural(CountOf(check.findings, Severity::kNote), "note"));
}

}  // namespace oted::cli
