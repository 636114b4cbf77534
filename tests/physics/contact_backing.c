/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What backs the layers of the native contact engine: it pushes from where the layers' thicknesses
 * are used up, by closed forms, by the energy that comes and goes, and not at all before.
 */

#include "tests/physics/contact_fixture.h"

/* Two of these: layers of 2 mm with k = 5e7 Pa/m, then 3e8 Pa/m more. */
static const struct contact_material backed = {1e5, 1e-3, 0, 0, 0, 0, 6e8};
static const double k = 5e7, more = 3e8, layers = 2e-3;

static double square(double x)
{
    return x * x;
}

/* ---- scenes ---- */

enum { BOX_HALF_SPACE, BOX_BOX, FOOT_HALF_SPACE, CAPSULE_HALF_SPACE, FOOT_TERRAIN, SCENES };

/* A body on the ground; returns the height at which it begins to touch. */
static double make_scene(struct scene *scene, int which, const struct contact_material *material)
{
    struct contact_surface *s;

    scene_init(scene, 1);
    if (which == BOX_BOX) {
        scene_add_box(scene, -1, 0.2, 0.3, 0.05, 1, material);
    } else if (which == FOOT_TERRAIN) {
        scene_add(scene, -1, CONTACT_MESH, material)->mesh = fixture_terrain(24);
    } else {
        scene_add(scene, -1, CONTACT_HALF_SPACE, material);
    }
    scene_add_pair(scene, 0, 1);
    if (which == BOX_HALF_SPACE || which == BOX_BOX) {
        scene_add_box(scene, 0, 0.05, 0.04, 0.03, 3, material);
        return which == BOX_BOX ? 0.08 : 0.03;
    }
    if (which == CAPSULE_HALF_SPACE) {
        s = scene_add(scene, 0, CONTACT_CAPSULE, material);
        s->radius_m = 0.06;
        s->length_m = 0.2;
        return 0.16;
    }
    scene_add(scene, 0, CONTACT_MESH, material)->mesh = fixture_foot;
    return which == FOOT_TERRAIN ? 0.0932 + 0.054 : 0.0932;
}

/* Turned about an axis that leans. */
static void place_turned(struct body_motion *motion, double angle, double z)
{
    const double axis[3] = {0.6, 0.8, 0};

    scene_place(motion, 0.002, 0.001, z);
    mat3_about_axis(axis, angle, motion->R);
}

/* ---- closed forms ---- */

TEST(a_flat_side_pushes_by_two_straight_lines)
{
    for (int which = BOX_HALF_SPACE; which <= BOX_BOX; which++) {
        for (int law = 0; law < 2; law++) {
            struct scene scene;
            double top = make_scene(&scene, which, &backed);
            struct contact_world *world;

            scene.config.mesh_law = law ? CONTACT_ELASTIC_FOUNDATION : CONTACT_PRESSURE_FIELD;
            world = fixture_native(&scene);
            for (double x = 0.5e-3; x < 6e-3; x += 0.7e-3) {
                double beyond = fmax(x - layers, 0), area = 0.1 * 0.08;
                struct contact_wrench wrench;
                struct contact_patch patch;
                struct body_motion motion;

                scene_place(&motion, 0, 0, top - x);
                fixture_evaluate(world, &motion, &wrench);
                assert_int_equal(world->ops->patches(world, &patch, 1), 1);
                assert_near(wrench.force[2], area * (k * x + more * beyond), 1e-6);
                assert_near(patch.area_m2, area, 1e-9);
                assert_near(patch.penetration_m, x, 1e-12);
                assert_near(patch.potential_j, area * (k * x * x + more * beyond * beyond) / 2,
                            1e-6);
            }
        }
    }
}

/* A box on its corner: a pyramid below the plane, and a smaller one below the layers. */
TEST(a_corner_pushes_with_two_pyramids)
{
    const double angle = acos(1 / sqrt(3)), axis[3] = {-sqrt(0.5), sqrt(0.5), 0}, x = 5e-3;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &backed);
    scene_add_box(&scene, 0, 0.05, 0.05, 0.05, 3, &backed);
    scene_add_pair(&scene, 0, 1);
    scene_place(&motion, 0, 0, 0.05 * sqrt(3) - x);
    mat3_about_axis(axis, angle, motion.R);
    fixture_evaluate(fixture_native(&scene), &motion, &wrench);
    assert_near(wrench.force[2], sqrt(3) / 2 * (k * x * x * x + more * pow(x - layers, 3)),
                1e-9 * wrench.force[2]);
}

TEST(a_capsule_on_end_pushes_with_two_caps)
{
    const double x = 5e-3, beyond = x - layers, R = 0.06;
    struct scene scene;
    double top = make_scene(&scene, CAPSULE_HALF_SPACE, &backed);
    struct body_motion motion;
    struct contact_wrench wrench;
    double expected =
        fixture_pi * (k * x * x * (R - x / 3) + more * square(beyond) * (R - beyond / 3));

    scene_place(&motion, 0, 0, top - x);
    fixture_evaluate(fixture_native(&scene), &motion, &wrench);
    assert_near(wrench.force[2], expected, 1e-9 * expected);
}

