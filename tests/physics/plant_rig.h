/* SPDX-License-Identifier: Apache-2.0 */
/* A toy robot with its dynamics, ground and plant, ready to step; for the plant's tests. */
#ifndef TESTS_PHYSICS_PLANT_RIG_H
#define TESTS_PHYSICS_PLANT_RIG_H

#include "tests/physics/toy.h"
#include "tests/test.h"
#include "tests/physics/near.h"

struct plant_rig {
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct toy_ground ground;
    struct plant *plant;
    double *state;
    size_t count;
    uint64_t random; /* state of plant_rig_random */
};

/* The plant of the walker that the toy is, its feet on the ground when on_ground. dopri5 has the
 * tolerance 1e-9. Aborts on any error. */
static inline void plant_rig_start(struct plant_rig *rig, bool on_ground,
                                   enum plant_integrator integrator, int64_t substep_ns)
{
    static const int feet[2] = {TOY_RIGHT_FOOT, TOY_LEFT_FOOT};
    struct plant_config config = {.robot = &rig->toy.robot,
                                  .dynamics = &rig->dynamics,
                                  .integrator = integrator,
                                  .rtol = 1e-9,
                                  .atol = 1e-9,
                                  .substep_ns = substep_ns,
                                  .supply_v = 48.0,
                                  .account_energy = true};
    struct error error;

    toy_walker_ground(&rig->ground);
    if (on_ground) {
        config.contact = &rig->ground.world;
        config.contact_body = feet;
        config.ncontact = 2;
    }
    rig->random = 88172645463325252u;
    assert_ok(arena_init(&rig->arena, 1 << 22, &error));
    assert_ok(dynamics_generic(&rig->toy.robot, &rig->arena, &rig->dynamics, &error));
    assert_ok(plant_create(&config, &rig->arena, &rig->plant, &error));
    rig->state = plant_state(rig->plant, &rig->count);
}

/* The walker; Ks > 0 replaces the stiffness of every series spring, with damping to match. */
static inline void plant_rig_walker_with(struct plant_rig *rig, bool on_ground,
                                         enum plant_integrator integrator, int64_t substep_ns,
                                         double Ks)
{
    toy_walker(&rig->toy);
    for (size_t j = 0; j < rig->toy.robot.njoint; j++) {
        if (Ks > 0.0 && rig->toy.joint[j].sea.present) {
            rig->toy.joint[j].sea = toy_drive(Ks);
        }
    }
    plant_rig_start(rig, on_ground, integrator, substep_ns);
}

/* The walker on the ground with two couplings: its left ankle follows the right one, its hand,
 * which slides, the shoulder. */
static inline void plant_rig_coupled_walker(struct plant_rig *rig,
                                            struct robot_coupling coupling[2],
                                            enum plant_integrator integrator, int64_t substep_ns)
{
    toy_walker(&rig->toy);
    coupling[0] = (struct robot_coupling){
        .follower = 5, .leader = 2, .multiplier = 1.0, .stiffness = 900.0, .damping = 0.6};
    coupling[1] = (struct robot_coupling){.follower = 7,
                                          .leader = 6,
                                          .multiplier = 0.25,
                                          .offset = -0.02,
                                          .stiffness = 2e4,
                                          .damping = 30.0};
    rig->toy.joint[5].sea = (struct robot_sea){0};
    rig->toy.robot.coupling = coupling;
    rig->toy.robot.ncoupling = 2;
    toy_finish(&rig->toy);
    plant_rig_start(rig, true, integrator, substep_ns);
}

/* The same with rk4 and its own springs. */
static inline void plant_rig_walker(struct plant_rig *rig, bool on_ground, int64_t substep_ns)
{
    plant_rig_walker_with(rig, on_ground, PLANT_RK4, substep_ns, 0.0);
}

static inline void plant_rig_fini(struct plant_rig *rig)
{
    arena_fini(&rig->arena);
}

/* Uniform in [-1, 1), the same on every run (xorshift). */
static inline double plant_rig_random(struct plant_rig *rig)
{
    rig->random ^= rig->random << 13;
    rig->random ^= rig->random >> 7;
    rig->random ^= rig->random << 17;
    return (double)(int64_t)rig->random / 9223372036854775808.0;
}

/* The trunk at a height, turned a little, joints bent. */
static inline void plant_rig_reset(struct plant_rig *rig, double height)
{
    static const double quaternion[4] = {0.99, 0.02, 0.05, -0.1};
    static const double joint[8] = {-0.4, 0.8, -0.4, -0.35, 0.75, -0.4, 0.2, 0.05};
    const double position[3] = {0.1, -0.2, height};

    assert_ok(plant_reset(rig->plant, position, quaternion, joint));
}

/* Every bridge on, with a random voltage of at most limit. */
static inline void plant_rig_random_voltages(struct plant_rig *rig, double limit)
{
    struct plant_command *command = plant_command(rig->plant);

    for (size_t j = 0; j < command->njoint; j++) {
        command->motor[j].bridge_on = true;
        command->motor[j].voltage_v = limit * plant_rig_random(rig);
    }
}

#endif
