# SPDX-License-Identifier: Apache-2.0
# Overload and loss: what rt/loop.h, rt/recording/recorder.h and canbus promise then.
hil_script_test(service_overload COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/service/overload.py
                LABELS service TIMEOUT 200 SERIAL)
# The address space of a guest process has no room for the shadow memory of the sanitizers.
if(NOT HIL_SANITIZE)
    hil_script_test(service_overload_vcan LABELS service TIMEOUT 200
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/run.sh -t 180
                /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/overload_vcan.py)
endif()
