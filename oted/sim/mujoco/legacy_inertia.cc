#include "oted/sim/mujoco/legacy_inertia.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "oted/base/error.h"

namespace oted {
namespace {

/// One capsule of a body.
struct Piece {
  MassAndInertia inertia;
  const double* pos;   // in the body's frame [m]
  const double* quat;  // of its axes in the body's frame
};

/// A body of one capsule has the capsule's own axes, as the compiler gives them.
void SetFromOne(mjsBody& body, const Piece& part) {
  mju_copy3(body.ipos, part.pos);
  mju_copy4(body.iquat, part.quat);
  mju_copy3(body.inertia, part.inertia.moments.data());
}

/// The parallel-axis theorem about the common centre of mass; the compiler finds the principal axes.
void SetFromMany(mjsBody& body, const std::vector<Piece>& parts) {
  mju_zero3(body.ipos);
  for (const Piece& part : parts) mju_addToScl3(body.ipos, part.pos, part.inertia.mass / body.mass);
  double sum[9] = {};
  for (const Piece& part : parts) {
    double r[9], d[3];
    mju_quat2Mat(r, part.quat);
    mju_sub3(d, part.pos, body.ipos);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        for (size_t k = 0; k < 3; ++k) {
          sum[3 * i + j] += r[3 * i + static_cast<int>(k)] * part.inertia.moments[k] * r[3 * j + static_cast<int>(k)];
        }
        sum[3 * i + j] += part.inertia.mass * ((i == j ? mju_dot3(d, d) : 0) - d[i] * d[j]);
      }
    }
  }
  const double full[6] = {sum[0], sum[4], sum[8], sum[1], sum[2], sum[5]};  // xx yy zz xy xz yz
  mju_copy(body.fullinertia, full, 6);
}

std::string NameOf(const mjModel& model, mjtObj type, int id) {
  const char* name = mj_id2name(&model, type, id);
  return name != nullptr ? name : fmt::format("#{}", id);
}

}  // namespace

MassAndInertia LegacyCapsule(double radius, double half_length, double density) {
  const double height = 2 * half_length + radius;
  const double mass = density * std::numbers::pi * radius * radius * height;
  const double across = mass * (3 * radius * radius + height * height) / 12;
  return {mass, {across, across, mass * radius * radius / 2}};
}

void UseLegacyCapsules(mjSpec& spec, const mjModel& nominal, const std::string& name) {
  std::map<int, std::vector<Piece>> parts;  // by body
  std::map<int, int> others;                // a geom that has mass and is no capsule, by body
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_GEOM); e != nullptr; e = mjs_nextElement(&spec, e)) {
    const mjsGeom& geom = *mjs_asGeom(e);
    const int id = mjs_getId(e), body = nominal.geom_bodyid[id];
    const bool weightless = geom.mass == 0 || (std::isnan(geom.mass) && geom.density == 0);
    if (body == 0 || weightless) continue;
    if (nominal.geom_type[id] != mjGEOM_CAPSULE || geom.typeinertia != mjINERTIA_VOLUME) {
      others.emplace(body, id);
      continue;
    }
    const double* size = nominal.geom_size + 3 * id;
    double density = geom.density;
    if (!std::isnan(geom.mass)) density = geom.mass / LegacyCapsule(size[0], size[1], 1).mass;
    parts[body].push_back(
        {LegacyCapsule(size[0], size[1], density), nominal.geom_pos + 3 * id, nominal.geom_quat + 4 * id});
  }
  const bool explicit_inertials_count = spec.compiler.inertiafromgeom != mjINERTIAFROMGEOM_TRUE;
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_BODY); e != nullptr; e = mjs_nextElement(&spec, e)) {
    mjsBody& body = *mjs_asBody(e);
    const auto found = parts.find(mjs_getId(e));
    if (found == parts.end() || (body.explicitinertial && explicit_inertials_count)) continue;
    if (const auto other = others.find(found->first); other != others.end()) {
      throw DataError(fmt::format(
          "'{}': body '{}' has geom '{}' beside its capsules; legacy capsules are known for bodies of solid capsules "
          "alone, so give that body its <inertial>",
          name, NameOf(nominal, mjOBJ_BODY, found->first), NameOf(nominal, mjOBJ_GEOM, other->second)));
    }
    body.explicitinertial = 1;
    body.mass = 0;
    for (const Piece& part : found->second) body.mass += part.inertia.mass;
    if (found->second.size() == 1) {
      SetFromOne(body, found->second.front());
    } else {
      SetFromMany(body, found->second);
    }
  }
  // "true" would overwrite what was set.
  spec.compiler.inertiafromgeom = mjINERTIAFROMGEOM_AUTO;
}

}  // namespace oted
