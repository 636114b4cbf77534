/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The native contact engine over the true overlap, against what can be worked out by hand. Nothing
 * here is compared with another engine.
 */

#include "tests/physics/contact_fixture.h"

/* Half of it as hard as the two together: k = 5e5 Pa/m. */
static const struct contact_material hard = {1e6, 1, 0, 0, 0, 0, 0};

static void onto_sphere(double p[3], const double *radius)
{
    /* Tangents make the cells alike */
    for (int i = 0; i < 3; i++) {
        p[i] = tan(p[i] * fixture_pi / 4);
    }

    double length = vec3_norm(p);

    for (int i = 0; i < 3; i++) {
        p[i] *= *radius / length;
    }
}

static const struct mesh *sphere_mesh(double radius, int cells)
{
    return fixture_reshape((const double[3]){1, 1, 1}, cells, onto_sphere, &radius);
}

static double cap_volume(double radius, double depth)
{
    return fixture_pi * depth * depth * (radius - depth / 3);
}

/* ---- the normal law ---- */

TEST(box_on_table_pushes_with_k_a_d_whatever_the_tables_size)
{
    const double side[] = {0.2, 0.6, 2.4}, angle[] = {0, 0.3, fixture_pi / 4};
    const int cells[] = {1, 7, 20};

    for (int s = 0; s < 3; s++) {
        for (int c = 0; c < 3; c++) {
            struct scene scene;
            struct body_motion motion;
            struct contact_wrench wrench;
            struct contact_patch patch;

            scene_init(&scene, 1);
            scene_add_box(&scene, -1, side[s] / 2, side[s] / 2, 0.02, cells[c], &hard);
            scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &hard);
            scene_add_pair(&scene, 0, 1);

            struct contact_world *world = fixture_native(&scene);

            for (int a = 0; a < 3; a++) {
                scene_place(&motion, side[s] > 0.3 ? 0.013 : 0, 0, 0.02 + 0.075 - 1e-3);
                fixture_turn_z(&motion, side[s] > 0.3 ? angle[a] : 0);
                fixture_evaluate(world, &motion, &wrench);
                assert_near(wrench.force[2], 11.25, 1e-9);
                for (int i = 0; i < 3; i++) {
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

/* The depth over the box's bottom, s from the table's edge, is the lesser of d and s: the force is
 * k times w times its integral over what is on the table, the moment that of its moment. The
 * upright side that is in the table as deep as d is pushed off it, two thirds of d under the top.
 */
TEST(box_over_the_edge_pushes_with_what_is_on_the_table)
{
    const double d = 1e-3, w = 0.15, k = 5e5;
    const double on_table[] = {0.14, 0.075, 0.03, 0.006};

    for (int cells = 1; cells <= 7; cells += 6) {
        struct scene scene;
        struct body_motion motion;
        struct contact_wrench wrench;

        scene_init(&scene, 1);
        scene_add_box(&scene, -1, 0.2, 0.3, 0.02, cells, &hard);
        scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &hard);
        scene_add_pair(&scene, 0, 1);

        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < 4; i++) {
            double on = on_table[i], force = k * w * (on * d - d * d / 2);
            double lever = k * w * (d * d * d / 3 + d * (on * on - d * d) / 2);
            double push = k * w * d * d / 2;

            scene_place(&motion, 0.2 + 0.075 - on_table[i], 0.01, 0.02 + 0.075 - 1e-3);
            fixture_evaluate(world, &motion, &wrench);
            assert_near(wrench.force[2], force, 1e-9 * force);
            assert_near(wrench.force[0], push, 1e-9 * force);
            assert_near(wrench.force[1], 0, 1e-9 * force);
            assert_near(wrench.moment[1], (0.075 - on) * force + lever + (d / 3 - 0.075) * push,
                        1e-9 * force);
        }
    }
}

TEST(a_tilted_box_meets_half_space_and_table_alike)
{
    /* a wedge: the lower edge of a box that is turned by t about y, d deep: its bottom is b = d/sin
     * t wide under the plane, and the volume between it and the plane, straight above it, is w b^2
     * sin t cos t/2; the upright side adds its own, w (d/cos t)^2 sin t cos t/2 */
    const double t = 0.05, d = 2e-3, w = 0.15, k = 5e5;
    double volume = w * d * d / 2 * (cos(t) / sin(t) + sin(t) / cos(t));
    double force[2], moment[2], lean[2];

    for (int table = 0; table < 2; table++) {
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

        struct contact_world *world = fixture_native(&scene);

        scene_place(&motion, 0, 0, 0.075 * (cos(t) + sin(t)) - d);
        fixture_turn_y(&motion, t);
        fixture_evaluate(world, &motion, &wrench);
        force[table] = wrench.force[2];
        lean[table] = wrench.force[0] / wrench.force[2];
        moment[table] = wrench.moment[1];
    }
    assert_near(force[0], k * volume, 1e-9 * force[0]);
    assert_near(force[1], force[0], 1e-12 * force[0]);
    assert_near(lean[0], 0, 1e-12);
    assert_near(lean[1], 0, 1e-12);
    assert_near(moment[1], moment[0], 1e-12 * fabs(moment[0]));
}

TEST(sphere_on_a_box_pushes_with_k_times_the_cap_wherever_it_lands)
{
    /* 441 places over a cell of the box, as others have measured */
    const double depth = 0.5e-3, force = 5e5 * cap_volume(0.02, depth);
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    scene_init(&scene, 1);
    scene_add_box(&scene, -1, 0.075, 0.075, 0.075, 7, &hard);
    scene_add(&scene, 0, CONTACT_SPHERE, &hard)->radius_m = 0.02;
    scene_add_pair(&scene, 0, 1);

    struct contact_world *world = fixture_native(&scene);

    for (int i = 0; i < 441; i++) {
        scene_place(&motion, 0.15 / 7 * (i % 21) / 20, 0.15 / 7 * (i / 21) / 20,
                    0.075 + 0.02 - depth);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], force, 1e-9 * force);
        assert_near(hypot(wrench.force[0], wrench.force[1]), 0, 1e-12 * force);
        assert_near(wrench.moment[0], 0, 1e-12 * force);
    }
    /* Half over the edge: half of the cap, and no push from the side */
    scene_place(&motion, 0.075, 0.01, 0.075 + 0.02 - depth);
    fixture_evaluate(world, &motion, &wrench);
    assert_near(wrench.force[2], force / 2, 1e-6 * force);
    assert_near(wrench.force[0], 0, 1e-6 * force);
}

