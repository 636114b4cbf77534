# SPDX-License-Identifier: Apache-2.0
hil_script_test(service_faults COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/faults.sh
                LABELS service TIMEOUT 240)
