/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Creates the contact engine "native": prepares surfaces, computes the constants of each pair's
 * law, selects kernels, and allocates the working memory of evaluations.
 */
#include "contact/native/private.h"
#include "contact/mesh/solid_store.h"
#include "base/instruction_set.h"

static enum error_code native_no_memory(struct error *error)
{
    return error_set(error, ERROR_MEMORY, "contact: no memory for the engine");
}

/* ---- pairs ---- */

/* Returns the harmonic mean of two numbers; 0 if one is 0. */
static double law_harmonic_mean(double a, double b)
{
    return a * b > 0 ? 2 * a * b / (a + b) : 0;
}

/* Computes the constants of contact.h's law for two materials. transition: velocity of the friction
 * law, m/s. */
static struct native_law law_make(const struct contact_material *a,
                                  const struct contact_material *b, double transition)
{
    /* Stiffness of the layers in series, Pa/m; s and hs: share of the depth by which a is
     * compressed */
    double ka = a->young_pa / a->thickness_m, kb = b->young_pa / b->thickness_m;
    double ha = portable_pow(a->young_pa, 2.0 / 3), hb = portable_pow(b->young_pa, 2.0 / 3);
    double s = kb / (ka + kb), hs = hb / (ha + hb);
    double ba = a->backing_pa_per_m, bb = b->backing_pa_per_m;

    return (struct native_law){
        .stiffness = ka * s,
        .dissipation = s * a->dissipation_s_per_m + (1 - s) * b->dissipation_s_per_m,
        .share = {s, 1 - s},
        .us = law_harmonic_mean(a->static_friction, b->static_friction),
        .ud = law_harmonic_mean(a->dynamic_friction, b->dynamic_friction),
        .uv = law_harmonic_mean(a->viscous_friction, b->viscous_friction),
        .transition_inverse = 1 / transition,
        .hertz = portable_pow(ha * hs, 1.5),
        .hertz_share = hs,
        .layers = a->thickness_m + b->thickness_m,
        .backing = law_harmonic_mean(ba, bb) / 2,
    };
}

static bool shape_is_mesh(enum contact_shape shape)
{
    return shape == CONTACT_BOX || shape == CONTACT_MESH || shape == CONTACT_CYLINDER;
}

/* penetration over radius at which the area of a curved surface is computed */
#define NOMINAL_DEPTH 0.25

/* Stiffness of the bristles, relative to the normal stiffness of the layers. The layers in rigs are
 * softer than real soles: COMAN's rig has 8.3e7 Pa/m. Rubber soles with a shear modulus of 1 to 2
 * MPa, 3 to 5 mm thick, have 2e8 to 7e8 Pa/m in shear (docs/contact.md). */
#define SHEAR_RATIO 5.0

/* Returns the largest contact area of a surface on a flat one, m2: the largest side of its box;
 * for a curved surface, the area at a penetration of a quarter of its radius. Infinite for a
 * half-space. */
static double surface_nominal_area(const struct contact_surface *given,
                                   const struct native_surface *s)
{
    double side[3], width;

    switch (given->shape) {
    case CONTACT_HALF_SPACE:
        return (double)INFINITY;
    case CONTACT_SPHERE:
    case CONTACT_CAPSULE:
    case CONTACT_CYLINDER:
        width = given->radius_m * sqrt(8 * NOMINAL_DEPTH);
        return width * (width + (given->shape == CONTACT_SPHERE ? 0 : given->length_m));
    default:
        break;
    }
    vec3_sub(s->solid->box.high, s->solid->box.low, side);
    return fmax(side[0] * side[1], fmax(side[1] * side[2], side[2] * side[0]));
}

/* Returns the stiffness s of a pair's bristles, N/m: a constant, independent of the normal
 * force. */
