/* SPDX-License-Identifier: Apache-2.0 */
/* The link behind a cylinder of tests/physics/oil_rig.h. */
#include "tests/physics/oil_rig.h"

struct robot_hydraulic hyq_cylinder(void)
{
    return (struct robot_hydraulic){.present = true,
                                    .A1 = 0.25 * M_PI * 0.016 * 0.016,
                                    .A2 = 0.25 * M_PI * (0.016 * 0.016 - 0.010 * 0.010),
                                    .stroke = 0.08,
                                    .dead = 2e-6,
                                    .base = 0.32,
                                    .arm = 0.045,
                                    .offset = 0.5 * M_PI,
                                    .closed = sqrt(0.32 * 0.32 + 0.045 * 0.045) - 0.04,
                                    .valve_w = 2.0 * M_PI * 250.0,
                                    .valve_damping = 0.8,
                                    .valve_v = 10.0,
                                    .K = 7.5e-3 / 60.0 / sqrt(35.0 * BAR),
                                    .beta = 1.4e9,
                                    .coulomb_speed = 1e-3};
}

void oil_rig_begin(struct toy_plant *rig, struct robot_hydraulic cylinder,
                   struct robot_hydraulic_supply supply)
{
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double I[6] = {0.3, 0.0, 0.0, 0.3, 0.0, 0.3};
    struct robot_joint *joint;

    toy_plant_begin(rig, PLANT_IMPLICIT, MS);
    rig->config.rtol = rig->config.atol = 1e-10;
    toy_begin(&rig->toy, false, 1.0, none, I);
    joint = &rig->toy.joint[toy_add(&rig->toy, 0, JOINT_REVOLUTE, z, none, 5.0, none, I)];
    joint->hydraulic = cylinder;
    joint->lower = -0.85;
    joint->upper = 0.85;
    rig->toy.robot.hydraulic_supply = supply;
}

void oil_rig_start(struct toy_plant *rig, double q)
{
    double angle[TOY_BODIES];

    toy_plant_open(rig);
    for (size_t j = 0; j < rig->toy.robot.njoint; j++) {
        rig->motor[j].bridge_on = true;
        angle[j] = q;
    }
    assert_ok(plant_reset(rig->plant, NULL, NULL, angle));
}

void step_oil(struct toy_plant *rig, size_t steps)
{
    assert_ok(plant_step(rig->plant, steps));
}

struct robot_hydraulic_supply constant_supply(void)
{
    return (struct robot_hydraulic_supply){.pressure = 160.0 * BAR};
}

struct robot_hydraulic real_cylinder(void)
{
    struct robot_hydraulic c = hyq_cylinder();

    c.lap = 0.02;
    c.leakage = 1e-13;
    c.viscous = 100.0;
    c.coulomb = 30.0;
    c.coulomb_speed = 0.01;
    return c;
}

struct robot_hydraulic_supply real_supply(void)
{
    return (struct robot_hydraulic_supply){.pressure = 160.0 * BAR,
                                           .back = 2.0 * BAR,
                                           .pump = 5e-5,
                                           .accumulator = 2e-4,
                                           .precharge = 90.0 * BAR,
                                           .line = 2e-5,
                                           .relief = 160.0 * BAR,
                                           .relief_flow = 1e-9};
}
