/* SPDX-License-Identifier: Apache-2.0 */
/* Reduces a rig's robot to its bodies, joints and couplings, and measures how fast it can be
 * simulated. */
#include "app/bench/bench.h"

#include "base/vec3.h"
#include "model/plant.h"
#include "model/symbolic/symbolic.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define ARENA_BYTES ((size_t)512 << 20) /* reserved address space */

enum { WARM_UP_STEPS = 100 }; /* steps that fill the caches before the measurement */

/* Joint springs of a standing robot. The stiffness, N m/rad, is this factor times weight times
 * height of the base, so that an ankle can carry the robot. The damping gives this return time, s.
 * It keeps MuJoCo stable, which integrates springs explicitly and dampers implicitly. */
static const double STANDING_STIFFNESS = 10.0, STANDING_RETURN_S = 0.1;

/* Largest displacement of the base of a robot that still stands, m. */
static const double STANDING_NEAR_M = 0.05;

/* A robot reduced to its bodies, joints and couplings. A standing robot also has joint springs and
 * the contact pairs of its feet with the ground. */
struct alone {
    const struct rig *rig;
    struct robot *robot;
    struct contact_config contact;
    bool standing;
};

/* Keeps only the contact pairs of the robot with level ground. */
static enum error_code alone_keep_feet(struct alone *alone, struct arena *arena,
                                       struct error *error)
{
    const struct contact_config *all = &alone->rig->contact;
    struct contact_pair *pair = arena_alloc(arena, all->npair + 1, sizeof *pair);

    if (!pair) {
        return error_set(error, ERROR_MEMORY, "no memory for the feet");
    }
    alone->contact = *all;
    alone->contact.pair = pair;
    alone->contact.npair = 0;
    for (size_t i = 0; i < all->npair; i++) {
        const struct contact_surface *a = &all->surface[all->pair[i].a];
        const struct contact_surface *b = &all->surface[all->pair[i].b];

        if ((a->shape == CONTACT_HALF_SPACE && b->body >= 0) ||
            (b->shape == CONTACT_HALF_SPACE && a->body >= 0)) {
            pair[alone->contact.npair++] = all->pair[i];
        }
    }
    return ERROR_NONE;
}

/* Loads the rig and reduces its robot. */
static enum error_code alone_strip(struct alone *alone, const char *rig, struct arena *arena,
                                   struct error *error)
{
    enum error_code code;
    double stiffness = 0.0;

    if ((code = rig_load(rig, arena, &alone->rig, error)) ||
        (code = robot_copy(alone->rig->robot, arena, &alone->robot, error))) {
        return code;
    }
    for (size_t b = 0; b < alone->robot->nbody; b++) {
        stiffness += STANDING_STIFFNESS * alone->robot->body[b].inertia.mass *
                     vec3_norm(alone->robot->gravity) * fabs(alone->rig->base_position[2]);
    }
    for (size_t j = 0; j < alone->robot->njoint; j++) {
        struct robot_joint *joint = &alone->robot->joint[j];

        joint->sea = (struct robot_sea){0};
        joint->hydraulic = (struct robot_hydraulic){0};
        joint->spring = (struct robot_parallel_spring){0};
        joint->passive = (struct robot_passive){0};
        joint->stop = (struct robot_stop){0};
        joint->lower = -INFINITY;
        joint->upper = INFINITY;
        if (alone->standing) {
            joint->passive = (struct robot_passive){stiffness, STANDING_RETURN_S * stiffness,
                                                    alone->rig->joint[j]};
        }
    }
    alone->robot->hydraulic_supply = (struct robot_hydraulic_supply){0};
    return alone->standing && alone->robot->floating && !alone->rig->nfree
               ? alone_keep_feet(alone, arena, error)
               : ERROR_NONE;
}

