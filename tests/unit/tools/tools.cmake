# SPDX-License-Identifier: Apache-2.0
foreach(name foot_mesh mesh_write terrain_mesh)
    hil_test(tools_${name} SOURCES unit/tools/${name}.c LIBS mesh_tools LABELS unit)
endforeach()
target_compile_definitions(test_tools_foot_mesh PRIVATE FOOT_MESH="$<TARGET_FILE:foot-mesh>")
add_dependencies(test_tools_foot_mesh foot-mesh)
target_compile_definitions(test_tools_terrain_mesh
                           PRIVATE TERRAIN_MESH="$<TARGET_FILE:terrain-mesh>")
add_dependencies(test_tools_terrain_mesh terrain-mesh)
