/* SPDX-License-Identifier: Apache-2.0 */
/* A link about a vertical axis behind a cylinder of HyQ's leg, for tests of hydraulic joints. */
#ifndef TESTS_PHYSICS_OIL_RIG_H
#define TESTS_PHYSICS_OIL_RIG_H

#include "model/hydraulics/hydraulic.h"
#include "tests/physics/toy_plant.h"

#define BAR 1e5

enum { MS = 1000000, AT_CYLINDER = 2, AT_P1 = AT_CYLINDER + HYDRAULIC_P1, AT_P2 };
enum { AT_SUPPLY = AT_CYLINDER + HYDRAULIC_STATE };

/* A cylinder between pins 0.32 m and 0.045 m from the joint, half out at q = 0, and a valve of
 * 7.5 l/min at 70 bar that opens at 10 V; the real one has lap, leakage and friction. */
struct robot_hydraulic hyq_cylinder(void);
struct robot_hydraulic real_cylinder(void);

/* 160 bar, whatever is drawn; or of a pump of 3 l/min with an accumulator of 0.2 l. */
struct robot_hydraulic_supply constant_supply(void);
struct robot_hydraulic_supply real_supply(void);

/* Sets up the link, whose numbers may be changed, and others added, until all start from angle q.
 * The owner frees the arena. */
void oil_rig_begin(struct toy_plant *rig, struct robot_hydraulic cylinder,
                   struct robot_hydraulic_supply supply);
void oil_rig_start(struct toy_plant *rig, double q);

void step_oil(struct toy_plant *rig, size_t steps);

#endif
