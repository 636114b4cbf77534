/* SPDX-License-Identifier: Apache-2.0 */
/* The whole COMAN as read from its file, through the plant: free fall, momentum, center of mass. */
#include "model/plant.h"

#include <math.h>
#include <string.h>

#include "model/spatial.h"
#include "tests/physics/near.h"
#include "tests/test.h"

enum { BODIES = 32, COORDINATES = 64 };

struct coman {
    struct arena arena;
    const struct robot *robot;
    struct robot weightless;
    struct dynamics dynamics;
    struct plant *plant;
    double *state;
    uint64_t random;
};

/* The robot of config/robots, with or without gravity, in its crouch 1 m up. */
static void coman_init(struct coman *coman, bool gravity)
{
    struct error error = {0};
    struct plant_config config = {.integrator = PLANT_RK4,
                                  .substep_ns = 100000,
                                  .supply_v = 48.0,
                                  .account_energy = true,
                                  .dynamics = &coman->dynamics};
    const double position[3] = {0.2, -0.1, 1.0}, quaternion[4] = {0.98, 0.1, -0.15, 0.05};
    const char *path = HIL_SOURCE_DIR "/config/robots/coman.yaml";
    size_t count;
    int pose;

    assert_int_equal(arena_init(&coman->arena, 64 << 20, &error), ERROR_NONE);
    if (robot_load(path, NULL, &coman->arena, &coman->robot, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    coman->weightless = *coman->robot;
    memset(coman->weightless.gravity, 0, sizeof coman->weightless.gravity);
    config.robot = gravity ? coman->robot : &coman->weightless;
    assert_int_equal(dynamics_generic(config.robot, &coman->arena, &coman->dynamics, &error),
                     ERROR_NONE);
    assert_int_equal(plant_create(&config, &coman->arena, &coman->plant, &error), ERROR_NONE);
    coman->state = plant_state(coman->plant, &count);
    pose = robot_find_pose(coman->robot, "crouch_home");
    assert_true(pose >= 0);
    assert_int_equal(
        plant_reset(coman->plant, position, quaternion, coman->robot->pose[pose].joint),
        ERROR_NONE);
    coman->random = 88172645463325252u;
}

static void coman_fini(struct coman *coman)
{
    arena_fini(&coman->arena);
}

/* Uniform in [-1, 1), the same on every run. */
static double coman_random(struct coman *coman)
{
    coman->random ^= coman->random << 13;
    coman->random ^= coman->random >> 7;
    coman->random ^= coman->random << 17;
    return (double)(int64_t)coman->random / 9223372036854775808.0;
}

TEST(coman_has_the_papers_structure)
{
    static struct coman coman;
    size_t count;

    coman_init(&coman, true);
    assert_int_equal(coman.robot->nbody, 24);
    assert_int_equal(coman.robot->nv, 29);
    assert_near(coman.robot->total_mass, 28.3574, 1e-4);
    plant_state(coman.plant, &count);
    assert_true(count >= 30 + 29 + 3 * 23);
    coman_fini(&coman);
}

/* Springs relaxed, nothing touched: the whole falls as one. */
TEST(free_fall_moves_no_joint)
{
    static struct coman coman;
    double tau[BODIES] = {0}, vdot[COORDINATES], before[3], after[3], momentum[3], R[9], a[3];
    const double *g;

    coman_init(&coman, true);
    g = coman.robot->gravity;
    coman.dynamics.ops->forward(&coman.dynamics, coman.state, coman.state + coman.robot->nq, tau,
                                NULL, vdot);
    mat3_from_quaternion(coman.state + 3, R);
    mat3_apply(R, vdot, a);
    for (int i = 0; i < 3; i++) {
        assert_near(a[i], g[i], 1e-11);
        assert_near(vdot[3 + i], 0.0, 1e-10);
    }
    for (size_t j = 0; j < coman.robot->njoint; j++) {
        assert_near(vdot[6 + j], 0.0, 1e-9);
    }

    /* 0.3 s through the plant: the center of mass is where Galilei has it, no joint has moved */
    plant_center_of_mass(coman.plant, before, momentum);
    assert_int_equal(plant_step(coman.plant, 3000), ERROR_NONE);
    plant_center_of_mass(coman.plant, after, momentum);
    assert_int_equal(plant_sample(coman.plant), ERROR_NONE);
    for (int i = 0; i < 3; i++) {
        assert_near(after[i] - before[i], 0.5 * g[i] * 0.3 * 0.3, 1e-12);
        assert_near(momentum[i], coman.robot->total_mass * g[i] * 0.3, 1e-10);
        assert_near(plant_sensors(coman.plant)->imu.accel_m_s2[i], 0.0, 1e-9);
    }
    for (size_t f = 0; f < coman.robot->nft; f++) {
        for (int i = 0; i < 3; i++) {
            assert_near(plant_sensors(coman.plant)->ft[f].force_n[i], 0.0, 1e-9);
            assert_near(plant_sensors(coman.plant)->ft[f].torque_nm[i], 0.0, 1e-9);
        }
    }
    for (size_t j = 0; j < coman.robot->njoint; j++) {
        assert_near(plant_sensors(coman.plant)->motor[j].qd, 0.0, 1e-10);
    }
    coman_fini(&coman);
}

/* Sum over bodies by the dynamics' own kinematics of a robot with every body observed. */
static void momenta(struct coman *coman, double centre[3], double linear[3], double angular[3])
{
    struct body_motion motion[BODIES];
    struct robot_body body[BODIES];
    struct robot all = *coman->robot;
    struct dynamics dynamics;
    struct error error;

    memcpy(body, coman->robot->body, coman->robot->nbody * sizeof *body);
    all.body = body;
    for (size_t b = 0; b < all.nbody; b++) {
        body[b].observed = true;
    }
    assert_int_equal(dynamics_generic(&all, &coman->arena, &dynamics, &error), ERROR_NONE);
    dynamics.ops->kinematics(&dynamics, coman->state, coman->state + all.nq, motion);
    memset(centre, 0, 3 * sizeof *centre);
    memset(linear, 0, 3 * sizeof *linear);
    memset(angular, 0, 3 * sizeof *angular);
    for (size_t b = 0; b < all.nbody; b++) {
        const struct robot_inertia *inertia = &body[b].inertia;
        double arm[3], c[3], p[3], spin[3], I[6];

        mat3_apply(motion[b].R, inertia->com, arm);
        memcpy(I, inertia->I, sizeof I);
        sym3_rotate(motion[b].R, I);
        sym3_apply(I, motion[b].w, spin);
        memcpy(p, motion[b].v, sizeof p);
        vec3_add_cross(motion[b].w, arm, p);
        for (int i = 0; i < 3; i++) {
            p[i] *= inertia->mass;
            c[i] = motion[b].p[i] + arm[i];
            centre[i] += inertia->mass * c[i] / all.total_mass;
            linear[i] += p[i];
            angular[i] += spin[i];
        }
        vec3_add_cross(c, p, angular);
    }
}

/* No gravity, all drives at random: what the robot does to itself changes no momentum, and the
 * account of its energy closes. */
TEST(random_voltages_change_no_momentum)
{
    static struct coman coman;
    double c[3], linear0[3], angular0[3], linear[3], angular[3], centre[3], momentum[3];
    double size, spin;
    struct plant_command *command;

    coman_init(&coman, false);
    for (size_t i = 0; i < 6; i++) {
        coman.state[coman.robot->nq + i] = 0.4 + 0.2 * (double)i;
    }
    momenta(&coman, c, linear0, angular0);
    size = sqrt(vec3_dot(linear0, linear0));
    spin = sqrt(vec3_dot(angular0, angular0));
    command = plant_command(coman.plant);
    for (int k = 0; k < 300; k++) {
        for (size_t j = 0; j < coman.robot->njoint; j++) {
            command->motor[j].bridge_on = true;
            command->motor[j].voltage_v = 10.0 * coman_random(&coman);
        }
        assert_int_equal(plant_step(coman.plant, 10), ERROR_NONE);
    }
    momenta(&coman, c, linear, angular);
    plant_center_of_mass(coman.plant, centre, momentum);
    for (int i = 0; i < 3; i++) {
        print_message("# axis %d: linear %.1e of %.1f kg m/s, angular %.1e of %.2f kg m2/s\n", i,
                      linear[i] - linear0[i], size, angular[i] - angular0[i], spin);
        assert_near(linear[i], linear0[i], 1e-7 * size);
        assert_near(angular[i], angular0[i], 1e-7 * spin);
        assert_near(centre[i], c[i], 1e-14);
        assert_near(momentum[i], linear[i], 1e-12);
    }
    coman_fini(&coman);
}

/* Falling with its drives at work, 0.5 s at the paper's step. */
TEST(energy_of_the_falling_robot_balances)
{
    static struct coman coman;
    struct plant_command *command;
    struct plant_energy energy;
    double turnover;

    coman_init(&coman, true);
    assert_int_equal(plant_restart_energy(coman.plant), ERROR_NONE);
    command = plant_command(coman.plant);
    for (int k = 0; k < 500; k++) {
        for (size_t j = 0; j < coman.robot->njoint; j++) {
            command->motor[j].bridge_on = true;
            command->motor[j].voltage_v = 8.0 * sin((0.012 + 1e-3 * (double)j) * k);
        }
        assert_int_equal(plant_step(coman.plant, 10), ERROR_NONE);
    }
    assert_int_equal(plant_energy(coman.plant, &energy), ERROR_NONE);
    turnover = fabs(energy.electrical_in) + energy.joule_heat + energy.motor_friction +
               energy.spring_damping + energy.parallel_damping;
    print_message("# in %.3f J, heat %.3f J, balance %.2e J (%.1e of the turnover)\n",
                  energy.electrical_in, energy.joule_heat, energy.balance,
                  fabs(energy.balance) / turnover);
    assert_true(turnover > 1.0);
    assert_true(fabs(energy.balance) <= 1e-6 * turnover);
    coman_fini(&coman);
}
