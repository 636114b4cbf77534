# SPDX-License-Identifier: Apache-2.0
# Recordings played back: to the boards of a simulator, and onto live buses
hil_script_test(service_replay LABELS service TIMEOUT 90
    COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/replay.sh $<TARGET_FILE:coman-hil>)
if(NOT HIL_SANITIZE)
    hil_script_test(service_replay_vcan LABELS service TIMEOUT 90
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/run.sh -t 80
                bash ${CMAKE_CURRENT_SOURCE_DIR}/service/replay_vcan.sh)
endif()
