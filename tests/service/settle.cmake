# SPDX-License-Identifier: Apache-2.0
# The settled start from outside.
hil_script_test(service_settle COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/settle.sh
                LABELS service TIMEOUT 150)
