# SPDX-License-Identifier: Apache-2.0
hil_test(contact_native_agreement SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_agreement.c
         LIBS contact LABELS physics)

hil_test(contact_native SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native.c
         LIBS contact TIMEOUT 180 LABELS physics)

hil_test(contact_native_bodies SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_bodies.c
         LIBS contact TIMEOUT 180 LABELS physics)

hil_test(contact_native_impacts SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_impacts.c
         LIBS contact TIMEOUT 180 LABELS physics)

hil_test(contact_native_variants SOURCES physics/contact_native_variants.c
         LIBS contact LABELS physics)

# The physics once more with the kernels of each instruction set, those that this machine would not
# choose too; what it cannot run is skipped.
foreach(test contact_native contact_native_bodies)
    target_sources(test_${test} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_forced.c)
    target_link_options(test_${test} PRIVATE -Wl,--wrap=contact_native_create)
    foreach(kernels plain avx2 avx512)
        add_test(NAME ${test}_${kernels} COMMAND test_${test})
        hil_test_limits(${test}_${kernels} 180 "" physics)
        set_property(TEST ${test}_${kernels} APPEND PROPERTY
                     ENVIRONMENT HIL_CONTACT_KERNELS=${kernels})
    endforeach()
endforeach()

hil_test(contact_native_rt SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_rt.c
         LIBS contact -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc LABELS physics)

hil_script_test(contact_native_rig
    COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_native_rig.sh $<TARGET_FILE:coman-hil>
    TIMEOUT 180 LABELS physics)
