# SPDX-License-Identifier: Apache-2.0
foreach(name broad_phase friction_slope mesh/capsule mesh/edges mesh/memory mesh/mesh mesh/obj
             mesh/solid mesh/solid_store mesh/tree native/anchor native/facet_below_plane segments
             tangent)
    string(REPLACE "/" "_" test ${name})
    hil_test(contact_${test} SOURCES unit/contact/${name}.c LIBS contact LABELS unit)
endforeach()
hil_test(contact_config SOURCES unit/contact/contact_config.c LIBS contact LABELS unit)
target_link_options(test_contact_mesh_memory PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc)
