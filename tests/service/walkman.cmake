# SPDX-License-Identifier: Apache-2.0
hil_script_test(service_walkman COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/walkman.sh
                LABELS service TIMEOUT 120)
