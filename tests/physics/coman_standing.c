/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN on its two foot meshes on Simbody's contact: stands still in its crouch, the ground carries
 * its weight, the force-torque sensors agree, and the energy balance closes, which says that the
 * step is short enough for the contact's friction.
 */
#include "model/plant.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "model/spatial.h"
#include "tests/physics/near.h"

enum { BODIES = 32, COORDINATES = 64, FEET = 2 };

static const char *const foot_names[FEET] = {"RFoot", "LFoot"};
static const char *const sensor_names[FEET] = {"r_leg_ft", "l_leg_ft"};

struct standing {
    struct arena arena;
    const struct robot *robot;
    const struct robot_pose *pose;
    struct dynamics dynamics;
    struct contact_world *contact;
    struct plant *plant;
    int foot[FEET];
    double reference[COORDINATES]; /* of each motor, rad */
    double holding[COORDINATES];   /* voltage that holds the static torque, V */
};

/* Feet on a half-space; the layers of the robot's rig. */
static void make_contact(struct standing *standing)
{
    static const char *const meshes[FEET] = {"/config/meshes/coman-foot-right.obj",
                                             "/config/meshes/coman-foot-left.obj"};
    const struct contact_material layer = {.young_pa = 1e5,
                                           .thickness_m = 2e-4,
                                           .dissipation_s_per_m = 10.0,
                                           .static_friction = 1.1,
                                           .dynamic_friction = 0.9};
    struct contact_surface surface[1 + FEET] = {
        {.name = "ground", .body = -1, .shape = CONTACT_HALF_SPACE, .material = layer}};
    const struct contact_pair pair[FEET] = {{0, 1}, {0, 2}};
    const struct contact_config config = {.nbody = FEET,
                                          .nsurface = 1 + FEET,
                                          .surface = surface,
                                          .npair = FEET,
                                          .pair = pair,
                                          .transition_velocity_m_s = 0.1};
    struct error error = {0};

    surface[0].material.thickness_m = 1e-3;
    mat3_identity(surface[0].rotation);
    for (int f = 0; f < FEET; f++) {
        char path[512] = HIL_SOURCE_DIR;

        surface[1 + f] = (struct contact_surface){
            .name = foot_names[f], .body = f, .shape = CONTACT_MESH, .material = layer};
        mat3_identity(surface[1 + f].rotation);
        strncat(path, meshes[f], sizeof path - strlen(path) - 1);
        assert_int_equal(mesh_read_obj(path, &standing->arena, &surface[1 + f].mesh, &error),
                         ERROR_NONE);
        standing->foot[f] = robot_find_body(standing->robot, foot_names[f]);
    }
    assert_int_equal(contact_simbody_create(&config, &standing->contact, &error), ERROR_NONE);
}

/* Joint torques that hold the pose with half of the weight on each foot, below the center of mass
 * in x; from them the springs' deflections and the voltages. The motors start there. */
static void preload(struct standing *standing)
{
    const struct robot *robot = standing->robot;
    const struct body_motion *motion = plant_motion(standing->plant);
    const double zero[COORDINATES] = {0};
    double weight = -robot->total_mass * robot->gravity[2], centre[3], momentum[3];
    double f[COORDINATES], *state;
    struct wrench ext[BODIES] = {0};
    size_t count, drive;

    state = plant_state(standing->plant, &count);
    plant_centre_of_mass(standing->plant, centre, momentum);
    for (int k = 0; k < FEET; k++) {
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

static void standing_init(struct standing *standing)
{
    struct plant_config config = {.integrator = PLANT_RK4,
                                  .substep_ns = 250000,
                                  .supply_v = 48.0,
                                  .account_energy = true,
                                  .dynamics = &standing->dynamics,
                                  .contact_body = standing->foot,
                                  .ncontact = FEET};
    struct error error = {0};
    int pose;

    assert_int_equal(arena_init(&standing->arena, 64 << 20, &error), ERROR_NONE);
    assert_int_equal(robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", NULL, &standing->arena,
                                &standing->robot, &error),
                     ERROR_NONE);
    make_contact(standing);
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
    preload(standing);
}

static void standing_fini(struct standing *standing)
{
    standing->contact->ops->destroy(standing->contact);
    arena_fini(&standing->arena);
}

/* A proportional loop on the motor angles, as a controller would close it, once a millisecond. */
static void hold_still(struct standing *standing, int milliseconds)
{
    struct plant_command *command = plant_command(standing->plant);
    const struct motor_sense *motor = plant_sensors(standing->plant)->motor;

    for (int k = 0; k < milliseconds; k++) {
        for (size_t j = 0; j < standing->robot->njoint; j++) {
            command->motor[j].bridge_on = true;
            command->motor[j].voltage_v =
                standing->holding[j] + 200.0 * (standing->reference[j] - motor[j].qm);
        }
        assert_int_equal(plant_step(standing->plant, 4), ERROR_NONE);
        assert_int_equal(plant_sample(standing->plant), ERROR_NONE);
    }
}

static void ground_carries_the_weight_of_the_standing_robot(void **state)
{
    static struct standing standing;
    const struct contact_wrench *wrench;
    const struct plant_sensors *sensors;
    struct plant_energy energy;
    double weight, carried = 0.0, felt = 0.0, expected, centre[3], momentum[3], start[3];

    (void)state;
    standing_init(&standing);
    plant_centre_of_mass(standing.plant, start, momentum);
    hold_still(&standing, 800);
    weight = -standing.robot->total_mass * standing.robot->gravity[2];
    expected = weight;
    wrench = plant_contact_wrenches(standing.plant);
    sensors = plant_sensors(standing.plant);
    for (int f = 0; f < FEET; f++) {
        carried += wrench[f].force[2];
        for (size_t s = 0; s < standing.robot->nft; s++) {
            if (strcmp(standing.robot->ft[s].name, sensor_names[f]) == 0) {
                felt += sensors->ft[s].force_n[2];
                expected += standing.robot->ft[s].distal.mass * standing.robot->gravity[2];
            }
        }
    }
    plant_centre_of_mass(standing.plant, centre, momentum);
    assert_int_equal(plant_energy(standing.plant, &energy), ERROR_NONE);
    print_message(
        "# ground %.3f N of %.3f, sensors %.3f N of %.3f; center of mass moved %.4f m and "
        "has %.1e kg m/s; balance %.1e J of %.1f J\n",
        carried, weight, felt, expected, centre[0] - start[0], sqrt(vec3_dot(momentum, momentum)),
        energy.balance, energy.joule_heat);
    assert_near(carried, weight, 1e-3 * weight);
    assert_near(felt, expected, 1e-3 * weight);
    assert_near(centre[0], start[0], 0.02);
    assert_near(centre[2], start[2], 0.01);
    assert_near(energy.balance, 0.0, 1e-3); /* a step too long for the friction loses joules */
    standing_fini(&standing);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ground_carries_the_weight_of_the_standing_robot),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