static double pair_shear_stiffness(const struct contact_surface *a, const struct contact_surface *b,
                                   const struct native_pair *pair,
                                   const struct native_surface *surface)
{
    double radius;

    if (pair->kind == PAIR_HERTZ_SPHERES || pair->kind == PAIR_HERTZ_HALF_SPACE) {
        radius = pair->kind == PAIR_HERTZ_HALF_SPACE
                     ? a->radius_m
                     : a->radius_m * b->radius_m / (a->radius_m + b->radius_m);
        return SHEAR_RATIO * 2 * pair->law.hertz * radius * sqrt(NOMINAL_DEPTH);
    }
    return SHEAR_RATIO * pair->law.stiffness *
           fmin(surface_nominal_area(a, &surface[pair->surface[0]]),
                surface_nominal_area(b, &surface[pair->surface[1]]));
}

/* Returns the rank of a shape in a pair: mesh, capsule, sphere, half-space. */
static int shape_rank(enum contact_shape shape)
{
    return shape_is_mesh(shape)       ? 0
           : shape == CONTACT_CAPSULE ? 1
           : shape == CONTACT_SPHERE  ? 2
                                      : 3;
}

/* Returns the kind of a pair whose shapes are in the order of their ranks. meshes: kind of a pair
 * of two meshes. Against a mesh, a capsule is also a mesh, inside the pressure field of the other
 * mesh. A cylinder is a mesh, except on a half-space. */
static enum native_pair_kind pair_find_kind(enum contact_shape a, enum contact_shape b,
                                            enum native_pair_kind meshes)
{
    if (shape_is_mesh(a) && (a != CONTACT_CYLINDER || b != CONTACT_HALF_SPACE)) {
        return b == CONTACT_HALF_SPACE ? PAIR_MESH_HALF_SPACE
               : b == CONTACT_SPHERE   ? PAIR_MESH_SPHERE
                                       : meshes;
    }
    if (a == CONTACT_CAPSULE || a == CONTACT_CYLINDER) {
        return b == CONTACT_HALF_SPACE ? PAIR_CAPSULE_HALF_SPACE : PAIR_CAPSULES;
    }
    return b == CONTACT_SPHERE ? PAIR_HERTZ_SPHERES : PAIR_HERTZ_HALF_SPACE;
}

/* Returns whether a pair's b must be its first surface. In a pressure field the larger mesh is the
 * carrier. Otherwise the sides of a box on a table would soften its rim. */
static bool pair_is_turned(const struct contact_config *config, const struct contact_pair *pair,
                           const struct native_surface *surface)
{
    enum contact_shape a = config->surface[pair->a].shape, b = config->surface[pair->b].shape;

    if (shape_is_mesh(a) && shape_is_mesh(b)) {
        return config->mesh_law == CONTACT_PRESSURE_FIELD &&
               surface[pair->b].solid->radius > surface[pair->a].solid->radius;
    }
    return shape_rank(b) < shape_rank(a);
}

/* Returns the operations for the instruction set in use. */
static const struct contact_ops *native_ops_used(void)
{
#if defined(NATIVE_VARIANTS)
    switch (instruction_set_used()) {
    case INSTRUCTIONS_AVX512:
        return &native_ops_avx512;
    case INSTRUCTIONS_AVX2:
        return &native_ops_avx2;
    default:
        break;
    }
#endif
    return &native_ops;
}

/* ---- surfaces ---- */

/* Returns whether a surface has a pair with a mesh. */
static bool surface_meets_mesh(const struct contact_config *config, size_t index)
{
    for (size_t i = 0; i < config->npair; i++) {
        const struct contact_pair *pair = &config->pair[i];

        if (((size_t)pair->a == index && shape_is_mesh(config->surface[pair->b].shape)) ||
            ((size_t)pair->b == index && shape_is_mesh(config->surface[pair->a].shape))) {
            return true;
        }
    }
    return false;
}

/* Prepares the solid of a box, mesh, capsule or cylinder, and its bounding volumes. */
static enum error_code surface_make_solid(const struct contact_config *config, size_t index,
                                          struct arena *arena, struct native_surface *surface,
                                          struct error *error)
{
    const struct contact_surface *given = &config->surface[index];
    struct native_surface *s = &surface[index];
    const struct mesh *mesh = given->mesh;
    enum error_code code = ERROR_NONE;

