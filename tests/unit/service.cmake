# SPDX-License-Identifier: Apache-2.0
# What makes it a service.
hil_test(rt_notify SOURCES unit/notify.c LIBS rt LABELS unit)
hil_test(rt_doctor SOURCES unit/doctor.c LIBS rt LABELS unit)
