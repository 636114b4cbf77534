# SPDX-License-Identifier: Apache-2.0
# Sensors as real ones, and faults.
set(tests ${CMAKE_CURRENT_SOURCE_DIR})
hil_test(faults SOURCES ${tests}/unit/faults.c LIBS boards LABELS unit)
hil_test(boards_faults SOURCES ${tests}/unit/boards_faults.c LIBS boards LABELS unit)
hil_test(sensing SOURCES ${tests}/unit/sensing.c LIBS boards LABELS unit)
hil_test(fault_port SOURCES ${tests}/unit/fault_port.c LIBS canbus Threads::Threads LABELS unit)
hil_test(rig_sensors SOURCES ${tests}/unit/rig_sensors.c LIBS rt LABELS unit)
hil_test(drive_faults SOURCES ${tests}/physics/drive_faults.c ${tests}/physics/toy.c
         LIBS model LABELS physics)
hil_script_test(service_faults COMMAND ${tests}/service/faults.sh LABELS service TIMEOUT 240)
