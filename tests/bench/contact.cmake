# SPDX-License-Identifier: Apache-2.0
add_executable(contact_count ${CMAKE_CURRENT_SOURCE_DIR}/bench/contact_count.c)
target_link_libraries(contact_count PRIVATE hil_flags contact)
target_compile_definitions(contact_count PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
if(NOT HIL_SANITIZE)
    hil_script_test(contact_instructions
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/contact_instructions.sh $<TARGET_FILE:contact_count>
        TIMEOUT 120 LABELS bench)
endif()
hil_script_test(contact_bench
    COMMAND $<TARGET_FILE:coman-hil> bench contact --quick ${CMAKE_SOURCE_DIR}/config/meshes/coman-foot-right.obj
    TIMEOUT 180 LABELS bench)
