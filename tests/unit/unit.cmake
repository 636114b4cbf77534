# SPDX-License-Identifier: Apache-2.0
# What holds for the whole tree; the rooms' tests are in their folders.
foreach(name dependency_rule icub_examples source_style)
    hil_script_test(${name} LABELS unit
        COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/${name}.py)
endforeach()
