# SPDX-License-Identifier: Apache-2.0
# Wire mode on COMAN's whole traffic: every time against the reference encoder, and what it costs.
add_executable(wire_log ${CMAKE_CURRENT_SOURCE_DIR}/bench/wire_log.c)
target_link_libraries(wire_log PRIVATE hil_flags)
hil_script_test(wire_times
    COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/wire_times.sh $<TARGET_FILE:coman-hil>
        $<TARGET_FILE:wire_log>
    TIMEOUT 120 LABELS bench)
if(NOT HIL_SANITIZE)
    hil_script_test(wire_instructions
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/wire_instructions.sh $<TARGET_FILE:coman-hil>
        TIMEOUT 180 LABELS bench)
endif()
