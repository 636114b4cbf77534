/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact engine "native": makes the surfaces ready once, then for each pair finds where the second
 * is and how it moves seen from the first, lets contact/native_pairs.h find the force, and brings
 * it back to the world.
 */
#include "base/vec3.h"
#include "contact/contact.h"
#include "contact/native_kernels.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

struct surface {
    int body;
    enum contact_shape shape;
    double position[3], rotation[9]; /* in the body */
    double radius;                   /* of a sphere */
    double center[3], reach;         /* a ball about all of it, in its frame */
    const struct solid *solid;       /* box and mesh */
};

/* A surface's pose and velocity in the world. */
struct pose {
    double R[9], p[3], w[3], v[3];
    double center[3]; /* of the ball */
};

enum pair_kind {
    PAIR_HERTZ_SPHERES,
    PAIR_HERTZ_HALF_SPACE,
    PAIR_MESH_HALF_SPACE,
    PAIR_MESH_SPHERE,
    PAIR_MESHES,
};

struct pair {
    enum pair_kind kind;
    int surface[2]; /* in the order in which contact/native_pairs.h takes them */
    const struct native_kernels *kernels;
    double sign; /* of the force on the configured pair's b, from that on the first */
    struct native_law law;
};

/* Where the springs of a pair in touch are in the batch. */
struct springs {
    size_t from, to;
};

struct engine {
    struct contact_world world; /* first */
    bool centroids;             /* springs as Simbody has them */
    size_t nbody, nsurface, npair, npatch;
    struct surface *surface;
    struct pose *pose;
    struct pair *pair;
    struct contact_patch *patch;
    struct springs *springs; /* of each patch */
    struct native_scratch *scratch;
    char failure[128];
};

static const struct body_motion world_at_rest = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};

/* ---- evaluating ---- */

static void place(const struct surface *s, const struct body_motion *m, struct pose *pose)
{
    double arm[3], turn[3];

    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) {
            pose->R[3 * r + c] = m->R[3 * r] * s->rotation[c] +
                                 m->R[3 * r + 1] * s->rotation[3 + c] +
                                 m->R[3 * r + 2] * s->rotation[6 + c];
        }
    }
    mat3_apply(m->R, s->position, arm);
    vec3_add_scaled(arm, 1, m->p, pose->p);
    vec3_cross(m->w, arm, turn);
    vec3_add_scaled(m->v, 1, turn, pose->v);
    memcpy(pose->w, m->w, sizeof pose->w);
    mat3_apply(pose->R, s->center, pose->center);
    vec3_add_scaled(pose->center, 1, pose->p, pose->center);
}

/* Whether the balls about two surfaces meet. */
static bool near(const struct engine *e, const struct pair *pair)
{
    const struct surface *a = &e->surface[pair->surface[0]], *b = &e->surface[pair->surface[1]];
    const struct pose *pa = &e->pose[pair->surface[0]], *pb = &e->pose[pair->surface[1]];
    double apart[3], reach = a->reach + b->reach;

    vec3_sub(pa->center, pb->center, apart);
    if (b->shape == CONTACT_HALF_SPACE) {
        return pb->R[2] * apart[0] + pb->R[5] * apart[1] + pb->R[8] * apart[2] < a->reach;
    }
    return vec3_dot(apart, apart) < reach * reach;
}

static void relate(const struct pose *a, const struct pose *b, struct native_relative *relative)
{
    double arm[3], w[3], v[3], turn[3];

    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) {
            relative->R[3 * r + c] =
                a->R[r] * b->R[c] + a->R[3 + r] * b->R[3 + c] + a->R[6 + r] * b->R[6 + c];
        }
    }
    vec3_sub(b->p, a->p, arm);
    mat3_apply_transposed(a->R, arm, relative->p);
    /* the second body's velocity at the first's origin */
    vec3_cross(b->w, arm, turn);
    vec3_sub(a->v, b->v, v);
    vec3_add_scaled(v, 1, turn, v);
    vec3_sub(a->w, b->w, w);
    mat3_apply_transposed(a->R, w, relative->w);
    mat3_apply_transposed(a->R, v, relative->v);
}

