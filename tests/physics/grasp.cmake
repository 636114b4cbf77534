# SPDX-License-Identifier: Apache-2.0
# The manipulation task: its physics, its rigs, and the task over the buses.
hil_test(grasp SOURCES physics/grasp.c LIBS sim LABELS physics TIMEOUT 120)
hil_script_test(service_grasp COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/service/grasp.sh
                LABELS service TIMEOUT 120)
