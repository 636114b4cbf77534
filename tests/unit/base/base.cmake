# SPDX-License-Identifier: Apache-2.0
foreach(name arena options ring text yaml)
    hil_test(base_${name} SOURCES unit/base/${name}.c LIBS base Threads::Threads LABELS unit)
endforeach()
foreach(name journal markup whole_file)
    hil_test(base_${name} SOURCES unit/base/${name}.c LIBS base LABELS unit)
endforeach()
