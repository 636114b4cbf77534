/* SPDX-License-Identifier: Apache-2.0 */
/* COMAN on its two foot meshes on Simbody's contact, in its crouch, held by its motors. Include
 * after tests/test.h; aborts the test on any error. */
#ifndef TESTS_PHYSICS_STANDING_H
#define TESTS_PHYSICS_STANDING_H

#include "model/plant.h"
#include "model/spatial.h"
#include "tests/test.h"

#include <string.h>

enum { STANDING_BODIES = 32, STANDING_COORDINATES = 64, STANDING_FEET = 2 };

static const char *const standing_foot_names[STANDING_FEET] = {"RFoot", "LFoot"};

struct standing {
    struct arena arena;
    const struct robot *robot;
    const struct robot_pose *pose;
    struct dynamics dynamics;
    struct contact_world *contact;
    struct plant *plant;
    int foot[STANDING_FEET];
    double reference[STANDING_COORDINATES]; /* of each motor, rad */
    double holding[STANDING_COORDINATES];   /* voltage that holds the static torque, V */
    size_t steps;                           /* substeps in a millisecond */
};

/* What a test may choose; the rest is the robot's rig. */
struct standing_choice {
    enum plant_integrator integrator;
    int64_t substep_ns; /* a part of a millisecond */
    double transition_velocity_m_s;
    double tolerance; /* of dopri5 */
};

/* Feet on a half-space; the layers of the robot's rig. */
static inline void standing_make_contact(struct standing *standing, double transition_velocity_m_s)
{
    static const char *const meshes[STANDING_FEET] = {"/config/meshes/coman-foot-right.obj",
                                                      "/config/meshes/coman-foot-left.obj"};
    const struct contact_material layer = {.young_pa = 1e5,
                                           .thickness_m = 2e-4,
                                           .dissipation_s_per_m = 10.0,
                                           .static_friction = 1.1,
                                           .dynamic_friction = 0.9};
    struct contact_surface surface[1 + STANDING_FEET] = {
        {.name = "ground", .body = -1, .shape = CONTACT_HALF_SPACE, .material = layer}};
    const struct contact_pair pair[STANDING_FEET] = {{.a = 0, .b = 1}, {.a = 0, .b = 2}};
    const struct contact_config config = {.nbody = STANDING_FEET,
                                          .nsurface = 1 + STANDING_FEET,
                                          .surface = surface,
                                          .npair = STANDING_FEET,
                                          .pair = pair,
                                          .transition_velocity_m_s = transition_velocity_m_s};
    struct error error = {0};

    surface[0].material.thickness_m = 1e-3;
    mat3_identity(surface[0].rotation);
    for (int f = 0; f < STANDING_FEET; f++) {
        char path[512] = HIL_SOURCE_DIR;

        surface[1 + f] = (struct contact_surface){
            .name = standing_foot_names[f], .body = f, .shape = CONTACT_MESH, .material = layer};
        mat3_identity(surface[1 + f].rotation);
        strncat(path, meshes[f], sizeof path - strlen(path) - 1);
        assert_int_equal(mesh_read_obj(path, &standing->arena, &surface[1 + f].mesh, &error),
                         ERROR_NONE);
        standing->foot[f] = robot_find_body(standing->robot, standing_foot_names[f]);
    }
    assert_int_equal(contact_simbody_create(&config, &standing->contact, &error), ERROR_NONE);
}

/* Joint torques that hold the pose with half of the weight on each foot, below the center of mass
 * in x; from them the springs' deflections and the voltages. The motors start there. */
static inline void standing_preload(struct standing *standing)
{
    const struct robot *robot = standing->robot;
    const struct body_motion *motion = plant_motion(standing->plant);
    const double zero[STANDING_COORDINATES] = {0};
    double weight = -robot->total_mass * robot->gravity[2], centre[3], momentum[3];
    double f[STANDING_COORDINATES], *state;
    struct wrench ext[STANDING_BODIES] = {0};
    size_t count, drive;

    state = plant_state(standing->plant, &count);
    plant_center_of_mass(standing->plant, centre, momentum);
    for (int k = 0; k < STANDING_FEET; k++) {
        const struct body_motion *foot = &motion[standing->foot[k]];
        const double force[3] = {0.0, 0.0, 0.5 * weight};
        const double arm[3] = {centre[0] - foot->p[0], 0.0, -foot->p[2]};
        double moment[3];

        vec3_cross(arm, force, moment);
        mat3_apply_transposed(foot->R, force, ext[standing->foot[k]].force);
        mat3_apply_transposed(foot->R, moment, ext[standing->foot[k]].moment);
    }
    standing->dynamics.ops->inverse(&standing->dynamics, state, zero, zero, ext, f);
    drive = robot->nq + robot->nv;
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_sea *sea = &robot->joint[j].sea;
        double tau = f[6 + j];

        standing->reference[j] = standing->pose->joint[j] + tau / sea->Ks;
        standing->holding[j] = sea->R * tau / sea->Kt;
        state[drive + 3 * j] = standing->reference[j];
        state[drive + 3 * j + 2] = tau / sea->Kt;
    }
    assert_int_equal(plant_restart_energy(standing->plant), ERROR_NONE);
}

static inline void standing_init(struct standing *standing, const struct standing_choice *choice)
{
    struct plant_config config = {.integrator = choice->integrator,
                                  .substep_ns = choice->substep_ns,
                                  .rtol = choice->tolerance,
                                  .atol = choice->tolerance,
                                  .supply_v = 48.0,
                                  .account_energy = true,
                                  .dynamics = &standing->dynamics,
                                  .contact_body = standing->foot,
                                  .ncontact = STANDING_FEET};
    struct error error = {0};
    int pose;

    standing->steps = (size_t)(1000000 / choice->substep_ns);
    assert_int_equal(arena_init(&standing->arena, 64 << 20, &error), ERROR_NONE);
    assert_int_equal(robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", NULL, &standing->arena,
                                &standing->robot, &error),
                     ERROR_NONE);
    standing_make_contact(standing, choice->transition_velocity_m_s);
    assert_int_equal(
        dynamics_generic(standing->robot, &standing->arena, &standing->dynamics, &error),
        ERROR_NONE);
    config.robot = standing->robot;
    config.contact = standing->contact;
    assert_int_equal(plant_create(&config, &standing->arena, &standing->plant, &error), ERROR_NONE);
    pose = robot_find_pose(standing->robot, "crouch_home");
    assert_true(pose >= 0);
    standing->pose = &standing->robot->pose[pose];
    assert_int_equal(plant_reset(standing->plant, standing->pose->base_position,
                                 standing->pose->base_quaternion, standing->pose->joint),
                     ERROR_NONE);
    standing_preload(standing);
}

static inline void standing_fini(struct standing *standing)
{
    standing->contact->ops->destroy(standing->contact);
    arena_fini(&standing->arena);
}

/* A proportional loop on the motor angles, as a controller would close it, once a millisecond. */
static inline void standing_hold(struct standing *standing, int milliseconds)
{
    struct plant_command *command = plant_command(standing->plant);
    const struct motor_sense *motor = plant_sensors(standing->plant)->motor;

    for (int k = 0; k < milliseconds; k++) {
        for (size_t j = 0; j < standing->robot->njoint; j++) {
            command->motor[j].bridge_on = true;
            command->motor[j].voltage_v =
                standing->holding[j] + 200.0 * (standing->reference[j] - motor[j].qm);
        }
        assert_int_equal(plant_step(standing->plant, standing->steps), ERROR_NONE);
        assert_int_equal(plant_sample(standing->plant), ERROR_NONE);
    }
}

#endif
