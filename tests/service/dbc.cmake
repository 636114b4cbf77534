# SPDX-License-Identifier: Apache-2.0
# DBC databases: the format, and what other programs read in ours.
hil_script_test(service_dbc COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/dbc.sh
                LABELS service TIMEOUT 120)
