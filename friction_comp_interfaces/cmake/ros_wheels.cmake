# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0

# Makes the ROS 2 packages of the Python wheels usable from CMake: the wheels set no environment, and
# some of their exported targets name include folders of the machine on which they were built.

find_package(Python3 REQUIRED COMPONENTS Interpreter)
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import ament_package, pathlib; print(pathlib.Path(ament_package.__file__).parents[4])"
  OUTPUT_VARIABLE wheels_prefix
  OUTPUT_STRIP_TRAILING_WHITESPACE
  RESULT_VARIABLE wheels_missing
)
if(wheels_missing)
  message(FATAL_ERROR
    "No ROS 2 is sourced and ${Python3_EXECUTABLE} has no ament_package: source a ROS 2 "
    "installation, or install requirements/build.txt")
endif()
list(PREPEND CMAKE_PREFIX_PATH "${wheels_prefix}")
set(ENV{AMENT_PREFIX_PATH} "${wheels_prefix}")

# Drops the include folders under /opt/python/ from every imported target of this folder: they hold
# the interpreter of the machine that built the wheels, and CMake refuses folders that do not exist.
function(drop_foreign_include_folders)
  get_directory_property(targets IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(folders)
      list(FILTER folders EXCLUDE REGEX "^/opt/python/")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${folders}")
    endif()
  endforeach()
endfunction()

# At the end of the folder, because the code generators import targets while they run.
cmake_language(DEFER CALL drop_foreign_include_folders)