static void press(const struct engine *e, const struct pair *pair,
                  const struct native_relative *relative, struct native_sum *sum)
{
    const struct surface *a = &e->surface[pair->surface[0]], *b = &e->surface[pair->surface[1]];
    const double radius[2] = {a->radius, b->shape == CONTACT_SPHERE ? b->radius : HUGE_VAL};
    struct native_scratch *s = e->scratch;

    switch (pair->kind) {
    case PAIR_HERTZ_SPHERES:
    case PAIR_HERTZ_HALF_SPACE:
        pair->kernels->hertz(radius, &pair->law, relative, s, sum);
        break;
    case PAIR_MESH_HALF_SPACE:
        pair->kernels->half_space[e->centroids](a->solid, &pair->law, relative, s, sum);
        break;
    case PAIR_MESH_SPHERE:
        pair->kernels->sphere[e->centroids](a->solid, b->radius, &pair->law, relative, s, sum);
        break;
    case PAIR_MESHES:
        pair->kernels->meshes[e->centroids](a->solid, b->solid, &pair->law, relative, s, sum);
        break;
    }
}

static void add_wrench(const struct engine *e, int surface, const double force[3],
                       const double moment[3], const double at[3], double sign,
                       const struct body_motion *motion, struct contact_wrench *wrench)
{
    int body = e->surface[surface].body;
    double arm[3], turn[3];

    if (body < 0) {
        return;
    }
    vec3_sub(at, motion[body].p, arm);
    vec3_cross(arm, force, turn);
    vec3_add_scaled(wrench[body].force, sign, force, wrench[body].force);
    vec3_add_scaled(wrench[body].moment, sign, moment, wrench[body].moment);
    vec3_add_scaled(wrench[body].moment, sign, turn, wrench[body].moment);
}

/* Adds what a pair in touch does to its bodies and to the patches. */
static void collect(struct engine *e, size_t index, const struct native_sum *sum,
                    const struct body_motion *motion, struct contact_wrench *wrench)
{
    const struct pair *pair = &e->pair[index];
    const struct pose *a = &e->pose[pair->surface[0]];
    struct contact_patch *patch = &e->patch[e->npatch++];
    double center[3] = {0, 0, 0}, force[3], moment[3], about[3], turn[3];

    /* about the middle of the pressure: nothing large is added to take off again */
    if (sum->normal > 0) {
        vec3_add_scaled(center, 1 / sum->normal, sum->lever, center);
    }
    vec3_cross(center, sum->force, turn);
    vec3_sub(sum->moment, turn, about);
    mat3_apply(a->R, sum->force, force);
    mat3_apply(a->R, about, moment);
    mat3_apply(a->R, center, patch->center);
    vec3_add_scaled(patch->center, 1, a->p, patch->center);
    add_wrench(e, pair->surface[0], force, moment, patch->center, 1, motion, wrench);
    add_wrench(e, pair->surface[1], force, moment, patch->center, -1, motion, wrench);

    patch->pair = (int)index;
    for (int k = 0; k < 3; ++k) {
        patch->force[k] = pair->sign * force[k];
        patch->moment[k] = pair->sign * moment[k];
    }
    patch->area_m2 = sum->area;
    patch->penetration_m = sum->depth;
    patch->potential_j = sum->potential;
    patch->dissipation_w = sum->power;
}

static enum error_code engine_evaluate(struct contact_world *world,
                                       const struct body_motion *motion,
                                       struct contact_wrench *wrench)
{
    struct engine *e = (struct engine *)world;

    for (size_t b = 0; b < e->nbody; ++b) {
        if (!contact_motion_valid(&motion[b])) {
            snprintf(e->failure, sizeof e->failure,
                     "contact: found a motion of body %zu that is none, expected a rotation and "
                     "finite numbers",
                     b);
            return ERROR_INPUT;
        }
        wrench[b] = (struct contact_wrench){{0}, {0}};
    }
    for (size_t i = 0; i < e->nsurface; ++i) {
        const struct surface *s = &e->surface[i];

        if (s->body >= 0) {
            place(s, &motion[s->body], &e->pose[i]);
        }
    }
    e->npatch = 0;
    e->scratch->batch.n = e->scratch->batch.start = 0;
    e->scratch->batch.full = false;
    for (size_t i = 0; i < e->npair; ++i) {
        const struct pair *pair = &e->pair[i];
        struct native_relative relative;
        struct native_sum sum = {.depth = 0};
        struct native_batch *batch = &e->scratch->batch;
        const size_t from = (batch->n + BATCH_ALIGN - 1) / BATCH_ALIGN * BATCH_ALIGN;

        batch->n = batch->start = from;

        if (near(e, pair)) {
            relate(&e->pose[pair->surface[0]], &e->pose[pair->surface[1]], &relative);
            press(e, pair, &relative, &sum);
        }
        if (sum.area > 0) {
            e->springs[e->npatch] = (struct springs){from, batch->n};
            collect(e, i, &sum, motion, wrench);
        }
    }
    return ERROR_NONE;
}

