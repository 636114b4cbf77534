# SPDX-License-Identifier: Apache-2.0
hil_test(host SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/host.c LIBS tasks canbus base)