static void dent(double p[3], const double *top)
{
    if (p[2] >= 0.999 * *top) {
        p[2] += 2e-6 * sin(971 * p[0] + 0.3) * cos(787 * p[1]);
    }
}

TEST(a_sphere_does_not_feel_the_cells_of_a_surface_that_is_almost_flat)
{
    /* Dents of 2 um in each corner of the cells: no two triangles are in one plane */
    const double top = 0.05, depth = 0.5e-3, expected = 5e5 * cap_volume(0.02, depth);
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    double least = 1e9, most = 0;

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_MESH, &hard)->mesh =
        fixture_reshape((const double[3]){0.075, 0.075, top}, 7, dent, &top);
    scene_add(&scene, 0, CONTACT_SPHERE, &hard)->radius_m = 0.02;
    scene_add_pair(&scene, 0, 1);

    struct contact_world *world = fixture_native(&scene);

    for (int i = 0; i < 441; i++) {
        scene_place(&motion, 0.15 / 7 * (i % 21) / 20, 0.15 / 7 * (i / 21) / 20,
                    top + 0.02 - depth);
        fixture_evaluate(world, &motion, &wrench);
        least = fmin(least, wrench.force[2]);
        most = fmax(most, wrench.force[2]);
    }
    print_message("force %.5g to %.5g N, k times the cap %.5g N\n", least, most, expected);
    assert_true(most < 1.01 * expected && least > 0.99 * expected);
}

TEST(a_refined_ball_on_a_plane_converges_to_k_times_the_cap)
{
    const double radius = 0.05, depth = 4e-3, expected = 5e5 * cap_volume(radius, depth);

    for (int table = 0; table < 2; table++) {
        double off[4];

        for (int i = 0; i < 4; i++) {
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

            struct contact_world *world = fixture_native(&scene);

            scene_place(&motion, 0.01, 0.02, radius - depth);
            fixture_evaluate(world, &motion, &wrench);

            off[i] = wrench.force[2] / expected - 1;
            print_message("%s, %d triangles: %+.2e off\n", table ? "table" : "half-space",
                          12 * cells * cells, off[i]);
        }
        /* Of second order in the size of the cells, toward the cap */
        assert_near((off[1] - off[2]) / (off[2] - off[3]), 4, 0.5);
        assert_near((4 * off[3] - off[2]) / 3, 0, 1e-3);
    }
}

