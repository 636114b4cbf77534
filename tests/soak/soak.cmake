# SPDX-License-Identifier: Apache-2.0
# Long runs, bounded here: two simulated minutes in lockstep (one with sanitizers) and twelve
# seconds in real time; with SOAK=full in the environment an hour and ten minutes.
set(soak_sources fault_lines intruder listener lockstep part player rules)
list(TRANSFORM soak_sources PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/soak/)
list(TRANSFORM soak_sources APPEND .c)
add_executable(soak_lockstep ${soak_sources})
target_link_libraries(soak_lockstep PRIVATE hil_flags sim)
target_compile_definitions(soak_lockstep PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")

add_executable(soak_realtime ${CMAKE_CURRENT_SOURCE_DIR}/soak/realtime.c)
target_link_libraries(soak_realtime PRIVATE hil_flags sim)
target_compile_definitions(soak_realtime PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")

set(soak_seconds 120)
if(HIL_SANITIZE)
    set(soak_seconds 60)
endif()
hil_script_test(soak_lockstep COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/soak/lockstep.sh
                $<TARGET_FILE:soak_lockstep> ${soak_seconds}
                LABELS soak TIMEOUT 1800)
hil_script_test(soak_realtime COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/soak/realtime.sh
                $<TARGET_FILE:soak_realtime> LABELS soak TIMEOUT 1500 SERIAL)
hil_script_test(soak_walk_sweep COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/soak/walk_sweep.py $<TARGET_FILE:coman-hil> 2
                LABELS soak TIMEOUT 120)
