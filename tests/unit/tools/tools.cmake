# SPDX-License-Identifier: Apache-2.0
hil_script_test(tools_meshes LABELS unit
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/unit/tools/meshes.py)
hil_script_test(tools_dev LABELS unit
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/unit/tools/dev.py)
