# SPDX-License-Identifier: Apache-2.0
hil_test(contact_native_agreement SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_agreement.c
         LIBS contact LABELS physics)

hil_test(contact_native SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native.c
         LIBS contact TIMEOUT 180 LABELS physics)

hil_test(contact_native_bodies SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_bodies.c
         LIBS contact TIMEOUT 180 LABELS physics)

hil_test(contact_native_impacts SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_impacts.c
         LIBS contact TIMEOUT 180 LABELS physics)

hil_test(contact_native_rt SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_rt.c
         LIBS contact -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc LABELS physics)

hil_script_test(contact_native_rig
    COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_rig.sh $<TARGET_FILE:coman-hil>
    TIMEOUT 180 LABELS physics)
