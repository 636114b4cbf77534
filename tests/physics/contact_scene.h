/* SPDX-License-Identifier: Apache-2.0 */
/* Small contact scenes for tests: surfaces at their bodies' origins, random motions. C and C++. */
#ifndef TESTS_PHYSICS_CONTACT_SCENE_H
#define TESTS_PHYSICS_CONTACT_SCENE_H

#include "base/vec3.h"
#include "contact/contact.h"
#include "contact/mesh/solid_store.h"
#include "tests/unit/contact/random_number.h"

#include <math.h>
#include <string.h>

#define SCENE_SURFACES 8
#define SCENE_PAIRS 28
#define SCENE_TRANSITION_M_S 0.01

struct scene {
    struct contact_surface surface[SCENE_SURFACES];
    struct contact_pair pair[SCENE_PAIRS];
    struct contact_config config;
};

/* The paper's foot and ground (Pa, layer thickness in m), with friction of their own. */
static const struct contact_material scene_foot = {1e5, 2e-4, 0.1, 1.1, 0.9, 0.02, 0};
static const struct contact_material scene_ground = {1e5, 1e-3, 0.3, 0.9, 0.6, 0.05, 0};

/* Stiffness per area, dissipation and friction of the two together, by contact.h's law. */
static inline double scene_stiffness(const struct contact_material *a,
                                     const struct contact_material *b)
{
    double ka = a->young_pa / a->thickness_m, kb = b->young_pa / b->thickness_m;

    return ka * kb / (ka + kb);
}

static inline double scene_dissipation(const struct contact_material *a,
                                       const struct contact_material *b)
{
    double ka = a->young_pa / a->thickness_m, kb = b->young_pa / b->thickness_m;

    return (a->dissipation_s_per_m * kb + b->dissipation_s_per_m * ka) / (ka + kb);
}

static inline double scene_mean(double a, double b)
{
    return 2 * a * b / (a + b);
}

static inline void scene_init(struct scene *scene, size_t nbody)
{
    memset(scene, 0, sizeof *scene);
    scene->config.nbody = nbody;
    scene->config.surface = scene->surface;
    scene->config.pair = scene->pair;
    scene->config.transition_velocity_m_s = SCENE_TRANSITION_M_S;
}

static inline struct contact_surface *scene_add(struct scene *scene, int body,
                                                enum contact_shape shape,
                                                const struct contact_material *material)
{
    struct contact_surface *s = &scene->surface[scene->config.nsurface++];

    s->name = "surface";
    s->body = body;
    s->shape = shape;
    s->material = *material;
    s->rotation[0] = s->rotation[4] = s->rotation[8] = 1;
    return s;
}

static inline struct contact_surface *scene_add_box(struct scene *scene, int body, double x,
                                                    double y, double z, int cells,
                                                    const struct contact_material *material)
{
    struct contact_surface *s = scene_add(scene, body, CONTACT_BOX, material);

    s->half_extent_m[0] = x;
    s->half_extent_m[1] = y;
    s->half_extent_m[2] = z;
    s->cells_per_edge = cells;
    return s;
}

static inline void scene_add_pair(struct scene *scene, int a, int b)
{
    struct contact_pair *p = &scene->pair[scene->config.npair++];

    p->a = a;
    p->b = b;
}

/* Upright at a place, at rest. */
static inline void scene_place(struct body_motion *motion, double x, double y, double z)
{
    memset(motion, 0, sizeof *motion);
    motion->R[0] = motion->R[4] = motion->R[8] = 1;
    motion->p[0] = x;
    motion->p[1] = y;
    motion->p[2] = z;
}

/* Rotation about a random axis by up to angle; Rodrigues' formula. */
static inline void scene_random_rotation(uint64_t *seed, double angle, double R[9])
{
    double a[3], length = 0, t = angle * random_number(seed), c = cos(t), s = sin(t);

    for (int i = 0; i < 3; i++) {
        a[i] = random_number(seed);
        length += a[i] * a[i];
    }
    for (int i = 0; i < 3; i++) {
        a[i] /= sqrt(length);
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            R[3 * i + j] = (1 - c) * a[i] * a[j] + (i == j ? c : 0);
        }
    }
    R[1] -= s * a[2];
    R[2] += s * a[1];
    R[3] += s * a[2];
    R[5] -= s * a[0];
    R[6] -= s * a[1];
    R[7] += s * a[0];
}

#endif
