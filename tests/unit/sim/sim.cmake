# SPDX-License-Identifier: Apache-2.0
foreach(name buses checkpoint external external_runs inertial_board interfaces limb_host
             loop_quiet published robot_steering robot_steering_restore robot_steering_threads
             robot_steering_timed task_trouble)
    hil_test(sim_${name} SOURCES unit/sim/${name}.c LIBS sim LABELS unit)
endforeach()
hil_test(sim_robot_dynamics SOURCES unit/sim/robot_dynamics.c LIBS symbolic_evaluate sim
         LABELS unit)
hil_test(sim_watch SOURCES unit/sim/watch.c physics/toy.c LIBS sim LABELS unit)
