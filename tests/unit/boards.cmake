# SPDX-License-Identifier: Apache-2.0
foreach(part commands compact control foc heat messages modes nodes settings strain table)
    hil_test(boards_${part} SOURCES ${CMAKE_CURRENT_LIST_DIR}/boards_${part}.c
             LIBS boards Threads::Threads LABELS unit)
endforeach()
hil_test(boards_wire SOURCES ${CMAKE_CURRENT_LIST_DIR}/boards_wire.c
         LIBS boards canbus Threads::Threads LABELS unit)
hil_test(boards_drive SOURCES ${CMAKE_CURRENT_LIST_DIR}/../physics/boards_drive.c
         ${CMAKE_CURRENT_LIST_DIR}/../physics/toy.c LIBS boards model LABELS physics)
