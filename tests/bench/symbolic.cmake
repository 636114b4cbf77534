# SPDX-License-Identifier: Apache-2.0
# What the generator's code costs, in instructions.
set(bench ${CMAKE_CURRENT_SOURCE_DIR}/bench)
add_executable(symbolic_count ${bench}/symbolic_count.c)
target_link_libraries(symbolic_count PRIVATE symbolic symbolic_builtin)
target_compile_definitions(symbolic_count PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
if(NOT HIL_SANITIZE)
    hil_script_test(symbolic_instructions
        COMMAND ${bench}/symbolic_instructions.sh $<TARGET_FILE:symbolic_count> LABELS bench)
endif()
