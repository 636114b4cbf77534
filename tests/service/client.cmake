# SPDX-License-Identifier: Apache-2.0
# The client for controllers: its examples, built as users build them, against simulators.
add_executable(client_elbow ${CMAKE_SOURCE_DIR}/examples/controller-c/elbow.c)
target_link_libraries(client_elbow PRIVATE hil_flags coman_hil_client)
add_executable(client_joints ${CMAKE_CURRENT_SOURCE_DIR}/service/client_joints.c)
target_link_libraries(client_joints PRIVATE hil_flags coman_hil_client)
if(NOT HIL_SANITIZE)
    hil_script_test(service_client LABELS service TIMEOUT 300 COMMAND
        /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/client.py ${CMAKE_COMMAND}
        $<TARGET_FILE:coman-hil> $<TARGET_FILE:client_joints>)
    set_tests_properties(service_client PROPERTIES RESOURCE_LOCK install)
    hil_script_test(service_user_job LABELS service TIMEOUT 200
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/user_job.sh ${CMAKE_COMMAND}
                $<TARGET_FILE:coman-hil>)
    set_tests_properties(service_user_job PROPERTIES RESOURCE_LOCK install)
    hil_script_test(client_vcan LABELS service TIMEOUT 190
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/service/client_vcan.sh $<TARGET_FILE:coman-hil>
                $<TARGET_FILE:client_elbow>)
endif()
