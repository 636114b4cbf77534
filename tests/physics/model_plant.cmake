# SPDX-License-Identifier: Apache-2.0
# Drives, integrator and plant.
hil_test(actuator_motion SOURCES physics/actuator.c LIBS model LABELS physics)
hil_test(pendulum SOURCES physics/pendulum.c physics/toy.c LIBS model LABELS physics)
hil_test(plant SOURCES physics/plant.c physics/toy.c LIBS model LABELS physics)
hil_test(plant_contact SOURCES physics/plant_contact.c physics/toy.c LIBS model LABELS physics)
hil_test(plant_energy SOURCES physics/plant_energy.c physics/toy.c LIBS model LABELS physics)
hil_test(stops SOURCES physics/stops.c physics/toy.c LIBS model LABELS physics)
hil_test(couplings SOURCES physics/couplings.c physics/toy.c LIBS model LABELS physics)
hil_test(passive SOURCES physics/passive.c physics/toy.c LIBS model LABELS physics)
hil_test(bending SOURCES physics/bending.c physics/toy.c LIBS model LABELS physics)
hil_test(plant_sensors SOURCES physics/plant_sensors.c physics/toy.c LIBS model LABELS physics)
hil_test(plant_rt SOURCES physics/plant_rt.c physics/counting_malloc.c physics/toy.c LIBS model
         -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=free
         LABELS physics)
hil_test(self_pairs SOURCES physics/self_pairs.c LIBS rig TIMEOUT 120 LABELS physics)
hil_test(falls SOURCES physics/falls.c LIBS rig TIMEOUT 1500 LABELS physics)
