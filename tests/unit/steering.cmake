# SPDX-License-Identifier: Apache-2.0
# What may be asked of a running simulator.
foreach(name steering_back)
    hil_test(rt_${name} SOURCES unit/${name}.c LIBS rt LABELS unit)
endforeach()
