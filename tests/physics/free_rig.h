/* SPDX-License-Identifier: Apache-2.0 */
/* A plant with free bodies, a toy robot and a toy ground or a tie; for the tests of free bodies. */
#ifndef TESTS_PHYSICS_FREE_RIG_H
#define TESTS_PHYSICS_FREE_RIG_H

#include "contact/tangent.h"
#include "model/spatial.h"
#include "tests/physics/toy.h"
#include "tests/test.h"

/* A spring and a damper between a point of contact body 0 and a point of contact body 1. */
struct tie {
    struct contact_world world;
    double point[2][3]; /* in the bodies' frames, m */
    double k, d;        /* N/m, N s/m */
    double impulse;     /* largest |force| seen */
    double stretch;     /* squared, of the last evaluation */
    double middle[3];   /* between the points, world frame, of the last evaluation, m */
};

static inline enum error_code tie_evaluate(struct contact_world *world,
                                           const struct body_motion *motion,
                                           struct contact_bristles *bristles,
                                           struct contact_wrench *wrench)
{
    struct tie *tie = (struct tie *)world;
    double at[2][3], arm[2][3], velocity[2][3];

    (void)bristles;
    for (int b = 0; b < 2; b++) {
        mat3_apply(motion[b].R, tie->point[b], arm[b]);
        memcpy(velocity[b], motion[b].v, sizeof velocity[b]);
        vec3_add_cross(motion[b].w, arm[b], velocity[b]);
        for (int i = 0; i < 3; i++) {
            at[b][i] = motion[b].p[i] + arm[b][i];
        }
    }
    memset(wrench, 0, 2 * sizeof *wrench);
    tie->stretch = 0.0;
    for (int i = 0; i < 3; i++) {
        double stretch = at[1][i] - at[0][i];

        wrench[0].force[i] = tie->k * stretch + tie->d * (velocity[1][i] - velocity[0][i]);
        wrench[1].force[i] = -wrench[0].force[i];
        tie->impulse = fmax(tie->impulse, fabs(wrench[0].force[i]));
        tie->stretch += stretch * stretch;
        tie->middle[i] = 0.5 * (at[0][i] + at[1][i]);
    }
    for (int b = 0; b < 2; b++) {
        vec3_add_cross(arm[b], wrench[b].force, wrench[b].moment);
    }
    return ERROR_NONE;
}

static inline size_t tie_patches(struct contact_world *world, struct contact_patch *patch,
                                 size_t max)
{
    const struct tie *tie = (const struct tie *)world;

    if (max > 0) {
        *patch = (struct contact_patch){.potential_j = 0.5 * tie->k * tie->stretch};
    }
    return 1;
}

static inline size_t tie_tangents(struct contact_world *world, struct contact_tangent *tangent,
                                  size_t max)
{
    const struct tie *tie = (const struct tie *)world;

    if (max > 0) {
        *tangent = (struct contact_tangent){.body_a = 0, .body_b = 1};
        memcpy(tangent->center, tie->middle, sizeof tangent->center);
        for (int i = 0; i < 3; i++) {
            struct contact_element element = {.stiffness = tie->k, .damping = tie->d};

            memcpy(element.point, tie->middle, sizeof element.point);
            element.normal[i] = 1.0;
            contact_tangent_add(tangent, &element);
        }
    }
    return 1;
}

static inline const char *tie_failure(const struct contact_world *world)
{
    (void)world;
    return "";
}

static inline void tie_begin(struct tie *tie, double k, double d)
{
    static const struct contact_ops ops = {.name = "tie",
                                           .evaluate = tie_evaluate,
                                           .patches = tie_patches,
                                           .tangents = tie_tangents,
                                           .failure = tie_failure};

    *tie = (struct tie){.world.ops = &ops, .k = k, .d = d};
}

enum { FREE_RIG_BODIES = 2 };

struct free_rig {
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct toy_ground ground;
    struct tie tie;
    struct plant_free_body body[FREE_RIG_BODIES];
    int contact_body[3];
    struct plant_config config;
    struct plant *plant;
    double *state; /* the whole */
    double *free;  /* the free bodies' part */
    size_t count;
};

/* The paper's box, a little off its middle so that the center of mass counts. */
static inline struct plant_free_body free_rig_box(void)
{
    return (struct plant_free_body){.name = "box",
                                    .inertia = {.mass = 1.5,
                                                .com = {0.01, -0.02, 0.005},
                                                .I = {6e-3, 4e-4, -3e-4, 5e-3, 2e-4, 4.5e-3}},
                                    .quaternion = {1.0, 0.0, 0.0, 0.0}};
}

