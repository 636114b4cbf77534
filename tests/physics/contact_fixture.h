/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What tests of the contact engines share: an arena, COMAN's right foot, worlds of either engine,
 * turned motions, meshes made from a box. Include after cmocka.
 */
#ifndef TESTS_PHYSICS_CONTACT_FIXTURE_H
#define TESTS_PHYSICS_CONTACT_FIXTURE_H

#include "tests/physics/contact_scene.h"
#include "tests/physics/near.h"

static const double fixture_pi = 3.14159265358979323846;

static struct arena fixture_arena;
static const struct mesh *fixture_foot;

FIXTURE(fixture_set_up)
{
    struct error error;

    if (arena_init(&fixture_arena, (size_t)512 << 20, &error) != ERROR_NONE ||
        solid_store_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &fixture_arena,
                             &fixture_foot, &error) != ERROR_NONE) {
        print_error("%s\n", error.text);
        return -1;
    }
    return 0;
}

FIXTURE(fixture_tear_down)
{
    arena_fini(&fixture_arena);
    return 0;
}

static inline struct contact_world *fixture_native(const struct scene *scene)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    assert_no_error(contact_native_create(&scene->config, &fixture_arena, &world, &error) !=
                        ERROR_NONE,
                    error.text);
    return world;
}

/* To be destroyed. */
static inline struct contact_world *fixture_simbody(const struct scene *scene)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    assert_no_error(contact_simbody_create(&scene->config, &world, &error) != ERROR_NONE,
                    error.text);
    return world;
}

static inline void fixture_evaluate(struct contact_world *world, const struct body_motion *motion,
                                    struct contact_wrench *wrench)
{
    if (world->ops->evaluate(world, motion, NULL, wrench) != ERROR_NONE) {
        fail_msg("%s", world->ops->failure(world));
    }
}

/* ---- motions of bodies that were placed upright ---- */

static inline void fixture_turn_z(struct body_motion *motion, double angle)
{
    motion->R[0] = motion->R[4] = cos(angle);
    motion->R[1] = -sin(angle);
    motion->R[3] = sin(angle);
}

static inline void fixture_turn_y(struct body_motion *motion, double angle)
{
    motion->R[0] = motion->R[8] = cos(angle);
    motion->R[2] = sin(angle);
    motion->R[6] = -sin(angle);
}

/* ---- meshes ---- */

/* A mesh of the box's topology whose vertices have been moved. */
static inline const struct mesh *fixture_reshape(const double half[3], int cells,
                                                 void (*move)(double p[3], const double *with),
                                                 const double *with)
{
    const struct mesh *box;
    struct mesh *mesh = arena_alloc(&fixture_arena, 1, sizeof *mesh);
    double(*vertex)[3];

    assert_ok(mesh_box(half, cells, &fixture_arena, &box, NULL));
    vertex = arena_alloc(&fixture_arena, box->nvertex, sizeof *vertex);
    assert_true(mesh && vertex);
    for (size_t v = 0; v < box->nvertex; v++) {
        memcpy(vertex[v], box->vertex[v], sizeof vertex[v]);
        move(vertex[v], with);
    }
    *mesh = *box;
    mesh->vertex = (const double(*)[3])vertex;
    return mesh;
}

static inline void fixture_bump(double p[3], const double *top)
{
    if (p[2] >= 0.999 * *top) {
        p[2] += 0.004 * sin(47 * p[0] + 0.3) * cos(39 * p[1]);
    }
}

/* A block of ground of cells x cells bumps, 0.4 m wide. */
static inline const struct mesh *fixture_terrain(int cells)
{
    const double top = 0.05;

    return fixture_reshape((const double[3]){0.2, 0.2, top}, cells, fixture_bump, &top);
}

/* ---- a body on the ground ---- */

