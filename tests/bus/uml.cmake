# SPDX-License-Identifier: Apache-2.0
# User-mode Linux (uml/run.sh) on machines whose XSAVE area is larger than it knows. linux.uml is
# not ours: what is preloaded into it has no sanitizers.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT HIL_SANITIZE)
    foreach(library xsave narrow)
        add_library(uml_${library} MODULE bus/uml/preload_${library}.c)
        target_link_libraries(uml_${library} PRIVATE hil_flags ${CMAKE_DL_LIBS})
        set_target_properties(uml_${library} PROPERTIES PREFIX "")
    endforeach()
    add_executable(xsave_area bus/uml/xsave_area.c)
    target_link_libraries(xsave_area PRIVATE hil_flags)

    hil_script_test(uml_narrow LABELS bus TIMEOUT 120
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/narrow.sh $<TARGET_FILE:uml_narrow>)
endif()
