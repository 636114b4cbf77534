# SPDX-License-Identifier: Apache-2.0
foreach(name broad_phase friction_slope native_anchor solid solid_store tangent tree mesh
             mesh_capsule mesh_edges mesh_obj mesh_memory)
    hil_test(contact_${name} SOURCES unit/contact/${name}.c LIBS contact LABELS unit)
endforeach()
hil_test(contact_config SOURCES unit/contact/contact_config.c LIBS contact LABELS unit)
target_link_libraries(test_contact_mesh_obj PRIVATE mesh_tools)
target_link_options(test_contact_mesh_memory PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc)