/* Ground, and one surface on body 0 that is paired with it. */
static inline struct contact_surface *fixture_on_ground(struct scene *scene,
                                                        enum contact_shape shape)
{
    scene_init(scene, 1);
    scene_add(scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add_pair(scene, 0, 1);
    return scene_add(scene, 0, shape, &scene_foot);
}

static inline struct contact_surface *fixture_box_on_ground(struct scene *scene)
{
    struct contact_surface *s = fixture_on_ground(scene, CONTACT_BOX);

    for (int i = 0; i < 3; i++) {
        s->half_extent_m[i] = 0.075;
    }
    s->cells_per_edge = 7;
    return s;
}

/* ---- two bodies in touch ---- */

enum { FIXTURE_KINDS = 9 };

/* A capsule of COMAN's shank, its axis along the body's x. */
static inline struct contact_surface *fixture_add_capsule(struct scene *scene, int body,
                                                          const struct contact_material *material)
{
    static const double along_x[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};
    struct contact_surface *s = scene_add(scene, body, CONTACT_CAPSULE, material);

    s->radius_m = 0.06;
    s->length_m = 0.18;
    memcpy(s->rotation, along_x, sizeof s->rotation);
    return s;
}

/* Two bodies that touch, in every kind of pair; about a pose of the second over the first. */
static inline double fixture_two_bodies(struct scene *scene, int kind)
{
    static const struct mesh *terrain;

    if (!terrain) {
        terrain = fixture_terrain(24);
    }
    scene_init(scene, 2);
    switch (kind) {
    case 0:
        scene_add(scene, 0, CONTACT_HALF_SPACE, &scene_ground);
        scene_add(scene, 1, CONTACT_MESH, &scene_foot)->mesh = fixture_foot;
        scene_add_pair(scene, 0, 1);
        return 0.0915;
    case 1:
        scene_add_box(scene, 0, 0.075, 0.075, 0.075, 7, &scene_ground);
        scene_add(scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        scene_add_pair(scene, 1, 0);
        return 0.0935;
    case 2:
        scene_add_box(scene, 0, 0.2, 0.3, 0.02, 1, &scene_ground);
        scene_add_box(scene, 1, 0.075, 0.075, 0.075, 7, &scene_foot);
        scene_add_pair(scene, 1, 0);
        return 0.0935;
    case 3:
        scene_add(scene, 0, CONTACT_MESH, &scene_ground)->mesh = terrain;
        scene_add(scene, 1, CONTACT_MESH, &scene_foot)->mesh = fixture_foot;
        scene_add_pair(scene, 0, 1);
        return 0.05 + 0.0932;
    case 4:
        scene_add(scene, 0, CONTACT_MESH, &scene_ground)->mesh = terrain;
        scene_add(scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        scene_add_pair(scene, 0, 1);
        return 0.05 + 0.018;
    case 5:
        scene_add(scene, 0, CONTACT_HALF_SPACE, &scene_ground);
        fixture_add_capsule(scene, 1, &scene_foot);
        scene_add_pair(scene, 1, 0);
        return 0.059;
    case 6:
        fixture_add_capsule(scene, 0, &scene_ground);
        fixture_add_capsule(scene, 1, &scene_foot);
        scene_add_pair(scene, 0, 1);
        return 0.117;
    case 7:
        scene_add(scene, 0, CONTACT_SPHERE, &scene_ground)->radius_m = 0.02;
        fixture_add_capsule(scene, 1, &scene_foot);
        scene_add_pair(scene, 0, 1);
        return 0.079;
    default:
        scene_add_box(scene, 0, 0.2, 0.3, 0.02, 1, &scene_ground);
        fixture_add_capsule(scene, 1, &scene_foot);
        scene_add_pair(scene, 1, 0);
        return 0.079;
    }
}

static inline void fixture_two_motions(uint64_t *seed, double height, struct body_motion motion[2])
{
    for (int b = 0; b < 2; b++) {
        scene_place(&motion[b], 0.01 * random_number(seed), 0.01 * random_number(seed),
                    b * (height + 0.0005 * random_number(seed)));
        scene_random_rotation(seed, 0.02, motion[b].R);
        for (int i = 0; i < 3; i++) {
            motion[b].w[i] = random_number(seed);
            motion[b].v[i] = 0.1 * random_number(seed);
        }
    }
}

/* Both motions as seen from elsewhere: everything turned by Q, then shifted. */
static inline void fixture_move_all(const double Q[9], const double shift[3],
                                    const struct body_motion motion[2], struct body_motion moved[2])
{
    for (int b = 0; b < 2; b++) {
        mat3_apply(Q, motion[b].p, moved[b].p);
        mat3_apply(Q, motion[b].w, moved[b].w);
        mat3_apply(Q, motion[b].v, moved[b].v);
        for (int axis = 0; axis < 3; axis++) {
            double column[3] = {motion[b].R[axis], motion[b].R[3 + axis], motion[b].R[6 + axis]};
            double out[3];

            mat3_apply(Q, column, out);
            for (int row = 0; row < 3; row++) {
                moved[b].R[3 * row + axis] = out[row];
            }
            moved[b].p[axis] += shift[axis];
        }
    }
}

/* The wrenches on both bodies are the other ones turned by Q. */
static inline void fixture_expect_turned(const struct contact_wrench turned[2], const double Q[9],
                                         const struct contact_wrench wrench[2],
                                         double force_tolerance, double moment_tolerance)
{
    for (int b = 0; b < 2; b++) {
        double force[3], moment[3];

        mat3_apply(Q, wrench[b].force, force);
        mat3_apply(Q, wrench[b].moment, moment);
        for (int axis = 0; axis < 3; axis++) {
            assert_near(turned[b].force[axis], force[axis], force_tolerance);
            assert_near(turned[b].moment[axis], moment[axis], moment_tolerance);
        }
    }
}

#endif
