// oted._core.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <filesystem>
#include <system_error>

#include "cli/main.h"
#include "oted/base/error.h"
#include "python/binding.h"
#include "python/designs.h"
#include "python/gym_simulators.h"
#include "python/logs.h"
#include "python/package_folders.h"
#include "python/policies.h"
#include "python/session.h"
#include "python/simulators.h"
#include "python/study.h"

namespace oted::python {

namespace {

/// Errors become those of oted.errors, by class.
void AddErrors(nb::module_&) {
  nb::register_exception_translator([](const std::exception_ptr& error, void*) {
    const auto raise = [](const char* name, const char* message) {
      const nb::module_ errors = nb::module_::import_("oted.errors");
      PyErr_SetObject(nb::object(errors.attr(name)).ptr(), nb::object(errors.attr("_in_python")(message)).ptr());
    };
    try {
      std::rethrow_exception(error);
    } catch (const PythonInterrupt&) {
      PyErr_SetNone(PyExc_KeyboardInterrupt);
    } catch (const PythonFailure& e) {
      const nb::object kind = nb::module_::import_("oted.errors").attr("DataError"), value = kind(e.what());
      PyException_SetCause(value.ptr(), nb::object(e.cause()).release().ptr());
      PyErr_SetObject(kind.ptr(), value.ptr());
    } catch (const UsageError& e) {
      raise("UsageError", e.what());
    } catch (const DataError& e) {
      raise("DataError", e.what());
    } catch (const Interrupted& e) {
      raise("Interrupted", e.what());
    } catch (const Error& e) {
      raise("InternalError", e.what());
    } catch (const std::filesystem::filesystem_error& e) {
      raise("DataError", e.what());
    } catch (const std::system_error& e) {
      raise("DataError", e.what());
    }
  });
}

/// The program `oted`, in this process.
int Main(std::vector<std::string> words) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const nb::gil_scoped_release release;
  return cli::Main(static_cast<int>(words.size()), argv.data());
}

}  // namespace
}  // namespace oted::python

NB_MODULE(_core, m) {
  m.doc() = "oted's library. Use the package oted, not this module.";
  m.attr("version") = OTED_VERSION;
  oted::python::AddErrors(m);
  oted::python::AddStudies(m);
  oted::python::AddFiles(m);
  oted::python::AddLogs(m);
  oted::python::AddSession(m);
  oted::python::AddDesigns(m);
  oted::python::AddSimulators(m);
  oted::python::AddGymSimulators(m);
  oted::python::AddPolicies(m);
  m.def("main", &oted::python::Main, nanobind::arg("argv"));
}
