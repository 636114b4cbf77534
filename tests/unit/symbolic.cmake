# SPDX-License-Identifier: Apache-2.0
# The symbolic generator: its equations interpreted, its code compiled, what it costs.
set(unit ${CMAKE_CURRENT_SOURCE_DIR}/unit)
set(bench ${CMAKE_CURRENT_SOURCE_DIR}/bench)

add_library(symbolic_evaluate STATIC ${unit}/symbolic_evaluate.c)
target_link_libraries(symbolic_evaluate PUBLIC symbolic random_robot)

hil_test(symbolic SOURCES ${unit}/symbolic.c LIBS symbolic_evaluate LABELS unit)
hil_test(symbolic_generate
         SOURCES ${unit}/symbolic_generate.c ${CMAKE_SOURCE_DIR}/rt/cmd_generate.c
         LIBS symbolic rt LABELS unit)
hil_test(symbolic_memory SOURCES ${unit}/symbolic_memory.c LIBS symbolic_evaluate LABELS unit)
target_link_options(test_symbolic_memory PRIVATE
                    -Wl,--wrap=calloc -Wl,--wrap=realloc -Wl,--wrap=free)
hil_test(symbolic_module SOURCES ${unit}/symbolic_module.c
         LIBS symbolic_evaluate symbolic_builtin LABELS unit TIMEOUT 120)

add_executable(symbolic_count ${bench}/symbolic_count.c)
target_link_libraries(symbolic_count PRIVATE symbolic symbolic_builtin)
target_compile_definitions(symbolic_count PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
if(NOT HIL_SANITIZE)
    hil_script_test(symbolic_instructions
        COMMAND ${bench}/symbolic_instructions.sh $<TARGET_FILE:symbolic_count> LABELS bench)
endif()
