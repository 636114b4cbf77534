# SPDX-License-Identifier: Apache-2.0
# The robot description, its dynamics and drives; the generator in symbolic/.
set(unit ${CMAKE_CURRENT_SOURCE_DIR}/unit/model)
find_package(Simbody REQUIRED CONFIG)

add_library(random_robot STATIC ${unit}/random_robot.c)
target_link_libraries(random_robot PUBLIC hil_flags model)

foreach(name coupling description/robot description/yaml description/yaml_drive
             description/yaml_hydraulic drives/actuator drives/steady integrator integrator_dopri5
             published walkman)
    string(REPLACE / _ test ${name})
    hil_test(model_${test} SOURCES ${unit}/${name}.c LIBS model LABELS unit)
endforeach()
hil_test(model_drives_actuator_step SOURCES ${unit}/drives/actuator_step.c physics/toy.c
         LIBS model LABELS unit)
hil_test(model_dynamics SOURCES ${unit}/dynamics.c LIBS random_robot LABELS unit)
hil_test(model_implicit_dynamics SOURCES ${unit}/implicit/dynamics.c
         LIBS random_robot LABELS unit)
hil_test(model_dynamics_simbody SOURCES ${unit}/dynamics_simbody.cpp
         LIBS random_robot SimTKsimbody SimTKmath SimTKcommon LABELS unit)
target_include_directories(test_model_dynamics_simbody SYSTEM PRIVATE ${Simbody_INCLUDE_DIR})
target_compile_options(test_model_dynamics_simbody PRIVATE -UNDEBUG)

add_library(symbolic_evaluate STATIC ${unit}/symbolic/evaluate.c)
target_link_libraries(symbolic_evaluate PUBLIC symbolic random_robot)
hil_test(symbolic SOURCES ${unit}/symbolic/symbolic.c LIBS symbolic_evaluate LABELS unit)
hil_test(symbolic_memory SOURCES ${unit}/symbolic/memory.c LIBS symbolic_evaluate LABELS unit)
target_link_options(test_symbolic_memory PRIVATE
                    -Wl,--wrap=calloc -Wl,--wrap=realloc -Wl,--wrap=free)
hil_test(symbolic_module SOURCES ${unit}/symbolic/module.c
         LIBS symbolic_evaluate symbolic_builtin LABELS unit TIMEOUT 600)
