#include "oted/sim/mujoco/export_mjcf.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <string_view>

#include "oted/base/error.h"
#include "oted/sim/mujoco/joint_friction.h"
#include "oted/sim/mujoco/joint_residual.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_compare.h"
#include "oted/sim/mujoco/mujoco_setup.h"

// MuJoCo writes six digits unless it is told otherwise, and tells of no public way to do so.
extern "C" void _mjPRIVATE__set_xml_precision(int precision);

namespace oted {
namespace {

namespace fs = std::filesystem;

constexpr double kWholeSteps = 1e-6;  // of a physics step: rounding

// A step that MuJoCo refused, and why.
struct Refused {
  std::string reason;
};

ModelPtr Compile(mjSpec& spec) {
  ModelPtr model(mj_compile(&spec, nullptr));
  if (model == nullptr) throw Refused{mjs_getError(&spec)};
  return model;
}

// Masses and inertias as in `model`, and nothing at compilation that would change them.
void FixInertias(mjSpec& spec, const mjModel& model) {
  mjsCompiler& compiler = spec.compiler;
  compiler.inertiafromgeom = mjINERTIAFROMGEOM_AUTO;
  compiler.settotalmass = -1;
  compiler.boundmass = compiler.boundinertia = 0;
  compiler.balanceinertia = 0;
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_BODY); e != nullptr; e = mjs_nextElement(&spec, e)) {
    const int id = mjs_getId(e);
    if (id <= 0) continue;
    mjsBody& body = *mjs_asBody(e);
    body.explicitinertial = 1;
    body.mass = model.body_mass[id];
    std::copy_n(model.body_ipos + 3 * id, 3, body.ipos);
    std::copy_n(model.body_iquat + 4 * id, 4, body.iquat);
    std::copy_n(model.body_inertia + 3 * id, 3, body.inertia);
    body.fullinertia[0] = std::numeric_limits<double>::quiet_NaN();  // undefined
    body.ialt.type = mjORIENTATION_QUAT;
  }
}

// Relative folders of assets would be looked for beside the new file.
void MakeFoldersAbsolute(mjSpec& spec) {
  const auto has = [&](mjtObj type) { return mjs_firstElement(&spec, type) != nullptr; };
  const fs::path model_folder = mjs_getString(spec.modelfiledir);
  const auto make_absolute = [&](mjString* folder) {
    const fs::path given = model_folder / mjs_getString(folder);
    const fs::path absolute = fs::absolute(given.empty() ? "." : given).lexically_normal();
    mjs_setString(folder, absolute.c_str());
  };
  if (has(mjOBJ_MESH) || has(mjOBJ_HFIELD) || has(mjOBJ_SKIN)) make_absolute(spec.compiler.meshdir);
  bool textures = false;  // from files
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_TEXTURE); e != nullptr; e = mjs_nextElement(&spec, e)) {
    textures = textures || mjs_asTexture(e)->builtin == mjBUILTIN_NONE;
  }
  if (textures) make_absolute(spec.compiler.texturedir);
}

std::string ToText(const mjSpec& spec) {
  _mjPRIVATE__set_xml_precision(std::numeric_limits<double>::max_digits10);
  std::array<char, 1000> reason{};
  std::string text(1 << 16, '\0');
  const auto save = [&] {
    return mj_saveXMLString(&spec, text.data(), static_cast<int>(text.size()), reason.data(),
                            static_cast<int>(reason.size()));
  };
  int needed = save();
  if (needed > 0) {
    text.assign(static_cast<size_t>(needed) + 1, '\0');
    needed = save();
  }
  if (needed != 0) throw Refused{reason.data()};
  text.resize(text.find('\0'));
  return text;
}