static inline void free_rig_begin(struct free_rig *rig, size_t nfree, int64_t substep_ns)
{
    struct error error;

    memset(rig, 0, sizeof *rig);
    assert_ok(arena_init(&rig->arena, 1 << 22, &error));
    for (size_t b = 0; b < nfree; b++) {
        rig->body[b] = free_rig_box();
    }
    rig->config = (struct plant_config){.robot = &rig->toy.robot,
                                        .dynamics = &rig->dynamics,
                                        .free = rig->body,
                                        .nfree = nfree,
                                        .contact_body = rig->contact_body,
                                        .substep_ns = substep_ns,
                                        .supply_v = 48.0,
                                        .account_energy = true};
}

/* Beside a post that does nothing: a robot of one body on a fixed base. */
static inline void free_rig_post(struct free_rig *rig, size_t nfree, int64_t substep_ns)
{
    static const double com[3] = {0.0, 0.0, 0.0}, I[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0};

    free_rig_begin(rig, nfree, substep_ns);
    toy_begin(&rig->toy, false, 1.0, com, I);
    toy_add_frame(&rig->toy, 0, com);
    toy_finish(&rig->toy);
}

/* Beside the walker. */
static inline void free_rig_walker(struct free_rig *rig, size_t nfree, int64_t substep_ns)
{
    free_rig_begin(rig, nfree, substep_ns);
    toy_walker(&rig->toy);
}

/* Feet and box corners meet the ground; the box is contact body 2. */
static inline void free_rig_walker_on_ground(struct free_rig *rig, int64_t substep_ns)
{
    free_rig_walker(rig, 1, substep_ns);
    toy_walker_ground(&rig->ground);
    rig->ground.nbody = 3;
    for (int corner = 0; corner < 8; corner++) {
        toy_ground_add(&rig->ground, 2, corner & 1 ? 0.075 : -0.075, corner & 2 ? 0.075 : -0.075,
                       corner & 4 ? 0.075 : -0.075);
    }
    rig->contact_body[0] = TOY_RIGHT_FOOT;
    rig->contact_body[1] = TOY_LEFT_FOOT;
    rig->contact_body[2] = (int)rig->toy.robot.nbody;
    rig->config.contact = &rig->ground.world;
    rig->config.ncontact = 3;
}

/* A point of the left foot (an observed body) tied to one of the box. */
static inline void free_rig_tied(struct free_rig *rig, int64_t substep_ns)
{
    free_rig_walker(rig, 1, substep_ns);
    tie_begin(&rig->tie, 400.0, 3.0);
    memcpy(rig->tie.point[0], (const double[3]){0.05, 0.02, -0.08}, sizeof rig->tie.point[0]);
    memcpy(rig->tie.point[1], (const double[3]){0.075, -0.05, 0.03}, sizeof rig->tie.point[1]);
    rig->contact_body[0] = TOY_LEFT_FOOT;
    rig->contact_body[1] = (int)rig->toy.robot.nbody;
    rig->config.contact = &rig->tie.world;
    rig->config.ncontact = 2;
}

/* Makes the plant of what has been set up and puts everything to its start. */
static inline void free_rig_start(struct free_rig *rig)
{
    static const double joint[8] = {-0.4, 0.8, -0.4, -0.35, 0.75, -0.4, 0.2, 0.05};
    static const double quaternion[4] = {0.99, 0.02, 0.05, -0.1};
    static const double position[3] = {0.1, -0.2, 0.52};
    struct error error;

    if (!rig->dynamics.ops) {
        assert_ok(dynamics_generic(&rig->toy.robot, &rig->arena, &rig->dynamics, &error));
    }
    assert_ok(plant_create(&rig->config, &rig->arena, &rig->plant, &error));
    rig->state = plant_state(rig->plant, &rig->count);
    assert_ok(plant_reset(rig->plant, position, quaternion, joint));
    rig->free = rig->state + rig->toy.robot.nq + rig->toy.robot.nv;
    for (size_t j = 0; j < rig->toy.robot.njoint; j++) {
        rig->free += rig->toy.joint[j].sea.present ? 3 : 0;
        rig->free += rig->toy.joint[j].spring.present && rig->toy.joint[j].spring.enabled;
    }
}

static inline void free_rig_fini(struct free_rig *rig)
{
    arena_fini(&rig->arena);
}

#endif
