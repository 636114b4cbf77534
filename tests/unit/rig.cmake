# SPDX-License-Identifier: Apache-2.0
set(unit ${CMAKE_CURRENT_SOURCE_DIR}/unit)
hil_test(options SOURCES ${unit}/options.c LIBS rt LABELS unit)
hil_test(rig SOURCES ${unit}/rig.c LIBS rt LABELS unit)
hil_test(rig_buses SOURCES ${unit}/rig_buses.c LIBS rt LABELS unit)
hil_test(rig_wire SOURCES ${unit}/rig_wire.c LIBS rt LABELS unit)
hil_script_test(cli COMMAND ${unit}/cli.sh $<TARGET_FILE:coman-hil> LABELS unit)
