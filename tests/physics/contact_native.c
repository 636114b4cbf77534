/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The native contact engine over the true overlap, against what can be worked out by hand, and
 * against what any contact has to obey. Nothing here is compared with another engine.
 */
#include "contact/contact.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "tests/physics/contact_scene.h"
#include "tests/physics/near.h"

static const double pi = 3.14159265358979323846;

/* Half of it as hard as the two together: k = 5e5 Pa/m. */
static const struct contact_material hard = {1e6, 1, 0, 0, 0, 0};

static struct arena arena;
static const struct mesh *foot;

static int set_up(void **state)
{
    (void)state;
    return arena_init(&arena, (size_t)512 << 20, NULL) != ERROR_NONE ||
                   mesh_read_obj(HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj", &arena,
                                 &foot, NULL) != ERROR_NONE
               ? -1
               : 0;
}

static int tear_down(void **state)
{
    (void)state;
    arena_fini(&arena);
    return 0;
}

static struct contact_world *make(const struct scene *scene)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    if (contact_native_create(&scene->config, &arena, &world, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    return world;
}

static void evaluate(struct contact_world *world, const struct body_motion *motion,
                     struct contact_wrench *wrench)
{
    if (world->ops->evaluate(world, motion, wrench) != ERROR_NONE) {
        fail_msg("%s", world->ops->failure(world));
    }
}

static void turn_z(struct body_motion *motion, double angle)
{
    motion->R[0] = motion->R[4] = cos(angle);
    motion->R[1] = -sin(angle);
    motion->R[3] = sin(angle);
}

static void turn_y(struct body_motion *motion, double angle)
{
    motion->R[0] = motion->R[8] = cos(angle);
    motion->R[2] = sin(angle);
    motion->R[6] = -sin(angle);
}

/* A mesh of the box's topology whose vertices have been moved. */
static const struct mesh *reshape(const double half[3], int cells,
                                  void (*move)(double p[3], const double *with), const double *with)
{
    const struct mesh *box;
    struct mesh *mesh = arena_alloc(&arena, 1, sizeof *mesh);
    double(*vertex)[3];

    assert_int_equal(mesh_box(half, cells, &arena, &box, NULL), ERROR_NONE);
    vertex = arena_alloc(&arena, box->nvertex, sizeof *vertex);
    assert_true(mesh && vertex);
    for (size_t v = 0; v < box->nvertex; ++v) {
        memcpy(vertex[v], box->vertex[v], sizeof vertex[v]);
        move(vertex[v], with);
    }
    *mesh = *box;
    mesh->vertex = (const double(*)[3])vertex;
    return mesh;
}

static void onto_sphere(double p[3], const double *radius)
{
    /* tangents make the cells alike */
    for (int i = 0; i < 3; ++i) {
        p[i] = tan(p[i] * pi / 4);
    }

    double length = vec3_norm(p);

    for (int i = 0; i < 3; ++i) {
        p[i] *= *radius / length;
    }
}

static const struct mesh *sphere_mesh(double radius, int cells)
{
    return reshape((const double[3]){1, 1, 1}, cells, onto_sphere, &radius);
}

static void bump(double p[3], const double *top)
{
    if (p[2] >= 0.999 * *top) {
        p[2] += 0.004 * sin(47 * p[0] + 0.3) * cos(39 * p[1]);
    }
}

static const struct mesh *bumpy_terrain(int cells)
{
    const double top = 0.05;

    return reshape((const double[3]){0.2, 0.2, 0.05}, cells, bump, &top);
}

static double cap_volume(double radius, double depth)
{
    return pi * depth * depth * (radius - depth / 3);
}

/* ---- the normal law ---- */

static void box_on_table_pushes_with_k_a_d_whatever_the_tables_size(void **state)
{
    const double side[] = {0.2, 0.6, 2.4}, angle[] = {0, 0.3, pi / 4};
    const int cells[] = {1, 7, 20};

    (void)state;
    for (int s = 0; s < 3; ++s) {
        for (int c = 0; c < 3; ++c) {
            struct scene scene;
            struct body_motion motion;
            struct contact_wrench wrench;
            struct contact_patch patch;

            scene_init(&scene, 1);
            scene_add_box(&scene, -1, side[s] / 2, side[s] / 2, 0.02, cells[c], &hard);
            scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &hard);
            scene_add_pair(&scene, 0, 1);

            struct contact_world *world = make(&scene);

            for (int a = 0; a < 3; ++a) {
                scene_place(&motion, side[s] > 0.3 ? 0.013 : 0, 0, 0.02 + 0.075 - 1e-3);
                turn_z(&motion, side[s] > 0.3 ? angle[a] : 0);
                evaluate(world, &motion, &wrench);
                assert_near(wrench.force[2], 11.25, 1e-9);
                for (int i = 0; i < 3; ++i) {
                    assert_near(i < 2 ? wrench.force[i] : 0, 0, 1e-9);
                    assert_near(wrench.moment[i], 0, 1e-9);
                }
                assert_int_equal(world->ops->patches(world, &patch, 1), 1);
                assert_near(patch.area_m2, 0.0225, 1e-12);
                assert_near(patch.penetration_m, 1e-3, 1e-12);
                assert_near(patch.potential_j, 11.25 * 1e-3 / 2, 1e-12);
            }
        }
    }
}