// 0.10000000000000001 reads 0.1: of the decimal numbers that are this one double, the shortest.
std::string ShortenNumbers(std::string_view text) {
  const auto in_number = [](char c) { return (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '+' || c == 'e'; };
  const auto separates = [](char c) { return c == ' ' || c == '"'; };
  std::string out;
  out.reserve(text.size());
  for (size_t i = 0; i < text.size();) {
    size_t end = i;
    while (end < text.size() && in_number(text[end])) ++end;
    if (end == i) {
      out += text[i++];
      continue;
    }
    const std::string_view token = text.substr(i, end - i);
    double value = 0;
    const auto [rest, error] = std::from_chars(token.data(), token.data() + token.size(), value);
    const bool whole = error == std::errc{} && rest == token.data() + token.size();
    // Shorter ones are short already, and may be names.
    const bool is_long = token.size() >= 16 && token.find('.') != std::string_view::npos;
    const bool alone = i > 0 && separates(text[i - 1]) && end < text.size() && separates(text[end]);
    out += whole && is_long && alone ? fmt::format("{}", value) : std::string(token);
    i = end;
  }
  return out;
}

// Two hyphens end a comment.
std::string AsComment(const std::string& text) {
  std::string out = "<!--\n";
  for (const char c : text) {
    if (c == '-' && out.back() == '-') out += ' ';
    out += c;
  }
  return out + "\n-->\n";
}

SpecPtr ParseText(const std::string& text) {
  std::array<char, 1000> reason{};
  SpecPtr spec(mj_parseXMLString(text.c_str(), nullptr, reason.data(), static_cast<int>(reason.size())));
  if (spec == nullptr) throw Refused{reason.data()};
  return spec;
}

ModelPtr CompileText(const std::string& text) { return Compile(*ParseText(text)); }

// MuJoCo 4.0 takes any delay below one time step for a whole one; beyond, it interpolates.
double WhatMujocoDelays(double delay_s, double step) {
  return delay_s < step ? step * std::round(delay_s / step) : delay_s;
}

// The same model with actuators that act later (nactuator) [s]; `model` gets their delays, too.
std::string WithDelays(const std::string& text, std::span<const double> delays_s, mjModel& model) {
  const SpecPtr spec = ParseText(text);
  const double step = model.opt.timestep;
  for (mjsElement* e = mjs_firstElement(spec.get(), mjOBJ_ACTUATOR); e != nullptr; e = mjs_nextElement(spec.get(), e)) {
    mjsActuator& actuator = *mjs_asActuator(e);
    const double later = delays_s[static_cast<size_t>(mjs_getId(e))];
    const double delay = WhatMujocoDelays(actuator.delay + later, step), n_steps = delay / step;
    if (delay == actuator.delay) continue;
    actuator.delay = delay;
    const bool is_whole = std::abs(n_steps - std::round(n_steps)) < kWholeSteps;
    if (!is_whole && actuator.interp == 0) actuator.interp = 1;
    actuator.nsample = std::max(actuator.nsample, static_cast<int>(std::ceil(n_steps - kWholeSteps)) + 2);
    model.actuator_delay[mjs_getId(e)] = actuator.delay;
  }
  Compile(*spec);  // only then does MuJoCo write it
  return ShortenNumbers(ToText(*spec));
}

// Bodies that a parameter moved the frame of inertia of (LetInertiaMove).
std::set<int> NoLongerSimple(const mjModel& compiled, const mjModel& pristine) {
  std::set<int> bodies;
  for (int body = 0; body < compiled.nbody; ++body) {
    if (compiled.body_simple[body] != 0 && pristine.body_simple[body] == 0) bodies.insert(body);
  }
  return bodies;
}

// `designed` written on top of what the pristine model was compiled from.
std::string Write(const mjSpec& original, const mjModel& pristine, mjModel& designed, bool fix_inertias) {
  const SpecPtr spec(mj_copySpec(&original));
  OTED_CHECK(spec != nullptr);
  ModelPtr base = Compile(*spec);
  const std::set<int> general = NoLongerSimple(*base, pristine);
  if (!general.empty()) {
    AllowSimple(*spec, general, false);
    base = Compile(*spec);
  }
  if (fix_inertias) {
    FixInertias(*spec, pristine);
    base = Compile(*spec);
  }
  // The simulator's own switches.
  designed.opt.disableflags = base->opt.disableflags;
  if (mj_copyBack(spec.get(), &designed) != 1) throw Refused{mjs_getError(spec.get())};
  MakeFoldersAbsolute(*spec);
  if (!general.empty()) {  // moved, they are not, and versions before 4.0 do not know the attribute
    AllowSimple(*spec, general, true);
    Compile(*spec);  // only then does MuJoCo write it
  }
  return ShortenNumbers(ToText(*spec));
}

}  // namespace

std::string DesignedMjcf(const MujocoSimulatorFactory& factory, std::span<const double> z, const std::string& comment,
                         std::span<const double> actuator_delays_s) {
  ModelPtr designed(mj_copyModel(nullptr, &factory.model()));
  OTED_CHECK(designed != nullptr);
  const auto simulator = factory.MakeMujoco(1, 1);
  simulator->SetParameters(0, z);
  simulator->CopyModel(0, *designed);
  const bool any_late = std::ranges::any_of(actuator_delays_s, [](double delay) { return delay > 0; });
  std::string problem;
  for (const bool fix_inertias : {false, true}) {
    try {
      std::string text = Write(factory.model_spec(), factory.model(), *designed, fix_inertias);
      if (any_late) text = WithDelays(text, actuator_delays_s, *designed);
      problem = FirstDifference(*CompileText(text), *designed);
      if (problem.empty()) return AsComment(comment) + text;
    } catch (const Refused& refused) {
      problem = refused.reason;
    }
  }
  throw DataError(fmt::format(
      "MuJoCo {} cannot write the designed values of '{}' into an MJCF file that gives them back: {}; write "
      "the parameters with --sysid or --q instead",
      mj_versionString(), factory.model_path(), problem));
}

std::optional<std::vector<std::string>> MujocoSimulatorFactory::NotInMjcf() const {
  std::vector<std::string> names;
  for (const ParameterSpec& parameter : parameters().specs()) {
    if (IsFrictionPath(parameter.field) || IsResidualPath(parameter.field)) names.push_back(parameter.name);
  }
  return names;
}

bool MujocoSimulatorFactory::mjcf_delays_actions() const {
  return std::all_of(model().actuator_biastype, model().actuator_biastype + model().nu,
                     [](int bias) { return bias == mjBIAS_NONE; });
}

std::string MujocoSimulatorFactory::Mjcf(std::span<const double> z, const std::string& comment,
                                         std::span<const double> action_delays_s) const {
  // An actuator of several controls has one delay in MJCF: that of its first.
  std::vector<double> delays(action_delays_s.empty() ? 0 : static_cast<size_t>(model().nactuator), 0.0);
  for (size_t actuator = 0; actuator < delays.size(); ++actuator) {
    const auto control = std::ranges::find(setup_->controls, model().actuator_ctrladr[actuator]);
    if (control == setup_->controls.end()) continue;
    delays[actuator] = action_delays_s[static_cast<size_t>(control - setup_->controls.begin())];
  }
  return DesignedMjcf(*this, z, comment, delays);
}

}  // namespace oted
