# SPDX-License-Identifier: Apache-2.0
foreach(name faults parse)
    hil_test(faults_${name} SOURCES unit/faults/${name}.c LIBS boards LABELS unit)
endforeach()
