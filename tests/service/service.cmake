# SPDX-License-Identifier: Apache-2.0
# What makes it a service.
hil_test(rt_notify SOURCES unit/notify.c LIBS rt LABELS unit)
hil_test(rt_doctor SOURCES unit/doctor.c LIBS rt LABELS unit)
hil_test(rt_rig_path SOURCES unit/rig_path.c LIBS rt LABELS unit)
hil_script_test(service_units COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/units.sh $<TARGET_FILE:coman-hil>
                LABELS service)
hil_script_test(service_reload COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/reload.py
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
# The address space of a guest process has no room for the shadow memory of the sanitizers.
if(NOT HIL_SANITIZE)
    hil_script_test(service_systemd LABELS service TIMEOUT 240
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/systemd.sh)
endif()
