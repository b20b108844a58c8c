#include "python/session.h"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "cli/verbs/export.h"
#include "cli/versions.h"
#include "oted/base/parallel.h"
#include "oted/report/file_sink.h"
#include "oted/report/report.h"
#include "oted/run/pipeline.h"
#include "python/gym_simulators.h"
#include "python/study.h"

namespace oted::python {
namespace {

constexpr auto kPatience = std::chrono::milliseconds(100);

struct Event {
  enum class Kind { kProgress, kScalar, kWarning };
  Kind kind;
  std::string where, what;  ///< stage and job; folder and key; nothing
  int64_t done = 0, total = 0;
  double value = 0;
  std::string text;
};

/// Keeps events until the calling thread takes them.
class EventQueue : public LogSink {
 public:
  explicit EventQueue(bool wanted) : wanted_(wanted) {}
  void Scalar(std::string_view run, std::string_view key, int64_t step, double value) override {
    Push({Event::Kind::kScalar, std::string(run), std::string(key), step, 0, value, ""});
  }
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    Push({Event::Kind::kProgress, std::string(stage), std::string(label), done, total, 0, std::string(note)});
  }
  void Warning(std::string_view message) override {
    Push({Event::Kind::kWarning, "", "", 0, 0, 0, std::string(message)});
  }
  std::deque<Event> Take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(events_, {});
  }

 private:
  void Push(Event event) {
    const std::lock_guard lock(mutex_);
    if (wanted_) events_.push_back(std::move(event));
  }
  const bool wanted_;
  std::mutex mutex_;
  std::deque<Event> events_;
};

/// Scalars into the run directory's files and to Python, the rest to Python.
class SessionSink : public CurvesLog {
 public:
  SessionSink(const std::string& out, EventQueue& queue) : files_(out, &queue), queue_(queue) {}
  void Scalar(std::string_view run, std::string_view key, int64_t step, double value) override {
    files_.Scalar(run, key, step, value);
    queue_.Scalar(run, key, step, value);
  }
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    queue_.Progress(stage, label, done, total, note);
  }
  void Warning(std::string_view message) override { queue_.Warning(message); }
  void Finish(std::string_view run) override { files_.Finish(run); }
  std::string CurvesMark(std::string_view run) override { return files_.CurvesMark(run); }
  void GoOn(std::string_view run, std::string_view mark) override { files_.GoOn(run, mark); }

 private:
  FileSink files_;
  EventQueue& queue_;
};

nb::dict ToDict(const Event& event) {
  nb::dict d;
  switch (event.kind) {
    case Event::Kind::kProgress:
      d["kind"] = "progress";
      d["stage"] = event.where;
      d["job"] = event.what;
      d["done"] = event.done;
      d["total"] = event.total;
      d["note"] = event.text;
      break;
    case Event::Kind::kScalar:
      d["kind"] = "scalar";
      d["run"] = event.where;
      d["key"] = event.what;
      d["step"] = event.done;
      d["value"] = event.value;
      break;
    case Event::Kind::kWarning:
      d["kind"] = "warning";
      d["message"] = event.text;
      break;
  }
  return d;
}

/// Runs `work` on another thread; holds the GIL on entry and exit. Once Python raises, in a callback or by a signal,
/// the work is asked to stop, and when it has, that error goes on.
void RunInterruptibly(const std::function<void(const std::atomic<bool>& stop)>& work, EventQueue& events,
                      const nb::object& on_event) {
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::condition_variable changed;
  bool is_done = false;
  std::exception_ptr failure;
  std::thread worker([&] {
    try {
      work(stop);
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex);
    is_done = true;
    changed.notify_one();
  });
  Sessions::Begin();
  std::exception_ptr raised;
  const auto hand_over = [&] {
    for (const Event& event : events.Take()) {
      if (!raised && !on_event.is_none()) on_event(ToDict(event));
    }
  };
  for (bool done = false; !done;) {
    {
      const nb::gil_scoped_release release;
      std::unique_lock lock(mutex);
      done = changed.wait_for(lock, kPatience, [&] { return is_done; });
    }
    try {
      if (!raised && PyErr_CheckSignals() != 0) throw nb::python_error();
      hand_over();
    } catch (...) {
      if (!raised) raised = std::current_exception();
      stop = true;
      Sessions::AskToStop();
    }
  }
  {
    const nb::gil_scoped_release release;
    worker.join();
  }
  Sessions::End();
  if (raised) std::rethrow_exception(raised);
  if (failure) std::rethrow_exception(failure);
}

using Call = void (*)(Pipeline&);

Call StageNamed(const std::string& name) {
  static const std::map<std::string, Call> kStages = {
      {"check", [](Pipeline&) {}},
      {"clone", [](Pipeline& p) { p.CloneBehavior(); }},
      {"design", [](Pipeline& p) { p.ReplayLogs(); }},
      {"train", [](Pipeline& p) { p.TrainAgents(); }},
      {"select-policy", [](Pipeline& p) { p.SelectPolicy(); }},
      {"evaluate", [](Pipeline& p) { p.EvaluateInTarget(); }},
      {"run", [](Pipeline& p) { p.Run(); }},
  };
  return kStages.at(name);
}

/// What a run is told: a study, or none for the run directory's own run.toml.
struct Request {
  std::optional<Study> study;
  std::string out;
  std::vector<std::string> assignments;
  RunConfig Config() const {
    RunConfig config =
        study ? study->Config() : RunConfig::FromTomlFile((std::filesystem::path(out) / "run.toml").string());
    for (const std::string& assignment : assignments) config.Set(assignment);
    config.task.Resolve();
    return config;
  }
};

void RunStage(const Request& request, const std::string& stage, const std::string& command,
              const nb::object& on_event) {
  const Call call = StageNamed(stage);
  CheckReportCanBeMade();
  EventQueue events(!on_event.is_none());
  RunInterruptibly(
      [&](const std::atomic<bool>& stop) {
        const std::string started = cli::Now();
        const RunConfig config = request.Config();
        SessionSink sink(request.out, events);
        RunContext context;
        context.log = &sink;
        context.stop = &stop;
        context.n_threads = config.Threads();
        Pipeline pipeline(config, request.out, context);  // holds the run directory's lock
        cli::WriteVersions(request.out, command, started);
        call(pipeline);
        cli::WriteExports(request.out);
        if (std::filesystem::exists(std::filesystem::path(request.out) / "design.json")) WriteReport(request.out);
      },
      events, on_event);
}

}  // namespace

void AddSession(nb::module_& m) {
  m.def(
      "run_stage",
      [](const std::optional<Study>& study, const std::string& out, const std::vector<std::string>& assignments,
         const std::string& stage, const std::string& command, const nb::object& on_event) {
        RunStage({study, out, assignments}, stage, command, on_event);
      },
      nb::arg("study").none(), nb::arg("out"), nb::arg("assignments"), nb::arg("stage"), nb::arg("command"),
      nb::arg("on_event").none());
}

}  // namespace oted::python
