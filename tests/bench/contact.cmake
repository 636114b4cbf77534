# SPDX-License-Identifier: Apache-2.0
set(contact_count_sources ${CMAKE_CURRENT_SOURCE_DIR}/bench/contact_count.c
    ${CMAKE_SOURCE_DIR}/app/bench/contact_scenes.c)
add_executable(contact_count ${contact_count_sources})
target_link_libraries(contact_count PRIVATE hil_flags contact)
target_compile_definitions(contact_count PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")

# the native engine once more, with a count of the basic blocks that run
if(CMAKE_C_COMPILER_ID STREQUAL GNU AND NOT HIL_SANITIZE)
    file(GLOB contact_sources CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/contact/*.c
        ${CMAKE_SOURCE_DIR}/contact/mesh/*.c ${CMAKE_SOURCE_DIR}/contact/native/*.c)
    add_library(contact_counted OBJECT ${contact_sources})
    target_link_libraries(contact_counted PRIVATE hil_flags)
    target_compile_options(contact_counted PRIVATE -O3 -Wno-psabi -fsanitize-coverage=trace-pc)
    add_executable(contact_work ${contact_count_sources} $<TARGET_OBJECTS:contact_counted>)
    target_link_libraries(contact_work PRIVATE hil_flags base m)
    target_compile_definitions(contact_work PRIVATE COUNT_BLOCKS
        HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
    hil_script_test(contact_instructions
        COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/bench/contact_instructions.sh
                $<TARGET_FILE:contact_count> $<TARGET_FILE:contact_work>
        TIMEOUT 180 LABELS bench)
endif()
hil_script_test(contact_bench
    COMMAND $<TARGET_FILE:coman-hil-bench> contact --rounds 5
        ${CMAKE_SOURCE_DIR}/config/meshes/coman-foot-right.obj
    TIMEOUT 180 LABELS bench)
