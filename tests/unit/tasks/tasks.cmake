# SPDX-License-Identifier: Apache-2.0
file(GLOB hosts CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_LIST_DIR}
     ${CMAKE_CURRENT_LIST_DIR}/host*.c)
list(TRANSFORM hosts REPLACE "[.]c$" "")
foreach(name ${hosts} gait motion_profile pose sine_fit trajectory)
    hil_test(tasks_${name} SOURCES unit/tasks/${name}.c LIBS tasks LABELS unit)
endforeach()
hil_test(tasks_leg SOURCES unit/tasks/leg.c LIBS rig LABELS unit)
# the servo alone, without the host that it is linked with elsewhere
hil_test(tasks_servo SOURCES unit/tasks/servo.c ${CMAKE_SOURCE_DIR}/tasks/servo.c
         LIBS base m LABELS unit)
