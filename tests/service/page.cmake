# SPDX-License-Identifier: Apache-2.0
hil_script_test(service_page COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/page.py
                LABELS service TIMEOUT 60)
hil_script_test(page_end COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/page_end.py
                LABELS service TIMEOUT 60)
hil_script_test(page_bundle LABELS service TIMEOUT 60
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh bundle)
hil_script_test(page_store LABELS service TIMEOUT 60
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh store)
# With a picture drawn by the processor; alone, for it takes all of it
hil_script_test(page_browser LABELS service TIMEOUT 300 SERIAL
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh browser $<TARGET_FILE:coman-hil>)
hil_script_test(page_visual LABELS service TIMEOUT 300 SERIAL
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh visual $<TARGET_FILE:coman-hil>)
hil_script_test(page_end_browser LABELS service TIMEOUT 300 SERIAL
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh end $<TARGET_FILE:coman-hil>)
hil_script_test(page_replay LABELS service TIMEOUT 120 SERIAL
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh replay $<TARGET_FILE:coman-hil>)
foreach(name plots act)
    hil_script_test(page_${name} LABELS service TIMEOUT 300 SERIAL
        COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/service/page_node.sh ${name}
                $<TARGET_FILE:coman-hil>)
endforeach()
hil_script_test(page_recording LABELS service TIMEOUT 60
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/page_recording.py)
hil_script_test(page_example LABELS service TIMEOUT 30
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/page_example.py)
hil_script_test(page_coman_meshes LABELS service TIMEOUT 30
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/coman_meshes.py
            $<TARGET_FILE:coman-hil>)
