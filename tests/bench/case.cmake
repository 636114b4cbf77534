# SPDX-License-Identifier: Apache-2.0
# What a start and a case of a sweep cost; valgrind cannot run what the sanitizers build
if(NOT HIL_SANITIZE AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
    hil_script_test(case_instructions
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/case_instructions.sh $<TARGET_FILE:coman-hil>
        TIMEOUT 120 LABELS bench)
    hil_script_test(start_instructions
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/start_instructions.sh $<TARGET_FILE:coman-hil>
        TIMEOUT 120 LABELS bench)
    hil_script_test(fallen_instructions
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/fallen_instructions.sh $<TARGET_FILE:coman-hil>
        TIMEOUT 300 LABELS bench)
endif()
