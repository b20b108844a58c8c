# Native libraries. Debian's packages come through find_package; MuJoCo and, for OTED_CUDA and the tests, libtorch
# live inside Python wheels, in the project-local environment (.venv), unless MUJOCO_DIR, TORCH_DIR say otherwise.

find_package(Threads REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(ZLIB REQUIRED)
find_package(CLI11 REQUIRED)
find_package(muparser REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(Eigen3 REQUIRED)

add_library(oted_eigen INTERFACE)
target_include_directories(oted_eigen SYSTEM INTERFACE ${EIGEN3_INCLUDE_DIRS})

if(OTED_HDF5)
  find_package(HDF5 REQUIRED COMPONENTS C)
  add_library(oted_hdf5 INTERFACE)
  target_include_directories(oted_hdf5 SYSTEM INTERFACE ${HDF5_C_INCLUDE_DIRS})
  target_link_libraries(oted_hdf5 INTERFACE ${HDF5_C_LIBRARIES})
endif()

find_path(TOMLPLUSPLUS_INCLUDE_DIR toml++/toml.h REQUIRED)
add_library(tomlplusplus INTERFACE)
target_include_directories(tomlplusplus SYSTEM INTERFACE ${TOMLPLUSPLUS_INCLUDE_DIR})

find_path(PROTOZERO_INCLUDE_DIR protozero/pbf_writer.hpp REQUIRED)
add_library(protozero INTERFACE)
target_include_directories(protozero SYSTEM INTERFACE ${PROTOZERO_INCLUDE_DIR})

# libzip's own CMake config also asks for its command-line tools.
find_path(ZIP_INCLUDE_DIR zip.h REQUIRED)
find_library(ZIP_LIBRARY zip REQUIRED)
add_library(libzip INTERFACE)
target_include_directories(libzip SYSTEM INTERFACE ${ZIP_INCLUDE_DIR})
target_link_libraries(libzip INTERFACE ${ZIP_LIBRARY})

# libwebp comes without a CMake config.
find_path(WEBP_INCLUDE_DIR webp/encode.h REQUIRED)
find_library(WEBP_LIBRARY webp REQUIRED)
add_library(webp INTERFACE)
target_include_directories(webp SYSTEM INTERFACE ${WEBP_INCLUDE_DIR})
target_link_libraries(webp INTERFACE ${WEBP_LIBRARY})

# The wheels' folder: <venv>/lib/python3.x/site-packages.
set(OTED_VENV "${CMAKE_SOURCE_DIR}/.venv" CACHE PATH "Python environment with the wheels of requirements.txt")
file(GLOB OTED_SITE_PACKAGES "${OTED_VENV}/lib/python3*/site-packages")

# --- MuJoCo: headers and libmujoco.so.<version> from the wheel; it has no CMake config and no unversioned name.
set(MUJOCO_DIR "" CACHE PATH "Folder with MuJoCo's include/ and libmujoco.so* (default: the wheel in OTED_VENV)")
if(MUJOCO_DIR)
  set(mujoco_root "${MUJOCO_DIR}")
elseif(SKBUILD)  # pip builds a wheel: the environment that it made has the wheels that pyproject.toml asks for
  find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
  execute_process(COMMAND ${Python_EXECUTABLE} -c "import importlib.util as u; print(u.find_spec('mujoco').submodule_search_locations[0])"
                  OUTPUT_VARIABLE mujoco_root OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
else()
  set(mujoco_root "${OTED_SITE_PACKAGES}/mujoco")
endif()
file(GLOB mujoco_library "${mujoco_root}/libmujoco.so.*" "${mujoco_root}/lib/libmujoco.so.*")
if(NOT mujoco_library OR NOT EXISTS "${mujoco_root}/include/mujoco/mjbatch.h")
  message(FATAL_ERROR "MuJoCo 4.0 not found in '${mujoco_root}': run 'make setup', or set MUJOCO_DIR")
endif()
list(GET mujoco_library 0 mujoco_library)
add_library(mujoco::mujoco SHARED IMPORTED)
set_target_properties(mujoco::mujoco PROPERTIES IMPORTED_LOCATION "${mujoco_library}"
                      INTERFACE_INCLUDE_DIRECTORIES "${mujoco_root}/include")

# --- libtorch: linked by hand (c10, torch_cpu, torch), as its own config asks for CUDA when the wheel is a CUDA build.
set(TORCH_DIR "" CACHE PATH "libtorch's folder, with include/ and lib/ (default: the torch wheel in OTED_VENV)")
if(TORCH_DIR)
  set(torch_root "${TORCH_DIR}")
else()
  set(torch_root "${OTED_SITE_PACKAGES}/torch")
endif()
if(EXISTS "${torch_root}/lib/libtorch_cpu.so")
  foreach(part c10 torch_cpu torch)
    add_library(torch::${part} SHARED IMPORTED)
    set_target_properties(torch::${part} PROPERTIES IMPORTED_LOCATION "${torch_root}/lib/lib${part}.so")
  endforeach()
  # Its include folder shadows Debian's fmt and protobuf: only targets that need torch itself link this one.
  add_library(oted_torch INTERFACE)
  target_include_directories(oted_torch SYSTEM INTERFACE "${torch_root}/include"
                             "${torch_root}/include/torch/csrc/api/include")
  target_link_libraries(oted_torch INTERFACE torch::torch torch::torch_cpu torch::c10)
elseif(OTED_CUDA OR OTED_BUILD_TESTS OR OTED_BUILD_BENCHMARKS)
  message(FATAL_ERROR "libtorch not found in '${torch_root}', which tests, benchmarks and OTED_CUDA need: run "
                      "'make setup' ('make build-cuda' for the program alone), or set TORCH_DIR")
endif()

# --- Model files of the three tasks, read at run time from the gymnasium wheel and never copied; OTED_ASSETS overrides.
set(OTED_ASSETS "${OTED_SITE_PACKAGES}/gymnasium/envs/mujoco/assets" CACHE PATH "Folder with hopper.xml, half_cheetah.xml, ...")
