/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Free rigid bodies on the native contact engine, integrated by a Runge-Kutta method of fourth
 * order. For cmocka tests; one program has one arena.
 */
#ifndef TESTS_PHYSICS_CONTACT_BODIES_H
#define TESTS_PHYSICS_CONTACT_BODIES_H

#include "tests/physics/contact_scene.h"
#include "tests/test.h"

#define BODIES 3
#define BRISTLES (CONTACT_BRISTLE * SCENE_PAIRS)

/* Half as hard as the two together: 5e5 Pa/m. */
static const struct contact_material plain = {1e6, 1, 0.3, 0.5, 0.4, 0, 0};

static struct arena arena;

FIXTURE(set_up)
{
    return arena_init(&arena, (size_t)64 << 20, NULL) ? -1 : 0;
}

FIXTURE(tear_down)
{
    arena_fini(&arena);
    return 0;
}

struct bodies {
    struct contact_world *world;
    size_t count;
    double mass[BODIES], inertia[BODIES]; /* equal about all axes */
    double gravity[3];
    struct body_motion motion[BODIES];
    double bristle[BRISTLES]; /* of the world, if it has any */
};

/* All pairs. */
static inline void list_bristles(const struct bodies *b, struct contact_bristles *bristles)
{
    for (size_t i = 0; i < b->world->nbristle / CONTACT_BRISTLE; i++) {
        bristles->pair[bristles->npair++] = (int)i;
    }
}

/* The derivative of a motion is kept in one: R' in R, v in p, and the accelerations. */
static inline void derive(const struct bodies *b, const struct body_motion *at, const double *y,
                          struct body_motion *rate, double *y_rate)
{
    int pair[SCENE_PAIRS];
    struct contact_bristles bristles = {.y = y, .rate = y_rate, .pair = pair};
    struct contact_wrench wrench[BODIES];

    list_bristles(b, &bristles);

    if (b->world->ops->evaluate(b->world, at, &bristles, wrench) != ERROR_NONE) {
        fail_msg("%s", b->world->ops->failure(b->world));
    }
    for (size_t n = 0; n < b->count; n++) {
        for (int i = 0; i < 3; i++) {
            double column[3] = {at[n].R[i], at[n].R[3 + i], at[n].R[6 + i]}, turn[3];

            vec3_cross(at[n].w, column, turn);
            for (int row = 0; row < 3; row++) {
                rate[n].R[3 * row + i] = turn[row];
            }
            rate[n].p[i] = at[n].v[i];
            rate[n].v[i] = b->gravity[i] + wrench[n].force[i] / b->mass[n];
            rate[n].w[i] = wrench[n].moment[i] / b->inertia[n];
        }
    }
}

/* Out = a + s b, of all the numbers of the motions. */
static inline void combine(size_t count, const struct body_motion *a, double s,
                           const struct body_motion *b, struct body_motion *out)
{
    for (size_t n = 0; n < count; n++) {
        for (int i = 0; i < 9; i++) {
            out[n].R[i] = a[n].R[i] + s * b[n].R[i];
        }
        for (int i = 0; i < 3; i++) {
            out[n].p[i] = a[n].p[i] + s * b[n].p[i];
            out[n].v[i] = a[n].v[i] + s * b[n].v[i];
            out[n].w[i] = a[n].w[i] + s * b[n].w[i];
        }
    }
}

/* Makes the rows orthonormal again. */
static inline void straighten(double R[9])
{
    double length = vec3_norm(R), dot;

    for (int i = 0; i < 3; i++) {
        R[i] /= length;
    }
    dot = R[0] * R[3] + R[1] * R[4] + R[2] * R[5];
    for (int i = 0; i < 3; i++) {
        R[3 + i] -= dot * R[i];
    }
    length = vec3_norm(R + 3);
    for (int i = 0; i < 3; i++) {
        R[3 + i] /= length;
    }
    vec3_cross(R, R + 3, R + 6);
}

static inline void step(struct bodies *b, double h)
{
    struct body_motion k[4][BODIES], at[BODIES];
    const double part[4] = {0, h / 2, h / 2, h}, weight[4] = {h / 6, h / 3, h / 3, h / 6};
    const size_t nbristle = b->world->nbristle;
    double rate[4][BRISTLES], y[BRISTLES];

    for (int s = 0; s < 4; s++) {
        combine(b->count, b->motion, s ? part[s] : 0, s ? k[s - 1] : b->motion, at);
        for (size_t i = 0; i < nbristle; i++) {
            y[i] = b->bristle[i] + (s ? part[s] * rate[s - 1][i] : 0);
        }
        derive(b, at, y, k[s], rate[s]);
    }
    for (int s = 0; s < 4; s++) {
        combine(b->count, b->motion, weight[s], k[s], b->motion);
        for (size_t i = 0; i < nbristle; i++) {
            b->bristle[i] += weight[s] * rate[s][i];
        }
    }
    for (size_t n = 0; n < b->count; n++) {
        straighten(b->motion[n].R);
    }
}

static inline void run(struct bodies *b, double seconds, double h)
{
    for (int i = 0; i < (int)(seconds / h + 0.5); i++) {
        step(b, h);
    }
}

static inline double kinetic(const struct bodies *b)
{
    double sum = 0;

    for (size_t n = 0; n < b->count; n++) {
        for (int i = 0; i < 3; i++) {
            sum += b->mass[n] * b->motion[n].v[i] * b->motion[n].v[i] / 2;
            sum += b->inertia[n] * b->motion[n].w[i] * b->motion[n].w[i] / 2;
        }
    }
    return sum;
}

static inline double stored(const struct bodies *b)
{
    int pair[SCENE_PAIRS];
    struct contact_bristles bristles = {.y = b->bristle, .pair = pair};
    struct contact_patch patch[8];
    struct contact_wrench wrench[BODIES];
    double sum = 0;
    size_t n;

    list_bristles(b, &bristles);
    b->world->ops->evaluate(b->world, b->motion, &bristles, wrench);
    n = b->world->ops->patches(b->world, patch, 8);
    for (size_t i = 0; i < n; i++) {
        sum += patch[i].potential_j;
    }
    return sum;
}

static inline struct bodies make(const struct scene *scene, double mass)
{
    struct bodies b = {.count = scene->config.nbody};
    struct error error = {0};

    assert_no_error(contact_native_create(&scene->config, &arena, &b.world, &error) != ERROR_NONE,
                    error.text);
    for (size_t n = 0; n < b.count; n++) {
        b.mass[n] = mass;
        b.inertia[n] = mass * 0.0225 / 6; /* of a cube of 15 cm */
        scene_place(&b.motion[n], 0, 0, 0);
    }
    return b;
}

/* Ground or a table whose top is at z = 0, and a cube of 15 cm. */
static inline void cube_on_ground(struct scene *scene, bool table,
                                  const struct contact_material *material)
{
    scene_init(scene, 1);
    if (table) {
        scene_add_box(scene, -1, 0.5, 0.5, 0.1, 1, material)->position[2] = -0.1;
    } else {
        scene_add(scene, -1, CONTACT_HALF_SPACE, material);
    }
    scene_add_box(scene, 0, 0.075, 0.075, 0.075, 7, material);
    scene_add_pair(scene, 0, 1);
}

#endif
