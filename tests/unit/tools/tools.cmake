# SPDX-License-Identifier: Apache-2.0
hil_test(tools_mesh_write SOURCES unit/tools/mesh_write.c LIBS mesh_tools LABELS unit)
hil_script_test(tools_meshes LABELS unit
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/unit/tools/meshes.py)