/* Measures the speed of our plant. */
static enum error_code alone_time_ours(const struct alone *alone, struct arena *arena,
                                       double seconds, double *cpu_s, struct error *error)
{
    const struct rig *rig = alone->rig;
    struct dynamics *dynamics = arena_alloc(arena, 1, sizeof *dynamics);
    struct plant_config config = {.robot = alone->robot,
                                  .dynamics = dynamics,
                                  .integrator = PLANT_IMPLICIT,
                                  .substep_ns = rig->substep_ns,
                                  .supply_v = rig->supply_v,
                                  .contact_body = rig->contact_body,
                                  .ncontact = alone->contact.npair ? rig->contact.nbody : 0};
    struct plant *plant;
    struct error notice;
    enum error_code code;
    const double *position;
    double begun_s;
    size_t count;

    if (!dynamics) {
        return error_set(error, ERROR_MEMORY, "no memory for the dynamics");
    }
    if ((code = dynamics_choose(alone->robot, false, arena, dynamics, &notice, error)) ||
        (alone->contact.npair &&
         (code = contact_native_create(&alone->contact, arena, &config.contact, error))) ||
        (code = plant_create(&config, arena, &plant, error))) {
        return code;
    }
    if (plant_reset(plant, rig->base_position, rig->base_quaternion, rig->joint)) {
        return error_set(error, ERROR_UNSUPPORTED, "%s: no start", rig->file);
    }

    /* Fill the caches, restart, and measure the steps */
    plant_step(plant, WARM_UP_STEPS);
    plant_reset(plant, rig->base_position, rig->base_quaternion, rig->joint);
    begun_s = bench_cpu_s();
    if (!plant_step(plant, (size_t)llround(seconds * 1e9 / (double)rig->substep_ns))) {
        *cpu_s = bench_cpu_s() - begun_s;
    }
    position = plant_values(plant, &count) + BASE_Q_POSITION;
    for (int k = 0; alone->standing && k < 3; k++) {
        if (!(fabs(position[k] - rig->base_position[k]) < STANDING_NEAR_M)) {
            *cpu_s = NAN;
        }
    }
    return ERROR_NONE;
}

/* Measures the speed of MuJoCo. */
static enum error_code alone_time_mujoco(const struct alone *alone,
                                         const struct peer_dynamics *mujoco, bool implicit,
                                         struct arena *arena, double seconds, double *cpu_s,
                                         struct error *error)
{
    const struct rig *rig = alone->rig;
    const double dt = 1e-9 * (double)rig->substep_ns;
    double *q = arena_alloc(arena, rig->robot->nq, sizeof *q);
    double *v = arena_alloc(arena, rig->robot->nv, sizeof *v);
    double *tau = arena_alloc(arena, rig->robot->nv, sizeof *tau);
    char message[256];
    double begun_s;
    void *engine = NULL;

    if (!q || !v || !tau) {
        return error_set(error, ERROR_MEMORY, "no memory for MuJoCo's state");
    }
    engine = mujoco->create_moving(alone->robot, alone->standing ? &alone->contact : NULL,
                                   rig->contact_body, message, sizeof message);
    if (!engine) {
        fprintf(stderr, "%s: MuJoCo is left out: %s\n", rig->file, message);
        return ERROR_NONE;
    }

    /* Set the pose, fill the caches with some steps, then measure the steps */
    if (rig->robot->floating) {
        memcpy(q + BASE_Q_POSITION, rig->base_position, sizeof rig->base_position);
        memcpy(q + BASE_Q_QUATERNION, rig->base_quaternion, sizeof rig->base_quaternion);
    }
    memcpy(q + rig->robot->nq - rig->robot->njoint, rig->joint, rig->robot->njoint * sizeof *q);
    mujoco->put(engine, 0, q, v, tau);
    mujoco->step(engine, 0, implicit, dt, WARM_UP_STEPS);
    begun_s = bench_cpu_s();
    if (mujoco->step(engine, 0, implicit, dt, (size_t)llround(seconds / dt))) {
        *cpu_s = bench_cpu_s() - begun_s;
    }
    mujoco->destroy(engine);
    return ERROR_NONE;
}

const struct peer_dynamics *alone_find_mujoco(const struct peers *peers)
{
    for (size_t i = 0; peers && i < peers->ndynamics; i++) {
        if (peers->dynamics[i].step) {
            return &peers->dynamics[i];
        }
    }
    return NULL;
}

enum error_code alone_measure(const char *rig, enum alone_way way,
                              const struct peer_dynamics *mujoco, double seconds, double *cpu_s,
                              struct error *error)
{
    const bool ours = way == ALONE_BODIES || way == ALONE_STANDING;
    struct alone alone = {.standing = way == ALONE_STANDING || way == ALONE_STANDING_EULER};
    struct arena arena = {0};
    enum error_code code;

    *cpu_s = NAN;
    (void)((code = arena_init(&arena, ARENA_BYTES, error)) ||
           (code = alone_strip(&alone, rig, &arena, error)));
    if (!code && (ours || mujoco) && (!alone.standing || alone.contact.npair)) {
        code = ours ? alone_time_ours(&alone, &arena, seconds, cpu_s, error)
                    : alone_time_mujoco(&alone, mujoco, way == ALONE_BODIES_IMPLICIT, &arena,
                                        seconds, cpu_s, error);
    }
    arena_fini(&arena);
    return code;
}
