# SPDX-License-Identifier: Apache-2.0
foreach(name buses interfaces loop_quiet steering_back steering_parts steering_robot steering_threads)
    hil_test(sim_${name} SOURCES unit/sim/${name}.c LIBS sim LABELS unit)
endforeach()
