# SPDX-License-Identifier: Apache-2.0
foreach(name boards bodies bus_load dbc described_ids external limits rig robot robot_surfaces
             sensors shipped)
    hil_test(rig_${name} SOURCES unit/rig/${name}.c LIBS rig LABELS unit)
endforeach()
