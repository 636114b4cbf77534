# SPDX-License-Identifier: Apache-2.0
# Programs of others, unmodified: what they say to boards, replayed, with every answer judged.
if(NOT HIL_SANITIZE)
    foreach(client canloader-bll canloader-2foc lely-boot-slave odrive-arduino
                   ros-odrive)
        hil_script_test(client_${client} LABELS service TIMEOUT 60
            COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/replay.py
                    $<TARGET_FILE:coman-hil> ${CMAKE_CURRENT_LIST_DIR}/frames/${client}.frames)
    endforeach()
    hil_script_test(client_eds_objects LABELS service TIMEOUT 60
        COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/eds_objects.py $<TARGET_FILE:coman-hil>)
endif()
