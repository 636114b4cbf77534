# SPDX-License-Identifier: Apache-2.0
foreach(name histogram loop loop_arrivals loop_events loop_lockstep overrun pace loop_requests
        loop_requests_speed realtime snapshot stream)
    hil_test(rt_${name} SOURCES unit/rt/${name}.c LIBS rt LABELS unit)
endforeach()
foreach(name recorder recorder_events)
    hil_test(rt_${name} SOURCES unit/rt/recording/${name}.c LIBS rt LABELS unit)
endforeach()
hil_test(rt_mcap SOURCES unit/rt/recording/mcap.c LIBS rt PkgConfig::ZSTD LABELS unit)
