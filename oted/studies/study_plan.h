#pragma once
/// The paper's studies as units that need nothing of each other: seeds of cells, with what they begin from.

#include "oted/plan/plan.h"
#include "oted/studies/density_study.h"
#include "oted/studies/design_study.h"
#include "oted/studies/table1_study.h"

namespace oted {

/// A unit is one seed of a cell. BC+DR begins from what another cell collects: these are one unit.
/// @throws UsageError, DataError as RunTable1 before it begins
Plan PlanTable1(const Table1Study& study, const UnitNeeds& needs);
/// A unit is a cell. @param name  "table2" or "figure2"
Plan PlanDesignStudy(const std::string& name, const DesignStudy& study, const UnitNeeds& needs);
/// A unit is one seed of a cell.
Plan PlanDensityStudy(const DensityStudy& study, const UnitNeeds& needs);

}  // namespace oted
