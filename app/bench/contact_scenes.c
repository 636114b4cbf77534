/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the contact scenes of the benchmarks. */
#include "app/bench/bench.h"

#include "base/array.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Foot and ground use the materials of the paper's walking code. The box uses the material of the
 * paper's Table 2. */
static const struct contact_material foot_material = {1e5, 2e-4, 10, 1.1, 0.9, 0, 0};
static const struct contact_material ground_material = {1e5, 1e-3, 10, 1.1, 0.9, 0, 0};
static const struct contact_material box_material = {1e4, 1e-3, 10, 1.1, 0.9, 0.5, 0};

/* Returns a random number from -1 to 1 (xorshift64*), and advances the seed, which must not be
 * 0. */
static double random_number(uint64_t *seed)
{
    *seed ^= *seed >> 12;
    *seed ^= *seed << 25;
    *seed ^= *seed >> 27;
    return (double)((*seed * 2685821657736338717u) >> 11) / 4503599627370496.0 - 1;
}

/* Begins a scene without surfaces. target_us: target time of an evaluation; 0 = none. */
static struct bench_scene *begin_scene(struct bench_scene *scene, const char *name, size_t nbody,
                                       double target_us)
{
    *scene = (struct bench_scene){.name = name, .target_us = target_us};
    scene->config = (struct contact_config){.nbody = nbody,
                                            .surface = scene->surface,
                                            .pair = scene->pair,
                                            .transition_velocity_m_s = 0.1};
    return scene;
}

/* Adds a surface at the origin of a body; body -1 is the world. */
static struct contact_surface *add_surface(struct bench_scene *scene, int body,
                                           enum contact_shape shape,
                                           const struct contact_material *material)
{
    struct contact_surface *s = &scene->surface[scene->config.nsurface++];

    *s = (struct contact_surface){.name = "surface",
                                  .body = body,
                                  .shape = shape,
                                  .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                  .material = *material};
    return s;
}

/* Adds a mesh to a body. */
static void add_mesh(struct bench_scene *scene, int body, const struct mesh *mesh,
                     const struct contact_material *material)
{
    add_surface(scene, body, CONTACT_MESH, material)->mesh = mesh;
    scene->faces += mesh->nface;
}

/* Adds a box with half sides in m. Each face is divided into cells x cells squares of two
 * triangles. */
static struct contact_surface *add_box(struct bench_scene *scene, int body, double x, double y,
                                       double z, int cells, const struct contact_material *material)
{
    struct contact_surface *s = add_surface(scene, body, CONTACT_BOX, material);

    s->half_extent_m[0] = x;
    s->half_extent_m[1] = y;
    s->half_extent_m[2] = z;
    s->cells_per_edge = cells;
    scene->faces += 12 * (size_t)(cells * cells);
    return s;
}

/* Adds a pair of surfaces that may touch. */
static void add_pair(struct bench_scene *scene, int a, int b)
{
    scene->pair[scene->config.npair++] = (struct contact_pair){.a = a, .b = b};
}

/* Sets the position, m, at which a body touches. */
static void scene_place_body(struct bench_scene *scene, int body, double x, double y, double z)
{
    memcpy(scene->place[body], (double[3]){x, y, z}, sizeof scene->place[body]);
}

/* Makes a block of ground with 4 mm bumps every 15 cm, from cells x cells squares of 2.5 cm.
 * Returns NULL without memory. */
static const struct mesh *make_terrain(struct arena *arena, int cells, struct error *error)
{
    const double side = cells * 0.0125, half[3] = {side, side, 0.05};
    const struct mesh *box;
    struct mesh *mesh = arena_alloc(arena, 1, sizeof *mesh);
    double(*vertex)[3];

    if (!mesh || mesh_box(half, cells, arena, &box, error)) {
        return NULL;
    }
    vertex = arena_alloc(arena, box->nvertex, sizeof *vertex);
    if (!vertex) {
        return NULL;
    }

    /* Move only the vertices of the top side */
    for (size_t v = 0; v < box->nvertex; v++) {
        memcpy(vertex[v], box->vertex[v], sizeof vertex[v]);
        if (vertex[v][2] > 0.0499) {
            vertex[v][2] += 0.004 * sin(42 * vertex[v][0]) * cos(42 * vertex[v][1]);
        }
    }
    *mesh = *box;
    mesh->name = "terrain";
    mesh->vertex = (const double(*)[3])vertex;
    return mesh;
}

/* Makes the paper's scene: two feet on the ground, and a box on a table between the spheres of two
 * wrists. */
