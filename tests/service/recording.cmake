# SPDX-License-Identifier: Apache-2.0
# What a recorded run leaves behind
hil_script_test(service_recording LABELS service TIMEOUT 120
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/recording.py
            $<TARGET_FILE:coman-hil>)
