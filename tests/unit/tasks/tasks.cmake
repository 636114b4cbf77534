# SPDX-License-Identifier: Apache-2.0
foreach(name gait host host_cia402 host_compact host_foc host_inertial host_lockstep host_mixed)
    hil_test(tasks_${name} SOURCES unit/tasks/${name}.c LIBS tasks LABELS unit)
endforeach()
foreach(name motion_profile pose sine_fit trajectory)
    hil_test(tasks_${name} SOURCES unit/tasks/${name}.c LIBS tasks LABELS unit)
endforeach()
hil_test(tasks_leg SOURCES unit/tasks/leg.c LIBS rig LABELS unit)
# the servo alone, without the host that it is linked with elsewhere
hil_test(tasks_servo SOURCES unit/tasks/servo.c ${CMAKE_SOURCE_DIR}/tasks/servo.c
         LIBS base m LABELS unit)
