#include "oted/run/records.h"

#include <nlohmann/json.hpp>

#include "oted/run/record_reader.h"

namespace oted {

using nlohmann::json;

namespace {

json EvidenceToJson(const MethodEvidence& evidence) {
  json object = {{"held_out_loss", evidence.held_out_loss}, {"closeness", nullptr}};
  if (evidence.closeness) object["closeness"] = *evidence.closeness;
  return object;
}

MethodEvidence EvidenceFrom(const RecordReader& reader) {
  return {reader.Number("held_out_loss"), reader.Find<double>("closeness")};
}

}  // namespace

// ---------------------------------------------------------------- clone.json

CloneRecord CloneRecord::Of(const CloneResult& clone) {
  return {clone.method, clone.train_loss, clone.held_out_loss, clone.n_steps, clone.choice};
}

json CloneRecord::ToJson() const {
  json record = {{"schema", kSchema},
                 {"method", NameOf(CloneMethodNames(), method)},
                 {"train_loss", train_loss},
                 {"held_out_loss", held_out_loss},
                 {"n_steps", n_steps}};
  if (choice) {
    record["choice"] = {{"n_held_out", choice->n_held_out},
                        {"bc", EvidenceToJson(choice->bc)},
                        {"valuedice", EvidenceToJson(choice->valuedice)},
                        {"reason", choice->reason}};
  }
  return record;
}

CloneRecord CloneRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  CloneRecord clone{.method = reader.GetNamed<CloneMethod>("method", CloneMethodNames()),
                    .train_loss = reader.Number("train_loss"),
                    .held_out_loss = reader.Number("held_out_loss"),
                    .n_steps = reader.Get<int>("n_steps"),
                    .choice = {}};
  if (reader.Has("choice")) {
    const RecordReader choice = reader.At("choice");
    clone.choice = {EvidenceFrom(choice.At("bc")), EvidenceFrom(choice.At("valuedice")), choice.Get<int>("n_held_out"),
                    choice.Get<std::string>("reason")};
  }
  return clone;
}

// ---------------------------------------------------------------- q.json and choice.json

json QRecord::ToJson() const {
  json record = q.ToJson(lambda);
  if (learning_progress) record["learning_progress"] = *learning_progress;
  if (fit) record["fit"] = ::oted::ToJson(*fit);
  return record;
}

QRecord QRecord::FromJson(const json& record, const ParameterSpace& space, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  QRecord read{.q = Designer::FromJson(record, space, where),
               .lambda = reader.Get<double>("lambda"),
               .learning_progress = reader.Find<double>("learning_progress"),
               .fit = {}};
  if (reader.Has("fit")) read.fit = reader.Read("fit", FitEvidenceFromJson);
  return read;
}

json PredictionRecord::ToJson() const {
  json record = {{"schema", kSchema}};
  if (prediction) record["prediction"] = ::oted::ToJson(*prediction);
  return record;
}

PredictionRecord PredictionRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  if (!reader.Has("prediction")) return {};
  return {reader.Read("prediction", HeldOutPredictionFromJson)};
}

json MethodChoiceRecord::ToJson() const {
  json record = ::oted::ToJson(choice);
  record["schema"] = kSchema;
  return record;
}

MethodChoiceRecord MethodChoiceRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  try {
    return {MethodChoiceFromJson(record)};
  } catch (const json::exception& e) {
    reader.Fail("choice", e.what());
  } catch (const UsageError& e) {
    reader.Fail("choice", e.what());
  }
}

}  // namespace oted
