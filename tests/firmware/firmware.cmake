# SPDX-License-Identifier: Apache-2.0
# The firmware of examples/ under test: QEMU runs it, scenarios judge it and its seeded bugs.
hil_script_test(firmware LABELS firmware TIMEOUT 300
    COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/firmware/firmware.sh)
# Several QEMU at a time: all that the processors have
set_tests_properties(firmware PROPERTIES PROCESSORS 2)
