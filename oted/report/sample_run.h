#pragma once
/// A made-up run directory with known numbers. Include from *_test.cc files only.

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/data/dataset_files.h"
#include "oted/report/curves.h"

namespace oted {

/// Writes the results of single stages into `run_dir`; the numbers are smooth and depend on nothing but the arguments.
class SampleRun {
 public:
  explicit SampleRun(std::filesystem::path run_dir) : dir_(std::move(run_dir)) {}
  const std::filesystem::path& dir() const { return dir_; }

  std::vector<std::string> names = {"friction", "gain", "gravity"};
  std::vector<double> truth = {0.6, 1.3, 1.2};
  std::vector<double> found = {0.67, 1.297, 1.21};
  std::vector<double> spread = {0.081, 0.012, 0.034};
  std::vector<std::string> verdicts = {"weak", "identified", "identified"};

  void WriteRecord() const {
    WriteFileAtomically(dir_ / "run.toml",
                        SealedText("[task]\nname = \"Hopper-v5\"\n\n[run]\nseed = 1\nthreads = 2\n", ""));
    WriteJson(dir_ / "versions.json", {{"oted", "0.1.0"},
                                       {"mujoco", "4.0.0"},
                                       {"cpu", "x86_64, 2 threads"},
                                       {"command", "oted run hopper.toml --out runs/hopper"},
                                       {"started", "2026-01-02T03:04:05Z"}});
  }

  void WriteDataset() const {
    WriteJson(dir_ / "dataset.json", {{"schema", "oted.dataset/1"},
                                      {"path", "demos.hdf5"},
                                      {"sha256", std::string(64, 'a')},
                                      {"n_transitions", 1749},
                                      {"n_episodes", 5},
                                      {"episode_returns", {812.5, 1043.25, 640.0, 1190.5, 977.0}},
                                      {"obs_dim", 11},
                                      {"act_dim", 3}});
  }

  void WriteClone() const {
    WriteJson(dir_ / "clone" / "clone.json",
              {{"schema", "oted.clone/1"}, {"held_out_loss", -1.125}, {"train_loss", -1.5}, {"n_steps", 4000}});
    CurvesWriter curves(dir_ / "clone" / "curves.csv");
    for (int step = 0; step <= 4000; step += 100) {
      const double t = step / 4000.0;
      curves.Append(step, "clone/train_loss", 3 * std::exp(-4 * t) - 1.55);
      curves.Append(step, "clone/held_out_loss", 3 * std::exp(-4 * t) - 1.5 + 0.4 * t * t);
    }
  }

  /// Three seeds of setting "paper", without a selection.
  void WriteDesignSeeds() const {
    for (int seed = 1; seed <= 3; ++seed) {
      const auto folder = dir_ / "design" / "paper" / std::to_string(seed);
      WriteJson(folder / "q.json", {{"schema", "oted.q/1"}, {"kind", "gaussian"}, {"mean", found}});
      CurvesWriter curves(folder / "curves.csv");
      for (int step = 0; step < 60; ++step) WriteDesignStep(seed, step, &curves);
    }
  }

  void WriteDesign() const {
    nlohmann::json parameters = nlohmann::json::array();
    for (size_t i = 0; i < names.size(); ++i) {
      parameters.push_back({{"name", names[i]},
                            {"field", "geom/*/friction[0]"},
                            {"unit", "x nominal"},
                            {"nominal", 1},
                            {"bounds", {0.2, 2.0}},
                            {"mode", found[i]},
                            {"std", spread[i]},
                            {"interval90", {found[i] - 1.645 * spread[i], found[i] + 1.645 * spread[i]}},
                            {"verdict", verdicts[i]}});
    }
    const auto seeds = [](double c, double common) {
      nlohmann::json list = nlohmann::json::array();
      for (int seed = 1; seed <= 3; ++seed) {
        const double d = 0.004 * (seed - 1);
        list.push_back({{"seed", seed}, {"c", c - d}, {"common", common - 2 * d}, {"learning_progress", 0.31}});
      }
      return list;
    };
    WriteJson(dir_ / "design.json",
              {{"schema", "oted.design/1"},
               {"parameters", parameters},
               {"correlation", {{1.0, -0.12, 0.41}, {-0.12, 1.0, 0.63}, {0.41, 0.63, 1.0}}},
               {"selected", "paper"},
               {"mixture",
                {{{"seed", 1}, {"mode", found}},
                 {{"seed", 2}, {"mode", {0.62, 1.3, 1.19}}},
                 {{"seed", 3}, {"mode", {0.71, 1.29, 1.23}}}}},
               {"settings",
                {{{"name", "paper"},
                  {"method", "clone, (s, a)"},
                  {"c", 0.676},
                  {"common", 0.665},
                  {"design_deviation", 0.021},
                  {"learning_progress", 0.31},
                  {"seeds", seeds(0.68, 0.673)}},
                 {{"name", "long"},
                  {"method", "clone, (s, a)"},
                  {"c", 0.69},
                  {"common", 0.57},
                  {"design_deviation", 0.113},
                  {"learning_progress", 0.12},
                  {"seeds", seeds(0.692, 0.578)}}}},
               {"nominal_common", 0.412},
               {"log2", std::log(2.0)},
               {"verdict", "gap_closed"},
               {"sentence", "gap closed: over 0.5 s the designed simulator predicts the logs"},
               {"model", {{"task", "Hopper-v5"}, {"sha256", std::string(64, 'b')}}},
               {"warnings", {"parameter 'friction' has little measured effect over the logged episodes"}}});
  }