static void box_over_the_edge_pushes_with_what_is_on_the_table(void **state)
{
    const double on_table[] = {0.14, 0.075, 0.03, 0.006};

    (void)state;
    for (int cells = 1; cells <= 7; cells += 6) {
        struct scene scene;
        struct body_motion motion;
        struct contact_wrench wrench;

        scene_init(&scene, 1);
        scene_add_box(&scene, -1, 0.2, 0.3, 0.02, cells, &hard);
        scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &hard);
        scene_add_pair(&scene, 0, 1);

        struct contact_world *world = make(&scene);

        for (int i = 0; i < 4; ++i) {
            double force = 5e5 * 0.15 * on_table[i] * 1e-3;

            scene_place(&motion, 0.2 + 0.075 - on_table[i], 0.01, 0.02 + 0.075 - 1e-3);
            evaluate(world, &motion, &wrench);
            assert_near(wrench.force[2], force, 1e-9 * force);
            assert_near(wrench.force[0], 0, 1e-9 * force);
            assert_near(wrench.force[1], 0, 1e-9 * force);
            /* the middle of what is on the table, seen from the box */
            assert_near(wrench.moment[1], (0.075 - on_table[i] / 2) * force, 1e-9 * force);
        }
    }
}

static void box_on_half_space_pushes_with_k_a_d_and_not_with_its_sides(void **state)
{
    const double depth[] = {1e-7, 1e-4, 1e-3, 1e-2, 0.05};
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    (void)state;
    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &hard);
    scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &hard);
    scene_add_pair(&scene, 0, 1);

    struct contact_world *world = make(&scene);

    for (int i = 0; i < 5; ++i) {
        double force = 5e5 * 0.0225 * depth[i];

        scene_place(&motion, 0.3, -0.2, 0.075 - depth[i]);
        evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], force, 1e-9 * force);
        assert_near(vec3_norm(wrench.moment), 0, 1e-9 * force);
    }
}

static void a_tilted_box_meets_half_space_and_table_alike(void **state)
{
    /* a wedge: the lower edge of a box that is turned by t about y, d deep: its bottom is b = d/sin
     * t wide under the plane, and the volume between it and the plane, straight above it, is w b^2
     * sin t cos t/2; the upright side adds its own, w (d/cos t)^2 sin t cos t/2 */
    const double t = 0.05, d = 2e-3, w = 0.15, k = 5e5;
    double volume = w * d * d / 2 * (cos(t) / sin(t) + sin(t) / cos(t));
    double force[2], moment[2], lean[2];

    (void)state;
    for (int table = 0; table < 2; ++table) {
        struct scene scene;
        struct body_motion motion;
        struct contact_wrench wrench;

        scene_init(&scene, 1);
        if (table) {
            scene_add_box(&scene, -1, 0.3, 0.3, 0.05, 3, &hard)->position[2] = -0.05;
        } else {
            scene_add(&scene, -1, CONTACT_HALF_SPACE, &hard);
        }
        scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &hard);
        scene_add_pair(&scene, 0, 1);

        struct contact_world *world = make(&scene);

        scene_place(&motion, 0, 0, 0.075 * (cos(t) + sin(t)) - d);
        turn_y(&motion, t);
        evaluate(world, &motion, &wrench);
        force[table] = wrench.force[2];
        lean[table] = wrench.force[0] / wrench.force[2];
        /* of what points up */
        moment[table] = wrench.moment[1] + 0.077 * wrench.force[0];
    }
    assert_near(force[0], k * volume, 1e-9 * force[0]);
    assert_near(lean[0], 0, 1e-9);
    /* between two meshes springs lean by half the tilt, and the side faces nobody */
    assert_near(force[1], force[0], 4e-3 * force[0]);
    assert_near(fabs(lean[1]), t / 2, 1e-2 * t);
    assert_near(moment[1], moment[0], 4e-3 * fabs(moment[0]));
}

