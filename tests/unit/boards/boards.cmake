# SPDX-License-Identifier: Apache-2.0
foreach(name board_faults board_faults_frames boards can_state event_text fault_parse faults heat
        inertial messages motor_control protocols sensing settings ticks)
    hil_test(boards_${name} SOURCES unit/boards/${name}.c LIBS boards LABELS unit)
endforeach()
foreach(name host_replay inertial_board loader motor_commands motor_history motor_laws motor_modes
        motor_telemetry motor_watch strain_board table)
    hil_test(boards_icub_${name} SOURCES unit/boards/icub/${name}.c LIBS boards LABELS unit)
endforeach()
hil_test(boards_foc SOURCES unit/boards/foc/board.c LIBS boards LABELS unit)
hil_test(boards_foc_history SOURCES unit/boards/foc/history.c LIBS boards LABELS unit)
foreach(name bus ft_board inertial_board motor_board motor_history node)
    hil_test(boards_compact_${name} SOURCES unit/boards/compact/${name}.c LIBS boards LABELS unit)
endforeach()
foreach(name block lss modes nmt pdo sdo state table)
    hil_test(boards_cia402_${name} SOURCES unit/boards/cia402/${name}.c LIBS boards LABELS unit)
endforeach()
foreach(name board load)
    hil_test(boards_described_${name} SOURCES unit/boards/described/${name}.c LIBS boards
             LABELS unit)
endforeach()
