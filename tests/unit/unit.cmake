# SPDX-License-Identifier: Apache-2.0
# What holds for the whole tree; the rooms' tests are in their folders.
# the libraries by which a run is decided
set(decides base boards canbus contact model rig rt sim symbolic symbolic_builtin tasks scenario)
list(TRANSFORM decides REPLACE "(.+)" "$<TARGET_FILE:\\1>")
hil_script_test(portable_rule LABELS unit
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/portable_rule.py ${decides})
hil_script_test(clang_reads LABELS unit TIMEOUT 180
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/clang_reads.py)
foreach(name comment_names dependency_rule figures icub_examples line_budget source_style)
    hil_script_test(${name} LABELS unit
        COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/${name}.py)
endforeach()
hil_script_test(versions LABELS unit COMMAND sh ${CMAKE_CURRENT_LIST_DIR}/versions.sh)