static void sphere_on_a_box_pushes_with_k_times_the_cap_wherever_it_lands(void **state)
{
    /* 441 places over a cell of the box, as others have measured */
    const double depth = 0.5e-3, force = 5e5 * cap_volume(0.02, depth);
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    (void)state;
    scene_init(&scene, 1);
    scene_add_box(&scene, -1, 0.075, 0.075, 0.075, 7, &hard);
    scene_add(&scene, 0, CONTACT_SPHERE, &hard)->radius_m = 0.02;
    scene_add_pair(&scene, 0, 1);

    struct contact_world *world = make(&scene);

    for (int i = 0; i < 441; ++i) {
        scene_place(&motion, 0.15 / 7 * (i % 21) / 20, 0.15 / 7 * (i / 21) / 20,
                    0.075 + 0.02 - depth);
        evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], force, 1e-9 * force);
        assert_near(hypot(wrench.force[0], wrench.force[1]), 0, 1e-12 * force);
        assert_near(wrench.moment[0], 0, 1e-12 * force);
    }
    /* half over the edge: half of the cap, and no push from the side */
    scene_place(&motion, 0.075, 0.01, 0.075 + 0.02 - depth);
    evaluate(world, &motion, &wrench);
    assert_near(wrench.force[2], force / 2, 1e-6 * force);
    assert_near(wrench.force[0], 0, 1e-6 * force);
}

static void dent(double p[3], const double *top)
{
    if (p[2] >= 0.999 * *top) {
        p[2] += 2e-6 * sin(971 * p[0] + 0.3) * cos(787 * p[1]);
    }
}

static void a_sphere_does_not_feel_the_cells_of_a_surface_that_is_almost_flat(void **state)
{
    /* dents of 2 um in each corner of the cells: no two triangles are in one plane */
    const double top = 0.05, depth = 0.5e-3, expected = 5e5 * cap_volume(0.02, depth);
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    double least = 1e9, most = 0;

    (void)state;
    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_MESH, &hard)->mesh =
        reshape((const double[3]){0.075, 0.075, top}, 7, dent, &top);
    scene_add(&scene, 0, CONTACT_SPHERE, &hard)->radius_m = 0.02;
    scene_add_pair(&scene, 0, 1);

    struct contact_world *world = make(&scene);

    for (int i = 0; i < 441; ++i) {
        scene_place(&motion, 0.15 / 7 * (i % 21) / 20, 0.15 / 7 * (i / 21) / 20,
                    top + 0.02 - depth);
        evaluate(world, &motion, &wrench);
        least = fmin(least, wrench.force[2]);
        most = fmax(most, wrench.force[2]);
    }
    print_message("force %.5g to %.5g N, k times the cap %.5g N\n", least, most, expected);
    assert_true(most < 1.01 * expected && least > 0.99 * expected);
}

static void a_refined_ball_on_a_plane_converges_to_k_times_the_cap(void **state)
{
    const double radius = 0.05, depth = 4e-3, expected = 5e5 * cap_volume(radius, depth);

    (void)state;
    for (int table = 0; table < 2; ++table) {
        double off[4];

        for (int i = 0; i < 4; ++i) {
            int cells = 8 << i;
            struct scene scene;
            struct body_motion motion;
            struct contact_wrench wrench;

            scene_init(&scene, 1);
            if (table) {
                scene_add_box(&scene, -1, 0.2, 0.2, 0.05, 1, &hard)->position[2] = -0.05;
            } else {
                scene_add(&scene, -1, CONTACT_HALF_SPACE, &hard);
            }
            scene_add(&scene, 0, CONTACT_MESH, &hard)->mesh = sphere_mesh(radius, cells);
            scene_add_pair(&scene, 0, 1);

            struct contact_world *world = make(&scene);

            scene_place(&motion, 0.01, 0.02, radius - depth);
            evaluate(world, &motion, &wrench);

            off[i] = wrench.force[2] / expected - 1;
            print_message("%s, %d triangles: %+.2e off\n", table ? "table" : "half-space",
                          12 * cells * cells, off[i]);
        }
        /* of second order in the size of the cells, toward the cap; on the table springs lean by
         * half the slope of the facet, which takes a share of the order of depth over radius */
        assert_near((off[1] - off[2]) / (off[2] - off[3]), 4, 0.5);
        assert_near((4 * off[3] - off[2]) / 3, 0, table ? depth / radius / 4 : 1e-3);
    }
}

