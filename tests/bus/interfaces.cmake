# SPDX-License-Identifier: Apache-2.0
# Real CAN interfaces: two controllers in a machine of QEMU's. The supervisor is compiled in alone:
# the guest needs the libraries of what it runs, and those of all of sim are large.
set(bus ${CMAKE_CURRENT_SOURCE_DIR}/bus)
add_executable(test_canbus_controller ${bus}/canbus_controller.c
                                      ${CMAKE_SOURCE_DIR}/sim/interfaces.c)
target_link_libraries(test_canbus_controller PRIVATE test_main canbus PkgConfig::SOCKETCAN)
if(NOT HIL_SANITIZE)
    hil_script_test(canbus_qemu LABELS bus TIMEOUT 110
        COMMAND bash ${bus}/qemu/run.sh -t 300 $<TARGET_FILE:test_canbus_controller>
                $<TARGET_FILE:test_canbus_socketcan>)
endif()
