# SPDX-License-Identifier: Apache-2.0
foreach(part commands control modes strain table)
    hil_test(boards_${part} SOURCES ${CMAKE_CURRENT_LIST_DIR}/boards_${part}.c
             LIBS boards Threads::Threads LABELS unit)
endforeach()
hil_test(boards_fuzz SOURCES ${CMAKE_CURRENT_LIST_DIR}/../fuzz/boards.c
         LIBS boards -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc LABELS fuzz)
