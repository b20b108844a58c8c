#pragma once
/// What the simulator may have wrong beside the parameters that are searched: a first look, and what their values rest
/// on. Not in the paper.

#include <vector>

#include "oted/matching/designer.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/prior.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// `prior`, and behind it one of a further parameter, as wide as the uniform one. @param mean  in its search coordinate
Prior WithOneMore(const Prior& prior, double mean);

/// Whether a score favours it, by two standard deviations.
bool IsDirected(const Suspect& scored);

/// Whether the logs exclude that it is off by `off`: that is less likely than its nominal value, by as much as an end
/// of a 90 % interval is. @param change, std  what they make of it, from the nominal value on
bool IsExcluded(double off, double change, double std);

/// Whether z is far enough from nominal to matter: a multiple by a tenth, that of a length by a fiftieth, a value by a
/// fiftieth of its range. Of strengths and frictions a few per cent are as often the trace of something else.
bool IsNoticeable(const ParameterSpec& spec, double z);

/// A score test of each of `specs` in turn: one Newton step on it and on x together, from what the windows' derivatives
/// say (as LevelFit::Finish). Those that no window depends on are left out, such as a contact's stiffness where nothing
/// touches. Told by a linear model from the nominal value: what is far from it is rough.
/// @param fit    after FinalCost
/// @param wider  of a simulator that has `specs` behind the parameters of x
/// @param prior  of x
/// @return with the value that the step leads to, and the nats that it explains
std::vector<Suspect> ScoreSuspects(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider,
                                   const Prior& prior);

/// The first n of which no two share their first path: a mass, and that mass with the inertia, act nearly alike; the
/// inertia by itself does not.
std::vector<Suspect> FirstApart(const std::vector<Suspect>& suspects, size_t n);

struct RestsOn {
  std::vector<Condition> conditions;
  std::vector<Suspect> asked;  ///< the surest first, none of them tried
  bool is_sure = false;        ///< the logs ask for one of `specs` by five standard deviations, be it ever so little
};

/// What the parameters' values rest on. Each of `specs` is taken alone, a tenth off (of its value, or of its range
/// where it is no multiple), and x follows as the logs ask it to. Told are those that the logs do not exclude to be
/// that far off, and that move a parameter by a small change (SmallChange) or more. A tenth of that is enough where the
/// logs do not tell the two apart at all, whatever either is, or where it leads out of the parameter's interval. Of
/// each parameter the three that move it most.
///
/// Asked are those that the logs show to be off noticeably and by three standard deviations, and that explain at least
/// half as many nats as the surest: their effects resemble each other.
/// @param q  with the intervals; the rest as ScoreSuspects
RestsOn FindConditions(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider,
                       const Prior& prior, const Designer& q);

}  // namespace oted
