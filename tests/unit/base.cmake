# SPDX-License-Identifier: Apache-2.0
set(unit ${CMAKE_CURRENT_SOURCE_DIR}/unit)
hil_test(base_text SOURCES ${unit}/base_text.c LIBS base LABELS unit)
hil_test(base_arena SOURCES ${unit}/base_arena.c LIBS base LABELS unit)
hil_test(base_ring SOURCES ${unit}/base_ring.c LIBS base Threads::Threads LABELS unit)
hil_test(yaml SOURCES ${unit}/yaml.c LIBS base LABELS unit)
hil_script_test(dependency_rule COMMAND ${unit}/dependency_rule.sh LABELS unit)
