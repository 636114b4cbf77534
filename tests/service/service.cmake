# SPDX-License-Identifier: Apache-2.0
# What makes it a service.
hil_script_test(service_units COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/units.sh
                $<TARGET_FILE:coman-hil>
                LABELS service)
hil_script_test(service_reload COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/service/reload.py
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
if(NOT HIL_SANITIZE AND NOT CMAKE_BUILD_TYPE STREQUAL Debug)
    hil_script_test(service_hardening LABELS service
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/hardening.sh
                $<TARGET_FILE:coman-hil> $<TARGET_FILE:coman-hil-bench>)
endif()
set(standing_s 600)
if(HIL_SANITIZE)
    set(standing_s 30)
endif()
hil_script_test(service_standing COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/service/standing.py
                $<TARGET_FILE:coman-hil> ${standing_s} LABELS service
                TIMEOUT 600)
# The address space of a guest process has no room for the shadow memory of the sanitizers.
if(NOT HIL_SANITIZE)
    hil_script_test(service_systemd LABELS service TIMEOUT 360
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/systemd.sh ${CMAKE_CPACK_COMMAND})
    hil_script_test(service_package LABELS service TIMEOUT 120
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/package.sh ${CMAKE_COMMAND}
            ${CMAKE_CPACK_COMMAND})
    # both write the list of what was installed
    set_tests_properties(service_systemd service_package PROPERTIES RESOURCE_LOCK install)
    # A controller in real time, in a guest that has one processor
    set_tests_properties(service_systemd PROPERTIES PROCESSORS 2)
endif()
hil_script_test(service_manual LABELS service TIMEOUT 240 COMMAND
    /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/manual.py ${CMAKE_SOURCE_DIR}
        ${CMAKE_BINARY_DIR})
set_tests_properties(service_manual PROPERTIES RESOURCE_LOCK install)