static size_t engine_patches(struct contact_world *world, struct contact_patch *patch, size_t max)
{
    const struct engine *e = (const struct engine *)world;

    for (size_t i = 0; i < e->npatch && i < max; ++i) {
        patch[i] = e->patch[i];
    }
    return e->npatch;
}

/* What the springs of a pair in touch add to a tangent: those of the last evaluation, or the same
 * found once more where it had no room for them all. */
static void resist(const struct engine *e, size_t patch, const struct native_relative *relative,
                   struct native_sum *sum)
{
    const struct pair *pair = &e->pair[e->patch[patch].pair];
    struct native_batch *batch = &e->scratch->batch;

    if (batch->full) {
        batch->n = batch->start = 0;
        press(e, pair, relative, sum);
    } else {
        batch->start = e->springs[patch].from;
        batch->n = e->springs[patch].to;
        pair->kernels->sum(batch, &pair->law, relative, sum);
    }
}

static size_t engine_tangents(struct contact_world *world, struct contact_tangent *tangent,
                              size_t max)
{
    const struct engine *e = (const struct engine *)world;

    for (size_t i = 0; i < e->npatch && i < max; ++i) {
        const struct pair *pair = &e->pair[e->patch[i].pair];
        const struct pose *a = &e->pose[pair->surface[0]];
        bool turned = pair->sign > 0; /* the configured pair's a is our second */
        struct native_relative relative;
        struct native_sum sum = {.tangent = &tangent[i], .turn = a->R};
        double arm[3];

        tangent[i] = (struct contact_tangent){
            .pair = e->patch[i].pair,
            .body_a = e->surface[pair->surface[turned]].body,
            .body_b = e->surface[pair->surface[!turned]].body,
        };
        vec3_sub(e->patch[i].center, a->p, arm);
        mat3_apply_transposed(a->R, arm, tangent[i].center);
        relate(a, &e->pose[pair->surface[1]], &relative);
        resist(e, i, &relative, &sum);
        memcpy(tangent[i].center, e->patch[i].center, sizeof tangent[i].center);
    }
    return e->npatch;
}

static const char *engine_failure(const struct contact_world *world)
{
    return ((const struct engine *)world)->failure;
}

/* Everything is the arena's. */
static void engine_destroy(struct contact_world *world)
{
    (void)world;
}

static const struct contact_ops overlap_ops = {
    .name = "native",
    .evaluate = engine_evaluate,
    .patches = engine_patches,
    .tangents = engine_tangents,
    .failure = engine_failure,
    .destroy = engine_destroy,
};

static const struct contact_ops centroid_ops = {
    .name = "native-centroids",
    .evaluate = engine_evaluate,
    .patches = engine_patches,
    .tangents = engine_tangents,
    .failure = engine_failure,
    .destroy = engine_destroy,
};

/* ---- making ---- */

static double harmonic(double a, double b)
{
    return a * b > 0 ? 2 * a * b / (a + b) : 0;
}

static struct native_law make_law(const struct contact_material *a,
                                  const struct contact_material *b, double transition)
{
    double ka = a->young_pa / a->thickness_m, kb = b->young_pa / b->thickness_m;
    double ha = pow(a->young_pa, 2.0 / 3), hb = pow(b->young_pa, 2.0 / 3);
    double s = kb / (ka + kb), hs = hb / (ha + hb);

    return (struct native_law){
        .stiffness = ka * s,
        .dissipation = s * a->dissipation_s_per_m + (1 - s) * b->dissipation_s_per_m,
        .share = {s, 1 - s},
        .us = harmonic(a->static_friction, b->static_friction),
        .ud = harmonic(a->dynamic_friction, b->dynamic_friction),
        .uv = harmonic(a->viscous_friction, b->viscous_friction),
        .transition_inverse = 1 / transition,
        .hertz = pow(ha * hs, 1.5),
        .hertz_share = hs,
    };
}

