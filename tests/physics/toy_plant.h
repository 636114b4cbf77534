/* SPDX-License-Identifier: Apache-2.0 */
/* A robot built by hand on its plant: begin, build the robot, change the configuration, open. */
#ifndef TESTS_PHYSICS_TOY_PLANT_H
#define TESTS_PHYSICS_TOY_PLANT_H

#include "tests/physics/toy.h"
#include "tests/test.h"

struct toy_plant {
    struct toy toy;
    struct arena arena; /* the owner's to free */
    struct dynamics dynamics;
    struct plant_config config;
    struct plant *plant;
    struct motor_command *motor;
    double *state;
};

static inline void toy_plant_begin(struct toy_plant *p, enum plant_integrator integrator,
                                   int64_t substep_ns)
{
    *p = (struct toy_plant){.config = {.integrator = integrator,
                                       .rtol = 1e-11,
                                       .atol = 1e-12,
                                       .substep_ns = substep_ns,
                                       .supply_v = 48.0,
                                       .account_energy = true}};
}

static inline void toy_plant_open(struct toy_plant *p)
{
    struct error error;
    size_t count;

    toy_finish(&p->toy);
    p->config.robot = &p->toy.robot;
    p->config.dynamics = &p->dynamics;
    assert_ok(arena_init(&p->arena, 1 << 20, &error));
    assert_ok(dynamics_generic(&p->toy.robot, &p->arena, &p->dynamics, &error));
    assert_ok(plant_create(&p->config, &p->arena, &p->plant, &error));
    p->motor = plant_command(p->plant)->motor;
    p->state = plant_state(p->plant, &count);
}

#endif
