# SPDX-License-Identifier: Apache-2.0
# Scenarios, and programs that join the buses through the gateway.
set(scenarios) # all; with sanitizers some, of each protocol and kind of fault
if(HIL_SANITIZE)
    set(scenarios bus_off_and_recovery compact_timeout error_burst fd_telemetry
        foc_set_point_expiry ft_saturation id_collision lost_step over_current start_up_discovery
        wrong_length)
endif()
hil_script_test(service_scenarios COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/scenarios.sh
                ${scenarios} LABELS service TIMEOUT 300)
hil_script_test(service_gateway COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/gateway.py
                LABELS service TIMEOUT 200)
hil_script_test(service_slcan LABELS service TIMEOUT 60
                COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/slcan.py)
# The address space of a guest process has no room for the shadow memory of the sanitizers.
if(NOT HIL_SANITIZE)
    hil_script_test(service_slcan_vcan LABELS service TIMEOUT 130
                    COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/slcan_vcan.sh
                            $<TARGET_FILE:coman-hil>)
endif()
hil_script_test(service_gateway_lockstep
                COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/gateway_lockstep.py
                LABELS service TIMEOUT 200)
hil_script_test(service_program COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/program.sh
                LABELS service TIMEOUT 120)
hil_script_test(service_plan COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/plan.sh
                LABELS service TIMEOUT 120)
hil_script_test(service_cluster COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/cluster.sh
                LABELS service TIMEOUT 180)