static bool is_mesh(enum contact_shape shape)
{
    return shape == CONTACT_BOX || shape == CONTACT_MESH;
}

/* Which of two surfaces comes first: a mesh before a sphere before a half-space. */
static int rank(enum contact_shape shape)
{
    return is_mesh(shape) ? 0 : shape == CONTACT_SPHERE ? 1 : 2;
}

/* The best that this machine has. A sphere has four springs, which do not fill more than four lanes:
 * wider ones would only take longer to add up. */
static const struct native_kernels *choose_kernels(enum pair_kind kind)
{
#if defined(NATIVE_VARIANTS)
    bool many = kind == PAIR_MESH_HALF_SPACE || kind == PAIR_MESHES;

    __builtin_cpu_init();
    if (many && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq")) {
        return &native_kernels_avx512;
    }
    if (__builtin_cpu_supports("avx2")) {
        return &native_kernels_avx2;
    }
#else
    (void)kind;
#endif
    return &native_kernels;
}

static void make_pair(const struct contact_config *config, size_t index,
                      const struct native_kernels *kernels, struct pair *pair)
{
    const struct contact_pair *given = &config->pair[index];
    bool turned = rank(config->surface[given->b].shape) < rank(config->surface[given->a].shape);
    const struct contact_surface *a = &config->surface[turned ? given->b : given->a];
    const struct contact_surface *b = &config->surface[turned ? given->a : given->b];

    pair->surface[0] = turned ? given->b : given->a;
    pair->surface[1] = turned ? given->a : given->b;
    pair->sign = turned ? 1 : -1;
    pair->law = make_law(&a->material, &b->material, config->transition_velocity_m_s);
    if (is_mesh(a->shape)) {
        pair->kind = is_mesh(b->shape)            ? PAIR_MESHES
                     : b->shape == CONTACT_SPHERE ? PAIR_MESH_SPHERE
                                                  : PAIR_MESH_HALF_SPACE;
    } else {
        double share = pair->law.hertz_share;

        pair->kind = b->shape == CONTACT_SPHERE ? PAIR_HERTZ_SPHERES : PAIR_HERTZ_HALF_SPACE;
        pair->law.dissipation = 1.5 * (share * a->material.dissipation_s_per_m +
                                       (1 - share) * b->material.dissipation_s_per_m);
    }
    pair->kernels = kernels ? kernels : choose_kernels(pair->kind);
}

static enum error_code no_memory(struct error *error)
{
    return error_set(error, ERROR_MEMORY, "contact: no memory for the engine");
}

/* The same mesh on several surfaces is made ready once. */
static const struct solid *known_solid(const struct contact_config *config, size_t index,
                                       const struct surface *surface)
{
    for (size_t i = 0; i < index; ++i) {
        if (config->surface[i].shape == CONTACT_MESH &&
            config->surface[i].mesh == config->surface[index].mesh) {
            return surface[i].solid;
        }
    }
    return NULL;
}

static enum error_code make_solid(const struct contact_config *config, size_t index,
                                  struct arena *arena, struct surface *surface, struct error *error)
{
    const struct contact_surface *given = &config->surface[index];
    struct surface *s = &surface[index];
    const struct mesh *mesh = given->mesh;
    struct solid *solid;
    enum error_code code = ERROR_NONE;

    if (given->shape == CONTACT_BOX) {
        code = mesh_box(given->half_extent_m, given->cells_per_edge, arena, &mesh, error);
    } else {
        s->solid = known_solid(config, index, surface);
    }
    if (!code && !s->solid) {
        solid = arena_alloc(arena, 1, sizeof *solid);
        code = solid ? solid_make(mesh, arena, solid, error) : no_memory(error);
        s->solid = solid;
    }
    for (int k = 0; k < 3 && !code; ++k) {
        s->center[k] = (s->solid->box.low[k] + s->solid->box.high[k]) / 2;
    }
    for (size_t v = 0; !code && v < mesh->nvertex; ++v) {
        double to[3];

        vec3_sub(mesh->vertex[v], s->center, to);
        s->reach = fmax(s->reach, vec3_norm(to));
    }
    return code;
}

static enum error_code make_surface(const struct contact_config *config, size_t index,
                                    struct arena *arena, struct engine *e, struct error *error)
{
    const struct contact_surface *given = &config->surface[index];
    struct surface *s = &e->surface[index];