static void a_facet_may_be_cut_into_any_triangles(void **state)
{
    struct contact_wrench wrench[2][3];
    uint64_t seed = 3;

    (void)state;
    for (int fine = 0; fine < 2; ++fine) {
        struct scene scene;

        scene_init(&scene, 3);
        scene_add_box(&scene, 0, 0.1, 0.2, 0.03, fine ? 9 : 1, &scene_ground);
        scene_add_box(&scene, 1, 0.05, 0.06, 0.04, fine ? 7 : 1, &scene_foot);
        scene_add(&scene, 2, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        scene_add_pair(&scene, 0, 1);
        scene_add_pair(&scene, 0, 2);

        struct contact_world *world = make(&scene);
        struct body_motion motion[3];

        seed = 3;
        for (int b = 0; b < 3; ++b) {
            scene_place(&motion[b], 0.03 * b, 0.02, b == 0 ? 0 : b == 1 ? 0.069 : 0.0495);
            scene_random_rotation(&seed, 0.02, motion[b].R);
            for (int i = 0; i < 3; ++i) {
                motion[b].w[i] = scene_random(&seed);
                motion[b].v[i] = 0.1 * scene_random(&seed);
            }
        }
        evaluate(world, motion, wrench[fine]);
    }
    for (int b = 0; b < 3; ++b) {
        double size = vec3_norm(wrench[0][b].force);

        assert_true(size > 0);
        for (int i = 0; i < 3; ++i) {
            assert_near(wrench[1][b].force[i], wrench[0][b].force[i], 1e-9 * size);
            assert_near(wrench[1][b].moment[i], wrench[0][b].moment[i], 1e-9 * size);
        }
    }
}

/* ---- what any contact obeys ---- */

enum { SCENES = 5 };

/* Two bodies that touch, in every kind of pair; about a pose of the second over the first. */
static double two_bodies(struct scene *scene, int kind)
{
    static const struct mesh *terrain;

    if (!terrain) {
        terrain = bumpy_terrain(24);
    }
    scene_init(scene, 2);
    switch (kind) {
    case 0:
        scene_add(scene, 0, CONTACT_HALF_SPACE, &scene_ground);
        scene_add(scene, 1, CONTACT_MESH, &scene_foot)->mesh = foot;
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
        scene_add(scene, 1, CONTACT_MESH, &scene_foot)->mesh = foot;
        scene_add_pair(scene, 0, 1);
        return 0.05 + 0.0932;
    default:
        scene_add(scene, 0, CONTACT_MESH, &scene_ground)->mesh = terrain;
        scene_add(scene, 1, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        scene_add_pair(scene, 0, 1);
        return 0.05 + 0.018;
    }
}

static void two_motions(uint64_t *seed, double height, struct body_motion motion[2])
{
    for (int b = 0; b < 2; ++b) {
        scene_place(&motion[b], 0.01 * scene_random(seed), 0.01 * scene_random(seed),
                    b * (height + 0.0005 * scene_random(seed)));
        scene_random_rotation(seed, 0.02, motion[b].R);
        for (int i = 0; i < 3; ++i) {
            motion[b].w[i] = scene_random(seed);
            motion[b].v[i] = 0.1 * scene_random(seed);
        }
    }
}

static void action_equals_reaction_and_patches_add_up_to_the_wrenches(void **state)
{
    uint64_t seed = 7;

    (void)state;
    for (int kind = 0; kind < SCENES; ++kind) {
        struct scene scene;
        double height = two_bodies(&scene, kind);
        struct contact_world *world = make(&scene);
        bool turned = scene.pair[0].a == 1;
        int touching = 0;

        for (int i = 0; i < 50; ++i) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2];
            struct contact_patch patch;
            double size, moment[3] = {0}, arm[3], turn[3];
            int b = turned ? 0 : 1; /* the pair's second */

            two_motions(&seed, height, motion);
            evaluate(world, motion, wrench);
            size = vec3_norm(wrench[0].force);
            if (size == 0) {
                continue;
            }
            touching++;
            for (int n = 0; n < 2; ++n) {
                vec3_cross(motion[n].p, wrench[n].force, turn);
                for (int axis = 0; axis < 3; ++axis) {
                    moment[axis] += wrench[n].moment[axis] + turn[axis];
                }
            }
            assert_int_equal(world->ops->patches(world, &patch, 1), 1);
            for (int axis = 0; axis < 3; ++axis) {
                arm[axis] = patch.center[axis] - motion[b].p[axis];
            }
            vec3_cross(arm, patch.force, turn);
            for (int axis = 0; axis < 3; ++axis) {
                assert_near(wrench[0].force[axis] + wrench[1].force[axis], 0, 1e-14 * size);
                assert_near(moment[axis], 0, 1e-14 * size);
                assert_near(patch.force[axis], wrench[b].force[axis], 1e-14 * size);
                assert_near(patch.moment[axis] + turn[axis], wrench[b].moment[axis], 1e-14 * size);
            }
            assert_true(patch.area_m2 > 0 && patch.penetration_m > 0);
            assert_true(patch.potential_j > 0 && patch.dissipation_w > 0);
        }
        assert_true(touching > 25);
    }
}

