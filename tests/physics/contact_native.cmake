# SPDX-License-Identifier: Apache-2.0
foreach(name "" _invariants _tangents _bodies _impacts)
    hil_test(contact_native${name} SOURCES physics/contact_native${name}.c
             LIBS contact TIMEOUT 180 LABELS physics)
endforeach()
hil_test(contact_fields SOURCES physics/contact_fields.c LIBS contact TIMEOUT 180 LABELS physics)
hil_test(contact_terrain SOURCES physics/contact_terrain.c LIBS contact LABELS physics)
hil_test(contact_backing SOURCES physics/contact_backing.c LIBS contact LABELS physics)
hil_test(contact_capsule SOURCES physics/contact_capsule.c LIBS contact LABELS physics)
hil_test(contact_holding SOURCES physics/contact_holding.c LIBS contact TIMEOUT 300 LABELS physics)
hil_test(contact_spin SOURCES physics/contact_spin.c LIBS contact LABELS physics)
hil_test(contact_sticking SOURCES physics/contact_sticking.c
         LIBS contact TIMEOUT 300 LABELS physics)
hil_test(contact_native_agreement SOURCES physics/contact_native_agreement.c
         LIBS contact LABELS physics)
hil_test(contact_native_variants SOURCES physics/contact_native_variants.c
         LIBS contact LABELS physics)

hil_test(contact_native_rt SOURCES physics/contact_native_rt.c physics/counting_malloc.c
         LIBS contact -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=free
         LABELS physics)

hil_script_test(contact_native_rig
    COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_rig.sh $<TARGET_FILE:coman-hil>
    TIMEOUT 180 LABELS physics)
