# SPDX-License-Identifier: Apache-2.0
# Protocols that a file describes.
hil_script_test(service_described COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/described.sh
                LABELS service TIMEOUT 120)
