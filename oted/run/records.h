#pragma once
/// What the stages of a run leave, as types: one struct for each kind of record, with one codec (docs/file_formats.md).
/// Here those of the clone and of single designs; design_record.h and policy_records.h have the others.
/// FromJson reads what ToJson wrote: it takes the file's name for errors, and throws DataError naming file and field.
/// Numbers that are not finite are null in a file, and NaN again when read.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "oted/matching/designer.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/held_out_prediction.h"
#include "oted/stages/clone/clone.h"
#include "oted/stages/design/method_choice.h"

namespace oted {

/// clone.json
struct CloneRecord {
  static constexpr const char* kSchema = "oted.clone/1";
  CloneMethod method = CloneMethod::kBehavioralCloning;
  double train_loss = 0, held_out_loss = 0;  ///< as CloneResult's
  int n_steps = 0;
  std::optional<CloneChoice> choice;

  static CloneRecord Of(const CloneResult& clone);
  nlohmann::json ToJson() const;
  static CloneRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// q.json: one design.
struct QRecord {
  static constexpr const char* kSchema = "oted.q/1";
  Designer q;
  double lambda = 0;                        ///< of Eq. 3
  std::optional<double> learning_progress;  ///< none of a trial
  std::optional<FitEvidence> fit;           ///< only of methods that replay windows

  nlohmann::json ToJson() const;
  static QRecord FromJson(const nlohmann::json& record, const ParameterSpace& space, const std::string& where);
};

/// prediction.json: how a design predicts logs that were kept aside.
struct PredictionRecord {
  static constexpr const char* kSchema = "oted.prediction/1";
  std::optional<HeldOutPrediction> prediction;  ///< none where nothing can be predicted

  nlohmann::json ToJson() const;
  static PredictionRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// choice.json: why a setting's method was taken.
struct MethodChoiceRecord {
  static constexpr const char* kSchema = "oted.method_choice/1";
  MethodChoice choice;

  nlohmann::json ToJson() const;
  static MethodChoiceRecord FromJson(const nlohmann::json& record, const std::string& where);
};

}  // namespace oted