/* Two spheres without an axis, by the law of contact.h. */
TEST(capsules_push_with_two_laws_of_ends)
{
    const double x = 3e-3;
    struct scene scene;
    struct body_motion motion[2];
    struct contact_wrench wrench[2];

    scene_init(&scene, 2);
    for (int i = 0; i < 2; i++) {
        scene_add(&scene, i, CONTACT_CAPSULE, &backed)->radius_m = 0.05;
    }
    scene_add_pair(&scene, 0, 1);
    scene_place(&motion[0], 0, 0, 0);
    scene_place(&motion[1], 0, 0.1 - x, 0);
    fixture_evaluate(fixture_native(&scene), motion, wrench);
    assert_near(wrench[1].force[1],
                fixture_pi * 0.025 * (k * square(x) + more * square(x - layers)),
                1e-9 * wrench[1].force[1]);
}

/* ---- energy ---- */

/* What is stored is the work of pressing: leaning bodies, and past the layers. */
TEST(what_is_stored_is_the_work_of_pressing)
{
    for (int which = 0; which < FOOT_TERRAIN; which++) {
        const int steps = 4000;
        struct scene scene;
        double top = make_scene(&scene, which, &backed) + 0.02, way = 0.045, work = 0;
        struct contact_world *world = fixture_native(&scene);
        struct contact_patch patch = {0};
        struct contact_wrench wrench;
        struct body_motion motion;

        for (int i = 0; i < steps; i++) {
            place_turned(&motion, 0.3, top - way * (i + 0.5) / steps);
            fixture_evaluate(world, &motion, &wrench);
            work += wrench.force[2] * way / steps;
        }
        place_turned(&motion, 0.3, top - way);
        fixture_evaluate(world, &motion, &wrench);
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        print_message("# scene %d: %.3f J, %.3f J stored, %.2f mm deep\n", which, work,
                      patch.potential_j, 1e3 * patch.penetration_m);
        assert_true(patch.penetration_m > 2 * layers);
        /* A tilted mesh on a mesh reports k A x^2/2, which is not all of U near edges */
        if (which != BOX_BOX) {
            assert_near(patch.potential_j, work, 1e-3 * work);
        }
    }
}

/* A closed path through the layers and back: what goes in comes out. */
TEST(no_closed_path_gains_energy)
{
    const int scenes[] = {BOX_BOX, CAPSULE_HALF_SPACE, FOOT_TERRAIN};

    for (int n = 0; n < 3; n++) {
        const int steps = 1500, which = scenes[n];
        struct scene scene;
        double top = make_scene(&scene, which, &backed), sum = 0, all = 0;
        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < steps; i++) {
            double phase = 2 * fixture_pi * (i + 0.5) / steps, step = 2 * fixture_pi / steps;
            const double axis[3] = {0.6, 0.8, 0};
            struct contact_wrench wrench;
            struct body_motion motion;
            double tilt, work;

            place_turned(&motion, 0.02 + 0.02 * sin(phase), top - 2e-3 + 3e-3 * cos(phase + 1));
            fixture_evaluate(world, &motion, &wrench);
            tilt = 0.02 * cos(phase) * step;
            work = -3e-3 * sin(phase + 1) * step * wrench.force[2] +
                   tilt * vec3_dot(axis, wrench.moment);
            sum += work;
            all += fabs(work);
        }
        print_message("# scene %d: %.2e J of %.3f J\n", which, sum, all);
        assert_true(all > 0.01);
        assert_near(sum, 0, 1e-4 * all);
    }
}

/* ---- before the layers end ---- */

TEST(nothing_changes_before_the_layers_end)
{
    struct contact_material endless = backed;

    endless.backing_pa_per_m = 0;
    for (int which = 0; which < SCENES; which++) {
        struct scene scene;
        struct contact_wrench wrench[2];
        struct body_motion motion;
        double top = make_scene(&scene, which, &backed);
        struct contact_patch patch;
        struct contact_world *world = fixture_native(&scene);

        /* As deep as 1.9 mm: lowered by what it lacks */
        place_turned(&motion, 0.05, top);
        for (int i = 0; i < 200; i++) {
            fixture_evaluate(world, &motion, &wrench[0]);
            if (world->ops->patches(world, &patch, 1) == 1 && patch.penetration_m > 0.95 * layers) {
                break;
            }
            motion.p[2] -= 0.02e-3 * (world->ops->patches(world, &patch, 1) ? 1 : 10);
        }
        while (world->ops->patches(world, &patch, 1) && patch.penetration_m > layers) {
            motion.p[2] += 0.02e-3;
            fixture_evaluate(world, &motion, &wrench[0]);
        }
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        make_scene(&scene, which, &endless);
        fixture_evaluate(fixture_native(&scene), &motion, &wrench[1]);
        assert_memory_equal(&wrench[0], &wrench[1], sizeof wrench[0]);

        /* And something does behind them */
        motion.p[2] -= 1e-3;
        fixture_evaluate(world, &motion, &wrench[0]);
        fixture_evaluate(fixture_native(&scene), &motion, &wrench[1]);
        assert_true(wrench[0].force[2] > 1.05 * wrench[1].force[2]);
    }
}

/* A layer without end on either side makes one of both. */
TEST(one_endless_layer_is_endless)
{
    struct contact_material endless = backed;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    endless.backing_pa_per_m = 0;
    make_scene(&scene, BOX_HALF_SPACE, &backed);
    scene.surface[1].material = endless;
    scene_place(&motion, 0, 0, 0.03 - 5e-3);
    fixture_evaluate(fixture_native(&scene), &motion, &wrench);
    assert_near(wrench.force[2], 0.1 * 0.08 * k * 5e-3, 1e-6);
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
