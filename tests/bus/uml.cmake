# SPDX-License-Identifier: Apache-2.0
# User-mode Linux (uml/run.sh): the guest's first process, and machines whose XSAVE area is larger
# than it knows.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    hil_test(ptrace_xsave SOURCES bus/ptrace_xsave.c bus/uml/ptrace_xsave.c
             LIBS Threads::Threads LABELS bus)
    target_include_directories(test_ptrace_xsave PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})

    # linux.uml is not ours: what is preloaded into it has no sanitizers
    if(NOT HIL_SANITIZE)
        add_executable(uml_init bus/uml/init.c)
        target_link_libraries(uml_init PRIVATE hil_flags)
        target_link_options(uml_init PRIVATE -static)

        add_library(uml_xsave MODULE bus/uml/preload_xsave.c bus/uml/ptrace_xsave.c)
        add_library(uml_narrow MODULE bus/uml/preload_narrow.c)
        foreach(library uml_xsave uml_narrow)
            target_include_directories(${library} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
            target_link_libraries(${library} PRIVATE hil_flags ${CMAKE_DL_LIBS})
            set_target_properties(${library} PROPERTIES PREFIX "")
        endforeach()
        add_executable(xsave_area bus/uml/xsave_area.c)
        target_link_libraries(xsave_area PRIVATE hil_flags)

        hil_script_test(uml_narrow LABELS bus TIMEOUT 120
            COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/narrow.sh $<TARGET_FILE:uml_narrow>)
    endif()
endif()