static void moving_the_whole_scene_moves_the_wrenches_with_it(void **state)
{
    uint64_t seed = 3;

    (void)state;
    for (int kind = 0; kind < SCENES; ++kind) {
        struct scene scene;
        double height = two_bodies(&scene, kind);
        struct contact_world *world = make(&scene);

        for (int i = 0; i < 30; ++i) {
            struct body_motion motion[2], moved[2];
            struct contact_wrench wrench[2], turned[2];
            double Q[9], shift[3], size;

            two_motions(&seed, height, motion);
            scene_random_rotation(&seed, 3, Q);
            for (int axis = 0; axis < 3; ++axis) {
                shift[axis] = 2 * scene_random(&seed);
            }
            for (int b = 0; b < 2; ++b) {
                mat3_apply(Q, motion[b].p, moved[b].p);
                mat3_apply(Q, motion[b].w, moved[b].w);
                mat3_apply(Q, motion[b].v, moved[b].v);
                for (int axis = 0; axis < 3; ++axis) {
                    double column[3] = {motion[b].R[axis], motion[b].R[3 + axis],
                                        motion[b].R[6 + axis]};
                    double out[3];

                    mat3_apply(Q, column, out);
                    for (int row = 0; row < 3; ++row) {
                        moved[b].R[3 * row + axis] = out[row];
                    }
                    moved[b].p[axis] += shift[axis];
                }
            }
            evaluate(world, motion, wrench);
            evaluate(world, moved, turned);
            size = vec3_norm(wrench[0].force) + 1e-3;
            for (int b = 0; b < 2; ++b) {
                double force[3], moment[3];

                mat3_apply(Q, wrench[b].force, force);
                mat3_apply(Q, wrench[b].moment, moment);
                for (int axis = 0; axis < 3; ++axis) {
                    assert_near(turned[b].force[axis], force[axis], 1e-9 * size);
                    assert_near(turned[b].moment[axis], moment[axis], 1e-10 * size);
                }
            }
        }
    }
}

static void the_same_motion_gives_the_same_bits_whatever_came_before(void **state)
{
    uint64_t seed = 5;

    (void)state;
    for (int kind = 0; kind < SCENES; ++kind) {
        struct scene scene;
        double height = two_bodies(&scene, kind);
        struct contact_world *world = make(&scene), *fresh = make(&scene);
        struct body_motion motion[20][2];
        struct contact_wrench first[20][2], again[2];

        for (int i = 0; i < 20; ++i) {
            two_motions(&seed, height, motion[i]);
            evaluate(world, motion[i], first[i]);
        }
        for (int i = 0; i < 200; ++i) {
            int pick = (int)(10 + 9.99 * scene_random(&seed));

            evaluate(world, motion[pick], again);
            assert_memory_equal(again, first[pick], sizeof again);
        }
        for (int i = 19; i >= 0; --i) {
            evaluate(fresh, motion[i], again);
            assert_memory_equal(again, first[i], sizeof again);
        }
    }
}

/* Walks the second body along a line in steps; returns the largest change of force and moment in
 * one. */
static double largest_jump(struct contact_world *world, const struct body_motion from[2],
                           const double way[3], int steps)
{
    struct body_motion motion[2];
    struct contact_wrench last[2], now[2];
    double jump = 0;

    memcpy(motion, from, sizeof motion);
    evaluate(world, motion, last);
    for (int i = 1; i <= steps; ++i) {
        double change = 0;

        for (int axis = 0; axis < 3; ++axis) {
            motion[1].p[axis] = from[1].p[axis] + way[axis] * i / steps;
        }
        evaluate(world, motion, now);
        for (int axis = 0; axis < 3; ++axis) {
            change += fabs(now[1].force[axis] - last[1].force[axis]);
            change += 20 * fabs(now[0].moment[axis] - last[0].moment[axis]);
        }
        jump = fmax(jump, change);
        memcpy(last, now, sizeof last);
    }
    return jump;
}

