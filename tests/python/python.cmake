# SPDX-License-Identifier: Apache-2.0
# The Python package: what it makes of the DBC files, and simulators that it starts.
set(python_folder ${CMAKE_CURRENT_LIST_DIR})
foreach(area database simulator end plugin sea)
    hil_script_test(python_${area} LABELS python TIMEOUT 120
        COMMAND /usr/bin/python3 ${python_folder}/${area}.py $<TARGET_FILE:coman-hil>)
endforeach()
if(NOT HIL_SANITIZE)
    hil_script_test(python_package LABELS python TIMEOUT 150
        COMMAND bash ${python_folder}/package.sh ${CMAKE_CPACK_COMMAND})
    set_tests_properties(python_package PROPERTIES RESOURCE_LOCK install)
    hil_script_test(python_wheel LABELS python TIMEOUT 120
        COMMAND bash ${python_folder}/wheel.sh ${PROJECT_VERSION} $<TARGET_FILE:coman-hil>)
endif()
hil_script_test(python_pytest COMMAND ${python_folder}/pytest_example.sh LABELS python TIMEOUT 100)
