# SPDX-License-Identifier: Apache-2.0
# What makes it a service.
hil_test(rt_notify SOURCES unit/notify.c LIBS rt LABELS unit)
