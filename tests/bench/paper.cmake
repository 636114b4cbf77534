# SPDX-License-Identifier: Apache-2.0
# The report on the paper, in its short form: whole, well formed, and its numbers right.
hil_script_test(paper_report COMMAND ${CMAKE_CURRENT_LIST_DIR}/paper.sh
                $<TARGET_FILE:coman-hil-bench>
                LABELS bench TIMEOUT 300)
