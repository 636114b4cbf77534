# SPDX-License-Identifier: Apache-2.0
# Static equilibrium, and the laws of mechanics on runs of the whole robot.
hil_test(settle SOURCES physics/settle.c physics/toy.c LIBS model LABELS physics)
hil_test(settle_rig SOURCES physics/settle_rig.c LIBS sim LABELS physics)
hil_test(drive_effects_rig SOURCES physics/drive_effects_rig.c LIBS sim LABELS physics)
hil_test(sticking SOURCES physics/sticking.c LIBS sim TIMEOUT 180 LABELS physics)
hil_test(terrain SOURCES physics/terrain.c LIBS sim TIMEOUT 120 LABELS physics)
hil_test(whole_robot SOURCES physics/whole_robot.c LIBS sim TIMEOUT 120 LABELS physics)
hil_test(whole_robot_implicit SOURCES physics/whole_robot_implicit.c LIBS sim TIMEOUT 120
         LABELS physics)
hil_test(implicit_sensors SOURCES physics/implicit_sensors.c LIBS sim TIMEOUT 120 LABELS physics)
hil_test(contact_admissible SOURCES physics/contact_admissible.c LIBS sim TIMEOUT 120
    LABELS physics)
hil_test(walk SOURCES physics/walk.c LIBS sim TIMEOUT 120 LABELS physics)
hil_test(walk_commands SOURCES physics/walk_commands.c LIBS sim TIMEOUT 120 LABELS physics)
