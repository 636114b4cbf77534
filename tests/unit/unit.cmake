# SPDX-License-Identifier: Apache-2.0
# What holds for the whole tree; the rooms' tests are in their folders.
hil_script_test(dependency_rule COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/dependency_rule.py
                LABELS unit)
