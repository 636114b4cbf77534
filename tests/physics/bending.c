/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Moments that bend the joints' sensors: of an arm that is held, by its weight; of one that swings,
 * beside a force-torque sensor in its joint that carries all of the last link.
 */
#include "base/vec3.h"

#include "tests/physics/near.h"
#include "tests/physics/toy_plant.h"

#define UPPER 2.0 /* kg, its center of mass 0.1 m ahead and 0.05 m aside */
#define LOWER 1.5 /* kg, 0.12 m ahead and 0.04 m down */
#define REACH 0.3 /* m between the joints */

static const double pitch[3] = {0.0, 1.0, 0.0}, yaw[3] = {0.0, 0.0, 1.0};

static void arm_init(struct toy_plant *arm, bool bending)
{
    static const double origin[3] = {0.0}, base[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0};
    static const double own[6] = {0.02, 1e-3, -2e-3, 0.03, 5e-4, 0.025};
    static const double upper[3] = {0.1, 0.05, 0.0}, lower[3] = {0.12, 0.0, -0.04};
    const double reach[3] = {REACH, 0.0, 0.0};
    struct robot_ft_sensor *ft = &arm->toy.ft[0];

    toy_plant_begin(arm, PLANT_RK4, 1000000);
    arm->config.bending = bending;
    toy_begin(&arm->toy, false, 1.0, origin, base);
    toy_add(&arm->toy, 0, JOINT_REVOLUTE, pitch, origin, UPPER, upper, own);
    toy_add(&arm->toy, 1, JOINT_REVOLUTE, yaw, reach, LOWER, lower, own);
    arm->toy.robot.nft = 1;
    *ft = (struct robot_ft_sensor){.name = "all", .frame = toy_add_frame(&arm->toy, 2, origin)};
    ft->distal = arm->toy.body[2].inertia;
    toy_plant_open(arm);
}

/* Held level, straight: the moments are those of the weights. Across y are x and -z, across z x
 * and y. */
TEST(weight_bends_what_is_held)
{
    static const double level[2] = {0.0, 0.0};
    struct toy_plant arm;
    const struct motor_sense *motor;

    arm_init(&arm, true);
    assert_ok(plant_reset(arm.plant, NULL, NULL, level));
    plant_clamp(arm.plant, true);
    assert_ok(plant_sample(arm.plant));
    motor = plant_sensors(arm.plant)->motor;
    assert_near(motor[0].bending_nm[0], 9.81 * UPPER * 0.05, 1e-12);
    assert_near(motor[0].bending_nm[1], 0.0, 1e-12);
    assert_near(motor[1].bending_nm[0], 0.0, 1e-12);
    assert_near(motor[1].bending_nm[1], -9.81 * LOWER * 0.12, 1e-12);
    arena_fini(&arm.arena);

    /* Nobody asked */
    arm_init(&arm, false);
    assert_ok(plant_reset(arm.plant, NULL, NULL, level));
    assert_ok(plant_sample(arm.plant));
    assert_near(plant_sensors(arm.plant)->motor[0].bending_nm[0], 0.0, 0.0);
    arena_fini(&arm.arena);
}

/* Thrown, and pushed from the middle on: at each moment the joint bears what a sensor in it feels,
 * with the other sign. */
TEST(joint_bears_what_a_sensor_in_it_feels)
{
    static const double start[2] = {0.4, -0.7};
    struct toy_plant arm;
    double *rates, most = 0.0;

    arm_init(&arm, true);
    assert_ok(plant_reset(arm.plant, NULL, NULL, start));
    rates = arm.state + 2;
    rates[0] = 6.0;
    rates[1] = -9.0;
    for (int k = 0; k < 300; k++) {
        const struct plant_sensors *sensors = plant_sensors(arm.plant);

        if (k == 150) {
            plant_set_push(arm.plant, 2, (const double[3]){4.0, -7.0, 5.0},
                           (const double[3]){0.6, 0.9, -0.5});
        }
        assert_ok(plant_step(arm.plant, 1));
        assert_ok(plant_sample(arm.plant));
        for (int i = 0; i < 2; i++) {
            assert_near(sensors->motor[1].bending_nm[i], -sensors->ft[0].torque_nm[i], 1e-10);
            most = fmax(most, fabs(sensors->motor[1].bending_nm[i]));
        }
    }
    assert_true(most > 1.0);
    arena_fini(&arm.arena);
}
