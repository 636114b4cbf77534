# SPDX-License-Identifier: Apache-2.0
foreach(name board_faults board_faults_frames boards can_state event_text messages
        axis protocol_list settings ticks voltage_delay)
    hil_test(boards_${name} SOURCES unit/boards/${name}.c LIBS boards LABELS unit)
endforeach()
# sensing/, and each protocol's folder
file(GLOB sources CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_LIST_DIR}
     ${CMAKE_CURRENT_LIST_DIR}/*/*.c)
foreach(source ${sources})
    string(REGEX REPLACE "[/]" "_" name ${source})
    string(REGEX REPLACE "[.]c$" "" name ${name})
    hil_test(boards_${name} SOURCES unit/boards/${source} LIBS boards LABELS unit)
endforeach()
