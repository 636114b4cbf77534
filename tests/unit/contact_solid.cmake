# SPDX-License-Identifier: Apache-2.0
hil_test(contact_solid SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/contact_solid.c LIBS contact LABELS unit)
