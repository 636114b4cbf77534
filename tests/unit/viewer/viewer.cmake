# SPDX-License-Identifier: Apache-2.0
foreach(name connection hello_scene history message recorded http_request state_message stl_file
             websocket)
    hil_test(viewer_${name} SOURCES unit/viewer/${name}.c LIBS viewer LABELS unit)
endforeach()
