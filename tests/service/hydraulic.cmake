# SPDX-License-Identifier: Apache-2.0
# Hydraulic joints over the buses.
hil_script_test(service_hydraulic COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/hydraulic.sh
                LABELS service TIMEOUT 180)
