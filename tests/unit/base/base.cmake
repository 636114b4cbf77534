# SPDX-License-Identifier: Apache-2.0
foreach(name arena options ring text yaml yaml_entries yaml_refused)
    hil_test(base_${name} SOURCES unit/base/${name}.c LIBS base Threads::Threads LABELS unit)
endforeach()
foreach(name config crc32 csv error hash input_file instruction_set journal json_text markup
             memory_file options_page portable_math random whole_file)
    hil_test(base_${name} SOURCES unit/base/${name}.c LIBS base m LABELS unit)
endforeach()
