# SPDX-License-Identifier: Apache-2.0
foreach(name histogram loop loop_lockstep overrun pace loop_steering loop_steering_speed realtime
        recorder recorder_contacts recorder_events snapshot stream)
    hil_test(rt_${name} SOURCES unit/rt/${name}.c LIBS rt LABELS unit)
endforeach()
