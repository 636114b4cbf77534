# SPDX-License-Identifier: Apache-2.0
# The control socket and the ctl command.
hil_test(rt_control_parse SOURCES unit/control_parse.c LIBS rt LABELS unit)
hil_test(rt_control_socket SOURCES unit/control_socket.c LIBS rt LABELS unit)
hil_test(rt_control SOURCES unit/control.c LIBS rt LABELS unit)
hil_test(rt_control_hostile SOURCES unit/control_hostile.c LIBS rt LABELS unit TIMEOUT 240)
hil_test(rt_control_memory SOURCES unit/control_memory.c LIBS rt LABELS unit)
hil_test(rt_stream SOURCES unit/stream.c LIBS rt LABELS unit)
hil_script_test(service_ctl COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/ctl.py
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
