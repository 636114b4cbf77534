# SPDX-License-Identifier: Apache-2.0
foreach(name candump dbc fault_port frame gateway gateway_lockstep interface link local local_save
        local_wire lockstep paced port slcan socketcand)
    hil_test(canbus_${name} SOURCES unit/canbus/${name}.c LIBS canbus LABELS unit)
endforeach()
foreach(name bits conformance errors wire)
    hil_test(canbus_wire_${name} SOURCES unit/canbus/wire/${name}.c LIBS canbus LABELS unit)
endforeach()
hil_test(canbus_socketcan_send SOURCES unit/canbus/socketcan_send.c
         LIBS canbus -Wl,--wrap=sendmmsg,--wrap=recvmmsg,--wrap=clock_gettime LABELS unit)