  void WriteAgents() const {
    for (const auto& [group, gain] : {std::pair("agents", 1900.0), std::pair("nominal", 1100.0)}) {
      for (int agent = 1; agent <= 3; ++agent) {
        const auto folder = dir_ / group / std::to_string(agent);
        WriteJson(folder / "agent.json", {{"schema", "oted.agent/1"},
                                          {"agent", agent},
                                          {"seed", 100 + agent},
                                          {"n_steps", 30000},
                                          {"eval_return", gain - 40 * agent}});
        CurvesWriter curves(folder / "curves.csv");
        for (int step = 1000; step <= 30000; step += 1000) {
          const double t = step / 30000.0;
          curves.Append(step, "eval/mean_reward", gain * (1 - std::exp(-3 * t)) + 60 * std::sin(9 * t + agent));
        }
      }
    }
    WriteJson(dir_ / "policy_selection.json",
              {{"schema", "oted.policy_selection/1"},
               {"simulators", {{{"seed", 1}, {"mode", found}}, {{"seed", 2}}, {{"seed", 3}}}},
               {"agents",
                {{{"agent", 1}, {"returns", {1810.0, 1722.0, 1655.0}}, {"mean_return", 1729.0}},
                 {{"agent", 2}, {"returns", {1902.0, 1877.0, 1790.0}}, {"mean_return", 1856.3}},
                 {{"agent", 3}, {"returns", {1204.0, 1390.0, 1011.0}}, {"mean_return", 1201.7}}}},
               {"selected", 2}});
  }

  void WriteEvaluation() const {
    nlohmann::json parameters = nlohmann::json::array();
    for (size_t i = 0; i < names.size(); ++i) {
      parameters.push_back({{"name", names[i]},
                            {"unit", "x nominal"},
                            {"nominal", 1},
                            {"truth", truth[i]},
                            {"mode", found[i]},
                            {"std", spread[i]},
                            {"absolute_error", std::abs(found[i] - truth[i])}});
    }
    const auto policy = [](const char* name, const char* label, double mean, double std, nlohmann::json score) {
      return nlohmann::json{
          {"name", name}, {"label", label}, {"mean_return", mean}, {"std_return", std}, {"score", score}};
    };
    WriteJson(dir_ / "evaluation.json", {{"schema", "oted.evaluation/1"},
                                         {"task", "Hopper-v5"},
                                         {"episodes", 20},
                                         {"parameters", parameters},
                                         {"policies",
                                          {policy("random", "random", 18.2, 9.1, 0.0),
                                           policy("clone", "clone of the logged behaviour", 904.1, 212.0, 28.4),
                                           policy("sac_nominal", "SAC, nominal simulator", 612.8, 180.4, 19.4),
                                           policy("oted_sac", "OTED-SAC", 1731.5, 93.2, 53.8)}}});
  }

  /// Two channels over three steps, and pictures that are no pictures.
  void WriteMotion() const {
    const auto growth = [](double end) {
      return nlohmann::json{{"median", {0, end / 2, end}}, {"low", {0, 0, end / 2}}, {"high", {0, end, nullptr}}};
    };
    const auto channel = [](const char* name, double slope) {
      return nlohmann::json{{"name", name},
                            {"logged", {0, slope, 2 * slope}},
                            {"nominal", {0, 2 * slope, 4 * slope}},
                            {"designed", {0, slope, nullptr}}};
    };
    WriteJson(dir_ / "motion" / "replay.json", {{"schema", "oted.replay/1"},
                                                {"n_steps", 2},
                                                {"n_windows", 32},
                                                {"control_period_s", 0.008},
                                                {"window", {{"row", 24}, {"episode", 1}, {"step", 24}}},
                                                {"error", {{"nominal", growth(2.5)}, {"designed", growth(0.25)}}},
                                                {"channels", {channel("rootz_pos", 1), channel("foot_joint_vel", 2)}}});
    nlohmann::json panels = nlohmann::json::array();
    for (const std::string name : {"logged", "nominal", "designed"}) {
      WriteFileAtomically(dir_ / "motion" / (name + ".webp"), "frames of " + name);
      panels.push_back({{"name", name}, {"file", name + ".webp"}});
    }
    WriteJson(dir_ / "motion" / "motion.json", {{"schema", "oted.motion/1"},
                                                {"panels", panels},
                                                {"columns", 3},
                                                {"n_frames", 3},
                                                {"width", 256},
                                                {"height", 256},
                                                {"frame_period_s", 0.008}});
  }

  void WriteAll() const {
    WriteRecord();
    WriteDataset();
    WriteClone();
    WriteDesignSeeds();
    WriteDesign();
    WriteAgents();
    WriteEvaluation();
  }

 private:
  void WriteDesignStep(int seed, int step, CurvesWriter* curves) const {
    const double rest = std::exp(-step / 12.0);
    for (size_t i = 0; i < names.size(); ++i) {
      const double wobble = 0.02 * std::sin(0.35 * step + seed + static_cast<double>(i)) + 0.015 * (seed - 1);
      curves->Append(step, "design/mode/" + names[i], found[i] + (1.05 - found[i]) * rest + wobble * (1 - rest));
      curves->Append(step, "design/std/" + names[i], spread[i] + (0.4 - spread[i]) * rest);
    }
    curves->Append(step, "design/discriminator_loss", 2 * std::log(2.0) - 0.45 * rest - 0.01 * seed);
    curves->Append(step, "design/discriminator_accuracy", 0.5 + 0.35 * rest + 0.006 * seed);
    curves->Append(step, "design/reward", std::log(2.0) - 0.4 * rest);
    curves->Append(step, "design/kl", 1.8 * (1 - rest));
  }

  std::filesystem::path dir_;
};

}  // namespace oted