    /* Makes the mesh */
    if (given->shape == CONTACT_BOX) {
        code = mesh_box(given->half_extent_m, given->cells_per_edge, arena, &mesh, error);
    } else if (given->shape != CONTACT_MESH) {
        code = mesh_capsule(given->radius_m, given->length_m, given->shape == CONTACT_CYLINDER,
                            arena, &mesh, error);
    }
    /* An earlier surface with the same mesh shares its solid, so that each mesh is prepared once */
    for (size_t i = 0; i < index && given->shape == CONTACT_MESH && !s->solid; i++) {
        s->solid = config->surface[i].shape == CONTACT_MESH && config->surface[i].mesh == mesh
                       ? surface[i].solid
                       : NULL;
    }

    /* Makes the solid, unless an earlier surface has made it */
    if (!code && !s->solid) {
        code = solid_store_find(mesh, arena, &s->solid, error);
    }
    if (code != ERROR_NONE) {
        return code;
    }

    /* Compute bounding ball and capsule about the middle of a mesh's box; the capsule is along the
     * longest side */
    const struct box *box = &s->solid->box;
    double middle[3], side[3], half, next = 0;
    int longest = 0;

    for (int k = 0; k < 3; k++) {
        middle[k] = (box->low[k] + box->high[k]) / 2;
        side[k] = (box->high[k] - box->low[k]) / 2;
        longest = side[k] > side[longest] ? k : longest;
    }
    for (int k = 0; k < 3; k++) {
        next = k != longest && side[k] > next ? side[k] : next;
    }
    half = side[longest] - next;

    /* Largest distance of a vertex from the middle (ball) and from the axis (capsule) */
    s->reach = s->about.radius = 0;
    for (size_t v = 0; v < mesh->nvertex; v++) {
        double to[3], along;

        vec3_sub(mesh->vertex[v], middle, to);
        s->reach = fmax(s->reach, vec3_norm(to));
        along = fmin(half, fmax(-half, to[longest]));
        to[longest] -= along;
        s->about.radius = fmax(s->about.radius, vec3_norm(to));
    }

    /* In the body's frame */
    mat3_apply(s->rotation, middle, s->center);
    vec3_add_scaled(s->center, 1, s->position, s->center);
    for (int k = 0; k < 3; k++) {
        s->about.half[k] = half * s->rotation[3 * k + longest];
    }

    return ERROR_NONE;
}

/* Prepares a surface: place on its body, bounding volumes, and a solid if it is a mesh or has a
 * pair with one. */
static enum error_code surface_make(const struct contact_config *config, size_t index,
                                    struct arena *arena, struct native_surface *surface,
                                    struct error *error)
{
    const struct contact_surface *given = &config->surface[index];
    struct native_surface *s = &surface[index];

    s->body = given->body;
    s->shape = given->shape;
    memcpy(s->position, given->position, sizeof s->position);
    memcpy(s->rotation, given->rotation, sizeof s->rotation);
    memcpy(s->center, given->position, sizeof s->center);

    /* A sphere is a capsule of length 0, and its own bounding volume */
    if (given->shape == CONTACT_SPHERE || given->shape == CONTACT_CAPSULE ||
        given->shape == CONTACT_CYLINDER) {
        s->capsule.radius = given->radius_m;
        s->capsule.half = given->shape == CONTACT_SPHERE ? 0 : given->length_m / 2;
        s->capsule.flat = given->shape == CONTACT_CYLINDER;
        s->reach = s->capsule.radius + s->capsule.half;
        s->about.radius = s->capsule.radius;
        for (int k = 0; k < 3; k++) {
            s->about.half[k] = s->capsule.half * s->rotation[3 * k + 2];
        }
    }
    if (shape_is_mesh(given->shape) ||
        (given->shape == CONTACT_CAPSULE && surface_meets_mesh(config, index))) {
        return surface_make_solid(config, index, arena, surface, error);
    }
    return ERROR_NONE;
}

