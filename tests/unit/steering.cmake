# SPDX-License-Identifier: Apache-2.0
# What may be asked of a running simulator.
foreach(name steering_back steering_loop steering_parts steering_robot steering_threads)
    hil_test(rt_${name} SOURCES unit/${name}.c LIBS rt LABELS unit)
endforeach()
