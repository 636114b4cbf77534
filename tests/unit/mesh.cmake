# SPDX-License-Identifier: Apache-2.0
hil_test(mesh SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/mesh.c LIBS contact LABELS unit)
hil_test(mesh_obj SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/mesh_obj.c LIBS contact LABELS unit)

hil_test(mesh_foot SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/mesh_foot.c LIBS contact LABELS unit)
target_compile_definitions(test_mesh_foot PRIVATE FOOT_MESH="$<TARGET_FILE:foot-mesh>")
add_dependencies(test_mesh_foot foot-mesh)

hil_test(mesh_memory SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/unit/mesh_memory.c LIBS contact
         LABELS unit)
target_link_options(test_mesh_memory PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc)
