# SPDX-License-Identifier: Apache-2.0
# the servo alone, without the host that it is linked with elsewhere
hil_test(servo SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/servo.c ${CMAKE_SOURCE_DIR}/tasks/servo.c
         LIBS base m LABELS unit)
