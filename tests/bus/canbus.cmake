# SPDX-License-Identifier: Apache-2.0
# The canbus folder: what runs anywhere, and what needs a kernel with CAN (user-mode Linux).
set(tests ${CMAKE_CURRENT_SOURCE_DIR})
hil_test(canbus_socketcan SOURCES ${tests}/bus/canbus_socketcan.c LIBS canbus LABELS bus)

# A port as a program, for can-utils to be put against.
add_executable(canbus_tool ${tests}/bus/canbus_tool.c)
target_link_libraries(canbus_tool PRIVATE canbus)

# The CANopen nodes, judged by a library that is not ours
if(NOT HIL_SANITIZE)
    hil_script_test(canopen_client LABELS bus TIMEOUT 180
        COMMAND sh ${tests}/bus/canopen/run.sh $<TARGET_FILE:coman-hil>)
endif()

# The address space of a guest process has no room for the shadow memory of the sanitizers.
if(NOT HIL_SANITIZE)
    hil_script_test(canbus_socketcan_vcan LABELS bus TIMEOUT 120
        COMMAND bash ${tests}/bus/uml/run.sh -t 100 $<TARGET_FILE:test_canbus_socketcan>)
    hil_script_test(clients_port LABELS bus TIMEOUT 150
        COMMAND bash ${tests}/bus/uml/run.sh -t 120 /usr/bin/python3 ${tests}/bus/uml/clients.py
                $<TARGET_FILE:canbus_tool>)
    hil_script_test(lockstep_vcan LABELS bus TIMEOUT 150
        COMMAND bash ${tests}/bus/uml/run.sh -t 130 /usr/bin/python3 ${tests}/bus/uml/lockstep.py
                $<TARGET_FILE:coman-hil>)
    hil_script_test(clients_simulator LABELS bus TIMEOUT 240
        COMMAND bash ${tests}/bus/uml/run.sh -t 200 /usr/bin/python3 ${tests}/bus/uml/clients.py
                $<TARGET_FILE:canbus_tool> $<TARGET_FILE:coman-hil>)
endif()
