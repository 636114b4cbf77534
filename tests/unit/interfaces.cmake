# SPDX-License-Identifier: Apache-2.0
hil_test(rt_interfaces SOURCES unit/interfaces.c LIBS rt LABELS unit)
