# SPDX-License-Identifier: Apache-2.0
foreach(name solid tangent tree mesh mesh_obj mesh_foot mesh_memory)
    hil_test(contact_${name} SOURCES unit/contact/${name}.c LIBS contact LABELS unit)
endforeach()
target_compile_definitions(test_contact_mesh_foot PRIVATE FOOT_MESH="$<TARGET_FILE:foot-mesh>")
add_dependencies(test_contact_mesh_foot foot-mesh)
target_link_options(test_contact_mesh_memory PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc)