TEST(a_facet_may_be_cut_into_any_triangles)
{
    struct contact_wrench wrench[2][3];
    uint64_t seed = 3;

    for (int fine = 0; fine < 2; fine++) {
        struct scene scene;

        scene_init(&scene, 3);
        scene_add_box(&scene, 0, 0.1, 0.2, 0.03, fine ? 9 : 1, &scene_ground);
        scene_add_box(&scene, 1, 0.05, 0.06, 0.04, fine ? 7 : 1, &scene_foot);
        scene_add(&scene, 2, CONTACT_SPHERE, &scene_foot)->radius_m = 0.02;
        scene_add_pair(&scene, 0, 1);
        scene_add_pair(&scene, 0, 2);

        struct contact_world *world = fixture_native(&scene);
        struct body_motion motion[3];

        seed = 3;
        for (int b = 0; b < 3; b++) {
            scene_place(&motion[b], 0.03 * b, 0.02, b == 0 ? 0 : b == 1 ? 0.069 : 0.0495);
            scene_random_rotation(&seed, 0.02, motion[b].R);
            for (int i = 0; i < 3; i++) {
                motion[b].w[i] = random_number(&seed);
                motion[b].v[i] = 0.1 * random_number(&seed);
            }
        }
        fixture_evaluate(world, motion, wrench[fine]);
    }
    for (int b = 0; b < 3; b++) {
        double size = vec3_norm(wrench[0][b].force);

        assert_true(size > 0);
        for (int i = 0; i < 3; i++) {
            assert_near(wrench[1][b].force[i], wrench[0][b].force[i], 1e-9 * size);
            assert_near(wrench[1][b].moment[i], wrench[0][b].moment[i], 1e-9 * size);
        }
    }
}

/* ---- inside and outside ---- */

/* A mesh of quads given by outlines: an L that is extruded along y. */
static const struct mesh *make_l(double thickness)
{
    static double vertex[12][3];
    static int face[20][3];
    static struct mesh mesh = {"l", 12, 0, (const double(*)[3])vertex, (const int(*)[3])face};
    /* Counterclockwise in x and z, seen from -y */
    const double t = thickness;
    const double outline[6][2] = {{0, 0}, {0.2, 0}, {0.2, t}, {t, t}, {t, 0.2}, {0, 0.2}};
    static const int cap[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
    size_t n = 0;

    for (int i = 0; i < 12; i++) {
        vertex[i][0] = outline[i % 6][0];
        vertex[i][1] = i < 6 ? -0.1 : 0.1;
        vertex[i][2] = outline[i % 6][1];
    }
    for (int i = 0; i < 4; i++) {
        memcpy(face[n++], cap[i], sizeof face[0]);
        memcpy(face[n++], (int[3]){cap[i][0] + 6, cap[i][2] + 6, cap[i][1] + 6}, sizeof face[0]);
    }
    for (int i = 0; i < 6; i++) {
        int j = (i + 1) % 6;

        memcpy(face[n++], (int[3]){i, i + 6, j}, sizeof face[0]);
        memcpy(face[n++], (int[3]){j, i + 6, j + 6}, sizeof face[0]);
    }
    mesh.nface = n;
    assert_true(mesh_volume(&mesh) > 0);
    return &mesh;
}

TEST(a_corner_that_is_open_holds_a_box_and_a_sphere_only_where_they_touch)
{
    /* An angle bracket, its inner faces at x = t and z = t */
    const double t = 0.01;
    const struct mesh *l = make_l(t);

    for (int sphere = 0; sphere < 2; sphere++) {
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

        struct contact_world *world = fixture_native(&scene);
        double one = 5e5 * (sphere ? cap_volume(0.02, 5e-4) : 0.04 * 0.04 * 5e-4);

        /* In the open, inside the hull */
        scene_place(&motion, 0.05, 0, 0.05);
        fixture_evaluate(world, &motion, &wrench);
        assert_true(vec3_norm(wrench.force) == 0);
        /* On the floor */
        scene_place(&motion, 0.08, 0, t + 0.02 - 5e-4);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], one, 1e-9 * one);
        assert_near(wrench.force[0], 0, 1e-9 * one);
        /* In the corner, on both; the box is a little short of full, by what is in both faces */
        scene_place(&motion, t + 0.02 - 5e-4, 0, t + 0.02 - 5e-4);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], one, (sphere ? 1e-9 : 0.03) * one);
        assert_near(wrench.force[0], wrench.force[2], 1e-9 * one);
        /* Under it, and behind it */
        scene_place(&motion, 0.08, 0, -0.02 + 5e-4);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], -one, 1e-9 * one);
        scene_place(&motion, -0.02 + 5e-4, 0, 0.08);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[0], -one, 1e-9 * one);
    }
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