static void the_wrench_is_continuous_in_the_pose(void **state)
{
    uint64_t seed = 29;

    (void)state;
    for (int kind = 0; kind < SCENES; ++kind) {
        struct scene scene;
        double height = two_bodies(&scene, kind);
        struct contact_world *world = make(&scene);

        for (int i = 0; i < 6; ++i) {
            struct body_motion motion[2];
            double way[3] = {0.03 * scene_random(&seed), 0.03 * scene_random(&seed),
                             0.002 * scene_random(&seed)};
            double coarse, fine;

            two_motions(&seed, height, motion);
            if (i % 3 == 0) {
                /* over the edge */
                motion[1].p[0] += kind == 1 ? 0.06 : 0.18;
            }
            coarse = largest_jump(world, motion, way, 100);
            fine = largest_jump(world, motion, way, 10000);
            if (coarse > 0) {
                /* a hundredth where it is smooth, and no jump anywhere */
                if (!(fine < 0.05 * coarse)) {
                    fail_msg("scene %d, walk %d: %g N in a step, %g N in one a hundred times as "
                             "long",
                             kind, i, fine, coarse);
                }
            }
        }
    }
}

static void the_elastic_force_is_the_slope_of_the_stored_energy(void **state)
{
    uint64_t seed = 41;

    (void)state;
    for (int kind = 0; kind < 3; ++kind) {
        struct scene scene;
        double height = two_bodies(&scene, kind);
        struct contact_world *world = make(&scene);

        for (int i = 0; i < 20; ++i) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2];
            struct contact_patch patch[2];
            double step = 1e-6, slope;

            two_motions(&seed, height, motion);
            for (int b = 0; b < 2; ++b) {
                memset(motion[b].w, 0, sizeof motion[b].w);
                memset(motion[b].v, 0, sizeof motion[b].v);
            }
            evaluate(world, motion, wrench);
            if (wrench[1].force[2] == 0) {
                continue;
            }
            for (int side = 0; side < 2; ++side) {
                struct body_motion moved[2];
                struct contact_wrench unused[2];

                memcpy(moved, motion, sizeof moved);
                moved[1].p[2] += (side ? 1 : -1) * step;
                evaluate(world, moved, unused);
                patch[side].potential_j = 0;
                world->ops->patches(world, &patch[side], 1);
            }
            slope = (patch[0].potential_j - patch[1].potential_j) / (2 * step);
            /* where a mesh's own boundary moves through the overlap the bed is not conservative */
            assert_near(wrench[1].force[2], slope, (kind == 0 ? 1e-5 : 3e-2) * slope);
        }
    }
}

/* ---- tangents ---- */

/* A velocity's or small displacement's six numbers applied to a body about a point. */
static void disturb(struct body_motion *motion, const double center[3], int axis, double step,
                    bool velocity)
{
    double arm[3], turn[3], e[3] = {axis % 3 == 0, axis % 3 == 1, axis % 3 == 2};

    for (int i = 0; i < 3; ++i) {
        arm[i] = motion->p[i] - center[i];
    }
    vec3_cross(e, arm, turn);
    for (int i = 0; i < 3; ++i) {
        double *place = velocity ? motion->v : motion->p;

        place[i] += step * (axis < 3 ? e[i] : turn[i]);
        if (axis >= 3 && velocity) {
            motion->w[i] += step * e[i];
        }
    }
    if (axis >= 3 && !velocity) {
        for (int column = 0; column < 3; ++column) {
            double v[3] = {motion->R[column], motion->R[3 + column], motion->R[6 + column]};

            vec3_cross(e, v, turn);
            for (int row = 0; row < 3; ++row) {
                motion->R[3 * row + column] += step * turn[row];
            }
        }
    }
}

/* The wrench on a body about a point. */
static void about(const struct body_motion *motion, const struct contact_wrench *wrench,
                  const double center[3], double out[6])
{
    double arm[3], turn[3];

    for (int i = 0; i < 3; ++i) {
        arm[i] = motion->p[i] - center[i];
    }
    vec3_cross(arm, wrench->force, turn);
    for (int i = 0; i < 3; ++i) {
        out[i] = wrench->force[i];
        out[3 + i] = wrench->moment[i] + turn[i];
    }
}

static double entry(const double S[21], int row, int column)
{
    int r = row < column ? row : column, c = row < column ? column : row;

    return S[r * (13 - r) / 2 + c - r];
}

