# SPDX-License-Identifier: Apache-2.0
# The client for controllers: its examples, built as users build them, against simulators.
if(NOT HIL_SANITIZE)
    hil_script_test(service_client LABELS service TIMEOUT 300 COMMAND
        /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/client.py ${CMAKE_COMMAND}
        $<TARGET_FILE:coman-hil>)
    set_tests_properties(service_client PROPERTIES RESOURCE_LOCK install)
endif()
