/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The engine "simbody": only the pairs that were asked for touch, and motions that it refuses. What
 * any contact has to obey: contact_native_invariants.c.
 */

#include "tests/physics/contact_fixture.h"

/* ---- pairs ---- */

TEST(only_the_given_pairs_interact_in_every_subset)
{
    /* Ground, sphere, box, mesh; all of them overlap at the origin */
    static const int all[6][2] = {{0, 1}, {2, 0}, {0, 3}, {1, 2}, {3, 1}, {2, 3}};

    for (unsigned subset = 0; subset < 64; subset++) {
        struct scene scene;
        struct body_motion motion[3];
        struct contact_wrench wrench[3];
        struct contact_patch patch[8];
        unsigned seen = 0, listed[6], n = 0;

        scene_init(&scene, 3);
        scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
        scene_add(&scene, 0, CONTACT_SPHERE, &scene_foot)->radius_m = 0.1;
        scene_add_box(&scene, 1, 0.08, 0.09, 0.07, 3, &scene_foot);
        scene_add(&scene, 2, CONTACT_MESH, &scene_foot)->mesh = fixture_foot;
        for (unsigned p = 0; p < 6; p++) {
            if (subset >> p & 1) {
                scene_add_pair(&scene, all[p][0], all[p][1]);
                listed[n++] = p;
            }
        }

        struct contact_world *world = fixture_simbody(&scene);

        for (int b = 0; b < 3; b++) {
            scene_place(&motion[b], 0.01 * b, 0.003 * b, -0.02);
        }
        fixture_evaluate(world, motion, wrench);

        size_t count = world->ops->patches(world, patch, 8);

        assert_int_equal(count, n);
        for (size_t i = 0; i < count; i++) {
            seen |= 1u << listed[patch[i].pair];
        }
        assert_int_equal(seen, subset);
        world->ops->destroy(world);
    }
}

TEST(patches_writes_no_more_than_asked_and_returns_all)
{
    struct scene scene;
    struct body_motion motion[2];
    struct contact_wrench wrench[2];
    struct contact_patch patch[2];

    scene_init(&scene, 2);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    for (int b = 0; b < 2; b++) {
        scene_add(&scene, b, CONTACT_SPHERE, &scene_foot)->radius_m = 0.1;
        scene_add_pair(&scene, 0, b + 1);
        scene_place(&motion[b], b, 0, 0.09);
    }

    struct contact_world *world = fixture_simbody(&scene);

    fixture_evaluate(world, motion, wrench);
    memset(patch, 0x5a, sizeof patch);

    struct contact_patch untouched = patch[1];

    assert_int_equal(world->ops->patches(world, patch, 1), 2);
    assert_int_equal(patch[0].pair, 0);
    assert_memory_equal(&patch[1], &untouched, sizeof untouched);
    world->ops->destroy(world);
}

TEST(a_body_without_surfaces_feels_nothing)
{
    struct scene scene;
    struct body_motion motion[2];
    struct contact_wrench wrench[2];

    fixture_box_on_ground(&scene);
    scene.config.nbody = 2;

    struct contact_world *world = fixture_simbody(&scene);

    scene_place(&motion[0], 0, 0, 0.07);
    scene_place(&motion[1], 0, 0, 0.07);
    fixture_evaluate(world, motion, wrench);
    assert_true(wrench[0].force[2] > 0);
    assert_true(vec3_norm(wrench[1].force) == 0 && vec3_norm(wrench[1].moment) == 0);
    world->ops->destroy(world);
}

TEST(a_surface_may_sit_anywhere_on_its_body)
{
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    const double yaw[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    double force = scene_stiffness(&scene_foot, &scene_ground) * 4 * 0.02 * 0.03 * 1e-3;

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);

    struct contact_surface *s = scene_add_box(&scene, 0, 0.02, 0.03, 0.04, 2, &scene_foot);

    memcpy(s->rotation, yaw, sizeof yaw);
    s->position[0] = 0.5;
    s->position[1] = -0.25;
    s->position[2] = -1;
    scene_add_pair(&scene, 1, 0);

    struct contact_world *world = fixture_simbody(&scene);

    scene_place(&motion, 3, 4, 1.039);
    fixture_evaluate(world, &motion, &wrench);
    assert_near(wrench.force[2], force, 1e-9 * force);
    assert_near(wrench.moment[0], -0.25 * force, 1e-9 * force);
    assert_near(wrench.moment[1], -0.5 * force, 1e-9 * force);
    world->ops->destroy(world);
}

/* ---- input that is wrong or empty ---- */

TEST(an_invalid_motion_is_an_error_and_harms_nothing)
{
    struct scene scene;
    struct body_motion motion, broken;
    struct contact_wrench wrench, again;

    fixture_box_on_ground(&scene);

    struct contact_world *world = fixture_simbody(&scene);

    scene_place(&motion, 0, 0, 0.07);
    fixture_evaluate(world, &motion, &wrench);
    for (size_t i = 0; i < sizeof motion / sizeof(double); i++) {
        const double wrong[3] = {NAN, -INFINITY, 1e10};
        double number = wrong[i % 3];

        broken = motion;
        memcpy((char *)&broken + i * sizeof number, &number, sizeof number);
        assert_int_equal(world->ops->evaluate(world, &broken, NULL, &again), ERROR_INPUT);
        assert_non_null(strstr(world->ops->failure(world), "body 0"));
        fixture_evaluate(world, &motion, &again);
        assert_memory_equal(&again, &wrench, sizeof wrench);
    }
    world->ops->destroy(world);
}

TEST(an_empty_world_evaluates_to_nothing)
{
    struct scene scene;

    scene_init(&scene, 0);

    struct contact_world *world = fixture_simbody(&scene);

    fixture_evaluate(world, NULL, NULL);
    assert_int_equal(world->ops->patches(world, NULL, 0), 0);
    assert_string_equal(world->ops->name, "simbody");
    world->ops->destroy(world);
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
