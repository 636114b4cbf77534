# SPDX-License-Identifier: Apache-2.0
foreach(name bodies bus_load buses find rig sensors variants)
    hil_test(rig_${name} SOURCES unit/rig/${name}.c LIBS rig LABELS unit)
endforeach()