/* Makes the pressure field of a surface, or reuses the field of another surface with the same
 * solid. */
static enum error_code surface_make_field(const struct contact_config *config, size_t index,
                                          struct arena *arena, struct native_surface *surface,
                                          struct error *error)
{
    struct native_surface *s = &surface[index];

    for (size_t i = 0; i < config->nsurface && !s->field; i++) {
        s->field = surface[i].solid == s->solid ? surface[i].field : NULL;
    }
    if (s->field) {
        return ERROR_NONE;
    }
    return solid_store_find_field(s->solid, config->surface[index].name, arena, &s->field, error);
}

/* Returns an upper bound of the depth in a solid, m: the radius of a ball inside is at most half
 * of the solid's smallest extent. */
static double solid_deepest_bound(const struct solid *s)
{
    double least = s->radius;

    for (int k = 0; k < 3; k++) {
        least = fmin(least, (s->box.high[k] - s->box.low[k]) / 2);
    }
    return least;
}

/* Makes the pressure fields that the pairs need: the first surface's, and the second's if it may
 * be deeper and is not a capsule. */
static enum error_code fields_make(const struct contact_config *config, struct arena *arena,
                                   struct native_engine *e, struct error *error)
{
    for (size_t i = 0; i < e->npair; i++) {
        const int *side = e->pair[i].surface;
        const struct solid *second = e->surface[side[1]].solid;
        enum error_code code;

        if (e->pair[i].kind != PAIR_FIELDS) {
            continue;
        }
        code = surface_make_field(config, (size_t)side[0], arena, e->surface, error);
        if (code == ERROR_NONE && e->surface[side[1]].shape != CONTACT_CAPSULE &&
            solid_deepest_bound(second) > e->surface[side[0]].field->deepest) {
            code = surface_make_field(config, (size_t)side[1], arena, e->surface, error);
        }
        if (code != ERROR_NONE) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* ---- memory ---- */

/* Allocates the working memory of evaluations, with room for the facets of the largest mesh. */
static enum error_code scratch_make(struct native_engine *e, struct arena *arena,
                                    struct error *error)
{
    struct native_scratch *s = e->scratch = arena_alloc(arena, 1, sizeof *e->scratch);
    struct native_view *view;
    size_t most = 1, padded;
    bool made;

    if (!s) {
        return native_no_memory(error);
    }

    /* No mesh has more facets than faces */
    for (size_t i = 0; i < e->nsurface; i++) {
        if (e->surface[i].solid && e->surface[i].solid->nface > most) {
            most = e->surface[i].solid->nface;
        }
    }

    /* Lists and view have the same size, padded because lanes read several entries at a time */
    view = &s->view;
    padded = (most + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES;
    view->radius = arena_alloc(arena, padded, sizeof *view->radius);
    view->ring = arena_alloc(arena, most, sizeof *view->ring);
    view->corner = arena_alloc(arena, 3 * most, sizeof *view->corner);
    made = view->radius && view->ring && view->corner;
    for (int k = 0; k < 3; k++) {
        view->normal[k] = arena_alloc(arena, padded, sizeof **view->normal);
        view->center[k] = arena_alloc(arena, padded, sizeof **view->center);
        made = made && view->normal[k] && view->center[k];
    }
    for (int i = 0; i < 2; i++) {
        s->list[i] = arena_alloc(arena, most, sizeof **s->list);
        made = made && s->list[i];
    }
    return made ? ERROR_NONE : native_no_memory(error);
}

/* Allocates an engine with empty arrays; returns NULL without memory. */
static struct native_engine *engine_alloc(const struct contact_config *config, struct arena *arena)
{
    struct native_engine *e = arena_alloc(arena, 1, sizeof *e);

    if (!e) {
        return NULL;
    }
    e->nbody = config->nbody;
    e->nsurface = config->nsurface;
    e->npair = config->npair;

    /* One element more, since an empty scene needs arrays too */
    e->surface = arena_alloc(arena, e->nsurface + 1, sizeof *e->surface);
    e->pose = arena_alloc(arena, e->nsurface + 1, sizeof *e->pose);
    e->pair = arena_alloc(arena, e->npair + 1, sizeof *e->pair);
    e->patch = arena_alloc(arena, e->npair + 1, sizeof *e->patch);
    e->springs = arena_alloc(arena, e->npair + 1, sizeof *e->springs);
    e->placed = arena_alloc(arena, e->nsurface + 1, sizeof *e->placed);
    e->near = arena_alloc(arena, e->npair / 64 + 1, sizeof *e->near);
    if (config->friction == CONTACT_FRICTION_STICKING) {
        e->world.nbristle = CONTACT_BRISTLE * e->npair;
        e->sticking = arena_alloc(arena, e->npair + 1, sizeof *e->sticking);
        if (!e->sticking) {
            return NULL;
        }
    }
    return e->surface && e->pose && e->pair && e->patch && e->springs && e->placed && e->near
               ? e
               : NULL;
}

enum error_code contact_native_create(const struct contact_config *config, struct arena *arena,
                                      struct contact_world **world, struct error *error)
{
    struct native_engine *e = engine_alloc(config, arena);
    enum error_code code = e ? ERROR_NONE : native_no_memory(error);

    /* Prepares the surfaces, then the pairs */
    for (size_t i = 0; !code && i < e->nsurface; i++) {
        code = surface_make(config, i, arena, e->surface, error);
    }
    code = code ? code : broad_phase_make(config, arena, &e->broad, error);
    if (code) {
        return code;
    }
    e->world.ops = native_ops_used();
    native_place_fixed_surfaces(e);
    for (size_t i = 0; i < e->npair; i++) {
        /* Prepare a pair: order of its surfaces, law and kind */
        struct native_pair *pair = &e->pair[i];
        const enum native_pair_kind meshes =
            config->mesh_law == CONTACT_PRESSURE_FIELD ? PAIR_FIELDS : PAIR_MESHES;
        const struct contact_pair *given = &config->pair[i];
        bool turned = pair_is_turned(config, given, e->surface);
        const struct contact_surface *a = &config->surface[turned ? given->b : given->a];
        const struct contact_surface *b = &config->surface[turned ? given->a : given->b];

        /* Surfaces in the order of the kernels */
        pair->surface[0] = turned ? given->b : given->a;
        pair->surface[1] = turned ? given->a : given->b;
        pair->sign = turned ? 1 : -1;
        pair->slack = given->slack_m;

        /* Law, with Hertz's shares between surfaces without a mesh */
        pair->law = law_make(&a->material, &b->material, config->transition_velocity_m_s);
        pair->kind = pair_find_kind(a->shape, b->shape, meshes);
        if (pair->kind == PAIR_HERTZ_SPHERES || pair->kind == PAIR_HERTZ_HALF_SPACE) {
            double share = pair->law.hertz_share;

            pair->law.dissipation = 1.5 * (share * a->material.dissipation_s_per_m +
                                           (1 - share) * b->material.dissipation_s_per_m);
        }

        /* Sticking friction: the surface that holds the anchor, and its place on the normal */
        pair->onto = native_pair_is_one_way(pair) ? -pair->law.share[0]
                     : pair->kind == PAIR_FIELDS  ? pair->law.share[1]
                                                  : 0;
        pair->anchored = pair->kind == PAIR_FIELDS || pair->kind == PAIR_MESH_SPHERE;
        pair->law.shear_root = sqrt(pair_shear_stiffness(a, b, pair, e->surface));
    }

    /* Makes the fields, which need the order of each pair's surfaces, and the working memory for
     * the largest surface */
    code = fields_make(config, arena, e, error);
    code = code ? code : scratch_make(e, arena, error);
    if (!code) {
        *world = &e->world;
    }
    return code;
}
