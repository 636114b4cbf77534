# SPDX-License-Identifier: Apache-2.0
# Joints that follow others, over the buses.
hil_script_test(service_couplings COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/couplings.sh
                LABELS service TIMEOUT 240)
