# SPDX-License-Identifier: Apache-2.0
foreach(name foot_mesh mesh_write)
    hil_test(tools_${name} SOURCES unit/tools/${name}.c LIBS mesh_tools LABELS unit)
endforeach()
target_compile_definitions(test_tools_foot_mesh PRIVATE FOOT_MESH="$<TARGET_FILE:foot-mesh>")
add_dependencies(test_tools_foot_mesh foot-mesh)
