# SPDX-License-Identifier: Apache-2.0
# The run and task commands from outside.
hil_script_test(service_run COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/run.sh
                LABELS service TIMEOUT 120 SERIAL)
hil_script_test(service_same_bits COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/same_bits.sh
                LABELS service TIMEOUT 120)
hil_script_test(service_goodbye COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/service/goodbye.py $<TARGET_FILE:coman-hil>
                LABELS service TIMEOUT 120)
hil_script_test(service_planted COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/planted.sh
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
hil_script_test(service_own_files COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/own_files.sh
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
hil_script_test(service_trust COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/trust.sh
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
hil_script_test(service_squat COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/squat.sh
                LABELS service TIMEOUT 300)
hil_script_test(service_bus_plans COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/bus_plans.sh
                LABELS service TIMEOUT 300)
hil_script_test(service_wire_budget COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/wire_budget.sh
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 60)
# The address space of a guest process has no room for the shadow memory of the sanitizers.
if(NOT HIL_SANITIZE)
    hil_script_test(service_run_vcan LABELS service TIMEOUT 320
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/run.sh -t 300
                ${CMAKE_CURRENT_SOURCE_DIR}/service/run_vcan.sh)
    hil_script_test(service_answers_vcan LABELS service TIMEOUT 440
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/run.sh -t 420
                ${CMAKE_CURRENT_SOURCE_DIR}/service/answers_vcan.sh)
    hil_script_test(service_rest_bus_vcan LABELS service TIMEOUT 160
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/run.sh -t 150
                ${CMAKE_CURRENT_SOURCE_DIR}/service/rest_bus_vcan.sh)
endif()
