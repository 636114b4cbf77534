# SPDX-License-Identifier: Apache-2.0
foreach(name buses checkpoint contact_arrows energy_and_depth external external_runs interfaces
             limb_host loop_quiet published robot_requests robot_requests_restore
             robot_requests_threads robot_requests_timed stimulus task_trouble)
    hil_test(sim_${name} SOURCES unit/sim/${name}.c LIBS sim LABELS unit)
endforeach()
hil_test(sim_mechanics_events SOURCES unit/sim/mechanics_events.c physics/toy.c
         LIBS sim LABELS unit)
