# SPDX-License-Identifier: Apache-2.0
hil_script_test(service_ctl COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/ctl.py
                $<TARGET_FILE:coman-hil> LABELS service TIMEOUT 120)
hil_script_test(service_answers LABELS service TIMEOUT 120
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/answers.py
            $<TARGET_FILE:coman-hil>)
hil_script_test(service_short_waits LABELS service TIMEOUT 400
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/short_waits.py
            $<TARGET_FILE:coman-hil>)
hil_script_test(service_ctl_terminal LABELS service
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/ctl_terminal.py
            $<TARGET_FILE:coman-hil>)