    s->body = given->body;
    s->shape = given->shape;
    s->radius = s->reach = given->shape == CONTACT_SPHERE ? given->radius_m : 0;
    memcpy(s->position, given->position, sizeof s->position);
    memcpy(s->rotation, given->rotation, sizeof s->rotation);
    if (is_mesh(given->shape)) {
        enum error_code code = make_solid(config, index, arena, e->surface, error);

        if (code) {
            return code;
        }
    }
    if (s->body < 0) {
        place(s, &world_at_rest, &e->pose[index]);
    }
    return ERROR_NONE;
}

static enum error_code make_scratch(struct engine *e, struct arena *arena, struct error *error)
{
    struct native_scratch *s = e->scratch = arena_alloc(arena, 1, sizeof *e->scratch);
    struct native_view *view;
    size_t most = 1, padded;
    bool made;

    for (size_t i = 0; i < e->nsurface; ++i) {
        if (e->surface[i].solid && e->surface[i].solid->nface > most) {
            most = e->surface[i].solid->nface;
        }
    }
    if (!s) {
        return no_memory(error);
    }
    view = &s->view;
    padded = (most + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES;
    view->radius = arena_alloc(arena, padded, sizeof *view->radius);
    view->ring = arena_alloc(arena, most, sizeof *view->ring);
    view->corner = arena_alloc(arena, 3 * most, sizeof *view->corner);
    made = view->radius && view->ring && view->corner;
    for (int k = 0; k < 3; ++k) {
        view->normal[k] = arena_alloc(arena, padded, sizeof **view->normal);
        view->center[k] = arena_alloc(arena, padded, sizeof **view->center);
        made = made && view->normal[k] && view->center[k];
    }
    for (int i = 0; i < 2; ++i) {
        s->list[i] = arena_alloc(arena, most, sizeof **s->list);
        s->mark[i] = arena_alloc(arena, most, 1);
        made = made && s->list[i] && s->mark[i];
    }
    return made ? ERROR_NONE : no_memory(error);
}

static enum error_code make_engine(const struct contact_config *config, bool centroids,
                                   const struct native_kernels *kernels, struct arena *arena,
                                   struct contact_world **world, struct error *error)
{
    enum error_code code = contact_config_check(config, error);
    struct engine *e;

    if (code) {
        return code;
    }
    e = arena_alloc(arena, 1, sizeof *e);
    if (!e) {
        return no_memory(error);
    }
    e->world.ops = centroids ? &centroid_ops : &overlap_ops;
    e->centroids = centroids;
    e->nbody = config->nbody;
    e->nsurface = config->nsurface;
    e->npair = config->npair;
    /* one more of each: an empty scene is one too */
    e->surface = arena_alloc(arena, e->nsurface + 1, sizeof *e->surface);
    e->pose = arena_alloc(arena, e->nsurface + 1, sizeof *e->pose);
    e->pair = arena_alloc(arena, e->npair + 1, sizeof *e->pair);
    e->patch = arena_alloc(arena, e->npair + 1, sizeof *e->patch);
    e->springs = arena_alloc(arena, e->npair + 1, sizeof *e->springs);
    if (!e->surface || !e->pose || !e->pair || !e->patch || !e->springs) {
        return no_memory(error);
    }
    for (size_t i = 0; !code && i < e->nsurface; ++i) {
        code = make_surface(config, i, arena, e, error);
    }
    for (size_t i = 0; !code && i < e->npair; ++i) {
        make_pair(config, i, kernels, &e->pair[i]);
    }
    if (!code) {
        code = make_scratch(e, arena, error);
    }
    if (!code) {
        *world = &e->world;
    }
    return code;
}

enum error_code contact_native_create(const struct contact_config *config, struct arena *arena,
                                      struct contact_world **world, struct error *error)
{
    return make_engine(config, false, NULL, arena, world, error);
}

enum error_code native_create_with_kernels(const struct contact_config *config,
                                           const struct native_kernels *kernels,
                                           struct arena *arena, struct contact_world **world,
                                           struct error *error)
{
    return make_engine(config, false, kernels, arena, world, error);
}

enum error_code contact_native_create_centroids(const struct contact_config *config,
                                                struct arena *arena, struct contact_world **world,
                                                struct error *error)
{
    return make_engine(config, true, NULL, arena, world, error);
}
