# SPDX-License-Identifier: Apache-2.0
# The loop and what it stands on.
foreach(name histogram snapshot eventlog recorder buses realtime loop loop_lockstep loop_overload loop_quiet)
    hil_test(rt_${name} SOURCES unit/${name}.c LIBS rt LABELS unit)
endforeach()