static void tangents_are_the_slopes_of_the_wrench_without_friction(void **state)
{
    uint64_t seed = 8;

    (void)state;
    for (int kind = 0; kind < 3; ++kind) {
        struct scene scene;
        double height = two_bodies(&scene, kind);

        for (int s = 0; s < 2; ++s) {
            struct contact_material *m = &scene.surface[s].material;

            m->static_friction = m->dynamic_friction = m->viscous_friction = 0;
        }

        struct contact_world *world = make(&scene);

        for (int i = 0; i < 10; ++i) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2];
            struct contact_tangent t;
            double load;
            int b = scene.pair[0].b;

            two_motions(&seed, height, motion);
            for (int body = 0; body < 2; ++body) {
                memset(motion[body].v, 0, sizeof motion[body].v);
                memset(motion[body].w, 0, sizeof motion[body].w);
            }
            evaluate(world, motion, wrench);
            if (world->ops->tangents(world, &t, 1) == 0) {
                continue;
            }
            load = vec3_norm(wrench[b].force);
            assert_int_equal(t.pair, 0);
            assert_int_equal(t.body_a, scene.pair[0].a);
            assert_int_equal(t.body_b, b);
            for (int column = 0; column < 6; ++column) {
                for (int velocity = 0; velocity < 2; ++velocity) {
                    const double *S = velocity ? t.D : t.K, step = 1e-7;
                    double side[2][6], center[3];

                    for (int way = 0; way < 2; ++way) {
                        struct body_motion moved[2];

                        memcpy(moved, motion, sizeof moved);
                        disturb(&moved[b], t.center, column, way ? step : -step, velocity);
                        evaluate(world, moved, wrench);
                        /* the center goes along with the body */
                        memcpy(center, t.center, sizeof center);
                        if (column < 3 && !velocity) {
                            center[column] += way ? step : -step;
                        }
                        about(&moved[b], &wrench[b], center, side[way]);
                    }
                    for (int row = 0; row < 6; ++row) {
                        double slope = -(side[1][row] - side[0][row]) / (2 * step);
                        double size =
                            sqrt(entry(S, row, row) * entry(S, column, column)) +
                            entry(S, 2, 2) * (row < 3 ? 1 : 0.02) * (column < 3 ? 1 : 0.02);

                        size += kind > 0 ? 10 * load : 0;

                        /* on a half-space exact but for force times depth; elsewhere normals turn
                         * with the bodies and the overlap's rim moves, which tangents leave out */
                        assert_near(entry(S, row, column), slope, (kind == 0 ? 5e-3 : 0.15) * size);
                    }
                }
            }
        }
    }
}

static void tangents_resist_sliding_at_least_as_much_as_friction_does(void **state)
{
    struct scene scene;
    double height = two_bodies(&scene, 0);
    struct contact_world *world = make(&scene);
    const double speed[] = {0, 2e-3, 0.01, 0.05, 1};

    (void)state;
    for (int i = 0; i < 5; ++i) {
        struct body_motion motion[2];
        struct contact_wrench wrench[2], faster[2];
        struct contact_tangent t;
        double slope;

        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], 0, 0, height);
        motion[1].v[0] = speed[i];
        evaluate(world, motion, wrench);
        motion[1].v[0] += 1e-6;
        evaluate(world, motion, faster);
        /* the steepest slope up to the present speed bounds the mean slope of the last bit */
        assert_int_equal(world->ops->tangents(world, &t, 1), 1);
        slope = (wrench[1].force[0] - faster[1].force[0]) / 1e-6;
        assert_true(t.D[0] > slope * (1 - 1e-6) && t.D[0] > 0);
        assert_true(t.D[0] * motion[1].v[0] >= -faster[1].force[0] * (1 - 1e-6));
        assert_near(t.D[0], t.D[6], 1e-9 * t.D[0]);
    }
}

/* ---- inside and outside ---- */