static void make_five_bodies(struct bench_scene *s, const struct mesh *foot)
{
    const double top = 0.475;

    begin_scene(s, "five bodies of the paper", BENCH_BODIES, 6);
    add_surface(s, -1, CONTACT_HALF_SPACE, &ground_material);
    add_mesh(s, 0, foot, &foot_material);
    add_mesh(s, 1, foot, &foot_material);
    add_box(s, -1, 0.2, 0.3, 0.02, 1, &box_material)->position[2] = top - 0.02;
    add_box(s, 2, 0.075, 0.075, 0.075, 7, &box_material);
    add_surface(s, 3, CONTACT_SPHERE, &box_material)->radius_m = 0.02;
    add_surface(s, 4, CONTACT_SPHERE, &box_material)->radius_m = 0.02;
    add_pair(s, 0, 1);
    add_pair(s, 0, 2);
    add_pair(s, 3, 4);
    add_pair(s, 4, 5);
    add_pair(s, 4, 6);
    scene_place_body(s, 0, 0, -0.0726, 0.0932 - 5e-4);
    scene_place_body(s, 1, 0, 0.0726, 0.0932 - 5e-4);
    scene_place_body(s, 2, 0.013, -0.021, top + 0.075 - 5e-4);
    scene_place_body(s, 3, 0.02, -0.021 - 0.075 - 0.02 + 1.3e-2, top + 0.09);
    scene_place_body(s, 4, 0.02, -0.021 + 0.075 + 0.02 - 1.3e-2, top + 0.09);
}

enum error_code bench_scenes_make(struct bench_scene scene[BENCH_SCENES], size_t *nscene,
                                  const struct mesh *foot, struct arena *arena, struct error *error)
{
    static const int cells[] = {3, 9, 29, 91};
    struct bench_scene *next = scene, *s = begin_scene(next++, "foot on half-space", 1, 0.6);

    /* Scenes with one pair of surfaces; bodies penetrate by 0.5 or 1 mm */
    add_surface(s, -1, CONTACT_HALF_SPACE, &ground_material);
    add_mesh(s, 0, foot, &foot_material);
    add_pair(s, 0, 1);
    scene_place_body(s, 0, 0, 0, 0.0932 - 5e-4);

    s = begin_scene(next++, "box on half-space", 1, 0);
    add_surface(s, -1, CONTACT_HALF_SPACE, &box_material);
    add_box(s, 0, 0.075, 0.075, 0.075, 7, &box_material);
    add_pair(s, 0, 1);
    scene_place_body(s, 0, 0, 0, 0.075 - 5e-4);

    s = begin_scene(next++, "box on table", 1, 4);
    add_box(s, -1, 0.2, 0.3, 0.02, 1, &box_material);
    add_box(s, 0, 0.075, 0.075, 0.075, 7, &box_material);
    add_pair(s, 0, 1);
    scene_place_body(s, 0, 0.013, -0.021, 0.095 - 5e-4);

    s = begin_scene(next++, "sphere on box", 1, 0.4);
    add_box(s, -1, 0.075, 0.075, 0.075, 7, &box_material);
    add_surface(s, 0, CONTACT_SPHERE, &box_material)->radius_m = 0.02;
    add_pair(s, 0, 1);
    scene_place_body(s, 0, 0.01, -0.02, 0.095 - 1e-3);

    make_five_bodies(next++, foot);

    /* The foot on terrains with an increasing number of triangles */
    for (size_t i = 0; i < ARRAY_COUNT(cells); i++) {
        const struct mesh *terrain = make_terrain(arena, cells[i], error);

        if (!terrain) {
            return error_set(error, ERROR_MEMORY, "no memory for a terrain");
        }
        s = begin_scene(next++, "foot on terrain", 1, i + 1 == ARRAY_COUNT(cells) ? 3 : 0);
        add_mesh(s, -1, terrain, &ground_material);
        add_mesh(s, 0, foot, &foot_material);
        add_pair(s, 0, 1);
        scene_place_body(s, 0, 0, 0, 0.0535 + 0.0932 - 5e-4);
    }
    *nscene = (size_t)(next - scene);
    return ERROR_NONE;
}

void bench_scene_draw(const struct bench_scene *scene, uint64_t *seed,
                      struct body_motion motion[BENCH_BODIES])
{
    for (size_t b = 0; b < scene->config.nbody; b++) {
        struct body_motion *m = &motion[b];
        double q[4] = {1, 0, 0, 0};

        /* Small rotation as a quaternion, small displacement from the place, low velocities */
        for (int i = 0; i < 3; i++) {
            q[i + 1] = 1.5e-3 * random_number(seed);
            m->p[i] = scene->place[b][i] + (i < 2 ? 1e-2 : 3e-4) * random_number(seed);
            m->w[i] = 0.1 * random_number(seed);
            m->v[i] = 0.02 * random_number(seed);
        }
        mat3_from_quaternion(q, m->R);
    }
}
