/* SPDX-License-Identifier: Apache-2.0 */
/* The robot and the scene of a rig file on native contact, without boards. Aborts the
 * test on any error. */
#ifndef TESTS_PHYSICS_RIG_SCENE_H
#define TESTS_PHYSICS_RIG_SCENE_H

#include "model/settle.h"
#include "model/spatial.h"
#include "rig/rig.h"
#include "tests/test.h"

enum { RIG_SCENE_JOINTS = 40 };

struct rig_scene {
    struct arena arena;
    const struct rig *rig;
    const struct robot *robot;
    struct dynamics dynamics;
    struct contact_world *contact;
    struct plant *plant;
    size_t steps; /* substeps in a millisecond */
    /* Of rig_scene_hold: motor angles (rad) and the voltages that hold them (V) */
    double reference[RIG_SCENE_JOINTS], holding[RIG_SCENE_JOINTS];
};

/* What a test may choose. */
struct rig_scene_choice {
    const char *file; /* of config/rigs */
    enum plant_integrator integrator;
    int64_t substep_ns;             /* a part of a millisecond */
    double tolerance;               /* of dopri5 */
    double transition_velocity_m_s; /* 0 = the rig's */
    bool regularized;               /* friction, whatever the rig's */
    double slope_rad;               /* of the ground, down to +y: by gravity that leans */
    /* What is below a force-torque sensor that the robot's file lets nothing hang from */
    const struct robot_inertia *below;
};

static inline void rig_scene_hang_below(struct rig_scene *scene, const struct robot_inertia *below)
{
    struct robot *robot = arena_alloc(&scene->arena, 1, sizeof *robot);
    struct robot_ft_sensor *ft = arena_alloc(&scene->arena, scene->robot->nft, sizeof *ft);

    assert_non_null(robot);
    assert_non_null(ft);
    *robot = *scene->robot;
    robot->ft = ft;
    for (size_t f = 0; f < robot->nft; f++) {
        ft[f] = scene->robot->ft[f];
        if (ft[f].distal.mass == 0.0) {
            ft[f].distal = *below;
        }
    }
    scene->robot = robot;
}

static inline void rig_scene_lean(struct rig_scene *scene, double slope_rad)
{
    struct robot *robot = arena_alloc(&scene->arena, 1, sizeof *robot);

    assert_non_null(robot);
    *robot = *scene->robot;
    robot->gravity[1] = -robot->gravity[2] * sin(slope_rad);
    robot->gravity[2] = robot->gravity[2] * cos(slope_rad);
    scene->robot = robot;
}

static inline void rig_scene_reset(struct rig_scene *scene)
{
    const struct rig *rig = scene->rig;

    assert_ok(plant_reset(scene->plant, rig->base_position, rig->base_quaternion, rig->joint));
}

static inline void rig_scene_init(struct rig_scene *scene, const struct rig_scene_choice *choice)
{
    struct plant_config config = {.integrator = choice->integrator,
                                  .substep_ns = choice->substep_ns,
                                  .rtol = choice->tolerance,
                                  .atol = choice->tolerance,
                                  .account_energy = true};
    struct contact_config contact;
    struct error error = {0};
    char path[512];

    assert_ok(arena_init(&scene->arena, (size_t)128 << 20, &error));
    snprintf(path, sizeof path, "%s/config/rigs/%s", HIL_SOURCE_DIR, choice->file);
    assert_no_error(rig_load(path, &scene->arena, &scene->rig, &error), error.text);
    scene->robot = scene->rig->robot;
    assert_true(scene->robot->njoint <= RIG_SCENE_JOINTS);
    if (choice->below) {
        rig_scene_hang_below(scene, choice->below);
    }
    if (choice->slope_rad != 0.0) {
        rig_scene_lean(scene, choice->slope_rad);
    }
    contact = scene->rig->contact;
    if (choice->transition_velocity_m_s > 0.0) {
        contact.transition_velocity_m_s = choice->transition_velocity_m_s;
    }
    if (choice->regularized) {
        contact.friction = CONTACT_FRICTION_REGULARIZED;
    }
    assert_ok(contact_native_create(&contact, &scene->arena, &scene->contact, &error));
    assert_ok(dynamics_generic(scene->robot, &scene->arena, &scene->dynamics, &error));
    config.robot = scene->robot;
    config.dynamics = &scene->dynamics;
    config.free = scene->rig->free;
    config.nfree = scene->rig->nfree;
    config.contact = scene->contact;
    config.contact_body = scene->rig->contact_body;
    config.ncontact = contact.nbody;
    config.supply_v = scene->rig->supply_v;
    config.supply_ohm = scene->rig->supply_ohm;
    config.bus = scene->rig->supply_bus;
    assert_no_error(plant_create(&config, &scene->arena, &scene->plant, &error), error.text);
    scene->steps = (size_t)(1000000 / choice->substep_ns);
    rig_scene_reset(scene);
}

static inline void rig_scene_fini(struct rig_scene *scene)
{
    arena_fini(&scene->arena);
}

/* Into equilibrium, which rig_scene_hold then keeps. */
static inline struct settled rig_scene_settle(struct rig_scene *scene)
{
    struct settled settled;
    struct error error = {0};

    assert_no_error(plant_settle(scene->plant, &scene->arena, &settled, &error), error.text);
    for (size_t j = 0; j < scene->robot->njoint; j++) {
        scene->reference[j] = plant_sensors(scene->plant)->motor[j].qm;
        scene->holding[j] = plant_command(scene->plant)->motor[j].voltage_v;
    }
    return settled;
}

/* One millisecond of a proportional loop on the motor angles about the holding voltages. */
static inline void rig_scene_hold(struct rig_scene *scene)
{
    struct plant_command *command = plant_command(scene->plant);
    const struct motor_sense *motor = plant_sensors(scene->plant)->motor;

    for (size_t j = 0; j < scene->robot->njoint; j++) {
        command->motor[j].bridge_on = true;
        command->motor[j].voltage_v =
            scene->holding[j] + 200.0 * (scene->reference[j] - motor[j].qm);
    }
    assert_ok(plant_step(scene->plant, scene->steps));
    assert_ok(plant_sample(scene->plant));
}

/* Contact motion of a body of the robot or, from robot->nbody on, a free one. */
static inline const struct contact_wrench *rig_scene_wrench(const struct rig_scene *scene, int body)
{
    for (size_t c = 0; c < scene->rig->contact.nbody; c++) {
        if (scene->rig->contact_body[c] == body) {
            return &plant_contact_wrenches(scene->plant)[c];
        }
    }
    fail_msg("body %d has no contact", body);
    return NULL;
}

/* Upward force on both feet. */
static inline double rig_scene_feet(const struct rig_scene *scene)
{
    return rig_scene_wrench(scene, robot_find_body(scene->robot, "RFoot"))->force[2] +
           rig_scene_wrench(scene, robot_find_body(scene->robot, "LFoot"))->force[2];
}

#endif
