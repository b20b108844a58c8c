# A test file is one program; its name is its path: oted/base/rng_test.cc -> base_rng_test. Labels: `long` for files named
# *_long_test.cc (left out of `make test`), `sanitize` for those that also run under the sanitizers (`make test` does both).
if(OTED_BUILD_TESTS)
  enable_testing()
  find_package(GTest REQUIRED)
  # The folders whose tests make sense under sanitizers: no libtorch in the process, and short.
  set(OTED_SANITIZE_LIBRARIES oted_base oted_data oted_sim oted_mujoco oted_minigrid oted_report)
  add_custom_target(sanitize_tests)
endif()

function(oted_test source)
  file(RELATIVE_PATH name ${CMAKE_SOURCE_DIR} ${source})
  string(REGEX REPLACE "^oted/|\\.cc$" "" name ${name})
  string(REPLACE "/" "_" name ${name})
  add_executable(${name} ${source})
  target_link_libraries(${name} PRIVATE ${ARGN} GTest::gmock GTest::gtest GTest::gtest_main oted_warnings)
  # libtorch's autograd as the reference of what oted/nn and oted/rl write by hand.
  if(name MATCHES "_torch_test$")
    target_link_libraries(${name} PRIVATE oted_torch)
  endif()
  # gtest's macros make optimising a test slow to compile, and a third of the build's time; the library keeps its own flags.
  # Under the sanitizers -O0 halves that once more; without them it saves next to nothing.
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1> $<$<CONFIG:Debug>:-O0>)
  target_compile_definitions(${name} PRIVATE OTED_TEST_PYTHON="${OTED_VENV}/bin/python" OTED_TEST_ASSETS="${OTED_ASSETS}"
                             OTED_TEST_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
  set_target_properties(${name} PROPERTIES ENABLE_EXPORTS ON RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  add_test(NAME ${name} COMMAND ${name})
  if(name MATCHES "_long_test$")
    set_property(TEST ${name} APPEND PROPERTY LABELS long)
  elseif(ARGN IN_LIST OTED_SANITIZE_LIBRARIES)
    set_property(TEST ${name} APPEND PROPERTY LABELS sanitize)
    add_dependencies(sanitize_tests ${name})
  endif()
endfunction()
