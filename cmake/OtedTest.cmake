# A test file is one program; its name is its path: oted/base/rng_test.cc -> base_rng_test.
if(OTED_BUILD_TESTS)
  enable_testing()
  find_package(GTest REQUIRED)
endif()

function(oted_test source)
  file(RELATIVE_PATH name ${CMAKE_SOURCE_DIR} ${source})
  string(REGEX REPLACE "^oted/|\\.cc$" "" name ${name})
  string(REPLACE "/" "_" name ${name})
  add_executable(${name} ${source})
  target_link_libraries(${name} PRIVATE ${ARGN} GTest::gmock GTest::gtest GTest::gtest_main oted_warnings)
  target_compile_definitions(${name} PRIVATE OTED_TEST_PYTHON="${OTED_VENV}/bin/python" OTED_TEST_ASSETS="${OTED_ASSETS}"
                             OTED_TEST_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
  set_target_properties(${name} PROPERTIES ENABLE_EXPORTS ON RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  add_test(NAME ${name} COMMAND ${name})
endfunction()
