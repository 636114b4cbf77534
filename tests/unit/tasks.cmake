# SPDX-License-Identifier: Apache-2.0
hil_test(host SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/host.c LIBS tasks canbus base)
hil_test(host_lockstep SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/host_lockstep.c LIBS tasks canbus base)
hil_test(host_foc SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/host_foc.c LIBS tasks canbus base)
hil_test(host_compact SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/host_compact.c
         LIBS tasks canbus base)
hil_test(host_mixed SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/host_mixed.c LIBS tasks canbus base)
