# SPDX-License-Identifier: Apache-2.0
# The robot description, the numeric dynamics and the command that shows them.
set(unit ${CMAKE_CURRENT_SOURCE_DIR}/unit)
find_package(Simbody REQUIRED CONFIG)

add_library(random_robot STATIC ${unit}/random_robot.c)
target_link_libraries(random_robot PUBLIC hil_flags model)

hil_test(robot SOURCES ${unit}/robot.c LIBS model LABELS unit)
hil_test(robot_yaml SOURCES ${unit}/robot_yaml.c LIBS model LABELS unit)
hil_test(dynamics SOURCES ${unit}/dynamics.c LIBS random_robot LABELS unit)
hil_test(dynamics_accel SOURCES ${unit}/dynamics_accel.c ${CMAKE_SOURCE_DIR}/rt/cmd_accel.c
         LIBS random_robot rt LABELS unit)

hil_test(dynamics_simbody SOURCES ${unit}/dynamics_simbody.cpp
         LIBS random_robot SimTKsimbody SimTKmath SimTKcommon LABELS unit)
target_include_directories(test_dynamics_simbody SYSTEM PRIVATE ${Simbody_INCLUDE_DIR})
target_compile_options(test_dynamics_simbody PRIVATE -UNDEBUG)
