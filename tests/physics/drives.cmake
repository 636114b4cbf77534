# SPDX-License-Identifier: Apache-2.0
hil_test(drive_faults SOURCES physics/drive_faults.c physics/toy.c LIBS model LABELS physics)
hil_test(boards_drive SOURCES physics/boards_drive.c physics/toy.c LIBS boards model LABELS physics)
hil_test(current_loop SOURCES physics/current_loop.c physics/toy.c LIBS model LABELS physics)
hil_test(identify SOURCES physics/identify.c LIBS sim LABELS physics)
hil_test(drive_effects SOURCES physics/drive_effects.c physics/toy.c LIBS model LABELS physics)
hil_test(gear_friction SOURCES physics/gear_friction.c physics/toy.c LIBS model LABELS physics)
hil_test(supply_bus SOURCES physics/supply_bus.c physics/toy.c LIBS model LABELS physics)
hil_test(hydraulic SOURCES physics/hydraulic.c physics/oil_rig.c physics/toy.c LIBS model
         LABELS physics)
hil_test(hydraulic_faults SOURCES physics/hydraulic_faults.c physics/oil_rig.c physics/toy.c
         LIBS model LABELS physics)
hil_test(passive_drives SOURCES physics/passive_drives.c physics/toy.c LIBS model LABELS physics)