/* A mesh of quads given by outlines: an L that is extruded along y. */
static const struct mesh *make_l(double thickness)
{
    static double vertex[12][3];
    static int face[20][3];
    static struct mesh mesh = {"l", 12, 0, (const double(*)[3])vertex, (const int(*)[3])face};
    /* counterclockwise in x and z, seen from -y */
    const double t = thickness;
    const double outline[6][2] = {{0, 0}, {0.2, 0}, {0.2, t}, {t, t}, {t, 0.2}, {0, 0.2}};
    static const int cap[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
    size_t n = 0;

    for (int i = 0; i < 12; ++i) {
        vertex[i][0] = outline[i % 6][0];
        vertex[i][1] = i < 6 ? -0.1 : 0.1;
        vertex[i][2] = outline[i % 6][1];
    }
    for (int i = 0; i < 4; ++i) {
        memcpy(face[n++], cap[i], sizeof face[0]);
        memcpy(face[n++], (int[3]){cap[i][0] + 6, cap[i][2] + 6, cap[i][1] + 6}, sizeof face[0]);
    }
    for (int i = 0; i < 6; ++i) {
        int j = (i + 1) % 6;

        memcpy(face[n++], (int[3]){i, i + 6, j}, sizeof face[0]);
        memcpy(face[n++], (int[3]){j, i + 6, j + 6}, sizeof face[0]);
    }
    mesh.nface = n;
    assert_true(mesh_volume(&mesh) > 0);
    return &mesh;
}

static void a_corner_that_is_open_holds_a_box_and_a_sphere_only_where_they_touch(void **state)
{
    /* an angle bracket, its inner faces at x = t and z = t */
    const double t = 0.01;
    const struct mesh *l = make_l(t);

    (void)state;
    for (int sphere = 0; sphere < 2; ++sphere) {
        struct scene scene;
        struct body_motion motion;
        struct contact_wrench wrench;

        scene_init(&scene, 1);
        scene_add(&scene, -1, CONTACT_MESH, &hard)->mesh = l;
        if (sphere) {
            scene_add(&scene, 0, CONTACT_SPHERE, &hard)->radius_m = 0.02;
        } else {
            scene_add_box(&scene, 0, 0.02, 0.02, 0.02, 3, &hard);
        }
        scene_add_pair(&scene, 0, 1);

        struct contact_world *world = make(&scene);
        double one = 5e5 * (sphere ? cap_volume(0.02, 5e-4) : 0.04 * 0.04 * 5e-4);

        /* in the open, inside the hull */
        scene_place(&motion, 0.05, 0, 0.05);
        evaluate(world, &motion, &wrench);
        assert_true(vec3_norm(wrench.force) == 0);
        /* on the floor */
        scene_place(&motion, 0.08, 0, t + 0.02 - 5e-4);
        evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], one, 1e-9 * one);
        assert_near(wrench.force[0], 0, 1e-9 * one);
        /* in the corner, on both; the box is a little short of full, by what is in both faces */
        scene_place(&motion, t + 0.02 - 5e-4, 0, t + 0.02 - 5e-4);
        evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], one, (sphere ? 1e-9 : 0.03) * one);
        assert_near(wrench.force[0], wrench.force[2], 1e-9 * one);
        /* under it, and behind it */
        scene_place(&motion, 0.08, 0, -0.02 + 5e-4);
        evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], -one, 1e-9 * one);
        scene_place(&motion, -0.02 + 5e-4, 0, 0.08);
        evaluate(world, &motion, &wrench);
        assert_near(wrench.force[0], -one, 1e-9 * one);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(box_on_table_pushes_with_k_a_d_whatever_the_tables_size),
        cmocka_unit_test(box_over_the_edge_pushes_with_what_is_on_the_table),
        cmocka_unit_test(box_on_half_space_pushes_with_k_a_d_and_not_with_its_sides),
        cmocka_unit_test(a_tilted_box_meets_half_space_and_table_alike),
        cmocka_unit_test(sphere_on_a_box_pushes_with_k_times_the_cap_wherever_it_lands),
        cmocka_unit_test(a_sphere_does_not_feel_the_cells_of_a_surface_that_is_almost_flat),
        cmocka_unit_test(a_refined_ball_on_a_plane_converges_to_k_times_the_cap),
        cmocka_unit_test(a_facet_may_be_cut_into_any_triangles),
        cmocka_unit_test(action_equals_reaction_and_patches_add_up_to_the_wrenches),
        cmocka_unit_test(moving_the_whole_scene_moves_the_wrenches_with_it),
        cmocka_unit_test(the_same_motion_gives_the_same_bits_whatever_came_before),
        cmocka_unit_test(the_wrench_is_continuous_in_the_pose),
        cmocka_unit_test(the_elastic_force_is_the_slope_of_the_stored_energy),
        cmocka_unit_test(tangents_are_the_slopes_of_the_wrench_without_friction),
        cmocka_unit_test(tangents_resist_sliding_at_least_as_much_as_friction_does),
        cmocka_unit_test(a_corner_that_is_open_holds_a_box_and_a_sphere_only_where_they_touch),
    };

    return cmocka_run_group_tests_name("contact_native", tests, set_up, tear_down);
}
