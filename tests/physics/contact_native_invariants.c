/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What any contact has to obey, of both engines: action and reaction, invariance, the same bits. Of
 * the native one also a wrench that is continuous in the pose and conserves the stored energy.
 */

#include "tests/physics/contact_fixture.h"

/* The engine "simbody" has no capsules, of which the kinds from 5 on are; terrain is slow on it. */
enum { CASES = FIXTURE_KINDS + 3 };

/* Two bodies of a kind on the native engine, or of the first three kinds on the other one. */
static struct contact_world *make_case(struct scene *scene, int number, double *height)
{
    *height = fixture_two_bodies(scene, number % FIXTURE_KINDS);
    return number < FIXTURE_KINDS ? fixture_native(scene) : fixture_simbody(scene);
}

TEST(action_equals_reaction_and_patches_add_up_to_the_wrenches)
{
    uint64_t seed = 7;

    for (int number = 0; number < CASES; number++) {
        struct scene scene;
        double height;
        struct contact_world *world = make_case(&scene, number, &height);
        bool turned = scene.pair[0].a == 1;
        int touching = 0;

        for (int i = 0; i < 50; i++) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2];
            struct contact_patch patch;
            double size, moment[3] = {0}, arm[3], turn[3];
            int b = turned ? 0 : 1; /* the pair's second */

            fixture_two_motions(&seed, height, motion);
            fixture_evaluate(world, motion, wrench);
            size = vec3_norm(wrench[0].force);
            if (size == 0) {
                continue;
            }
            touching++;
            for (int n = 0; n < 2; n++) {
                vec3_cross(motion[n].p, wrench[n].force, turn);
                for (int axis = 0; axis < 3; axis++) {
                    moment[axis] += wrench[n].moment[axis] + turn[axis];
                }
            }
            assert_int_equal(world->ops->patches(world, &patch, 1), 1);
            for (int axis = 0; axis < 3; axis++) {
                arm[axis] = patch.center[axis] - motion[b].p[axis];
            }
            vec3_cross(arm, patch.force, turn);
            for (int axis = 0; axis < 3; axis++) {
                assert_near(wrench[0].force[axis] + wrench[1].force[axis], 0, 1e-14 * size);
                assert_near(moment[axis], 0, 1e-14 * size);
                assert_near(patch.force[axis], wrench[b].force[axis], 1e-14 * size);
                assert_near(patch.moment[axis] + turn[axis], wrench[b].moment[axis], 1e-14 * size);
            }
            /* Simbody tells neither */
            assert_true(number >= FIXTURE_KINDS || (patch.area_m2 > 0 && patch.penetration_m > 0));
            assert_true(patch.potential_j > 0 && patch.dissipation_w > 0);
        }
        assert_true(touching > 25);
        world->ops->destroy(world);
    }
}

TEST(moving_the_whole_scene_moves_the_wrenches_with_it)
{
    uint64_t seed = 3;

    for (int number = 0; number < CASES; number++) {
        struct scene scene;
        double height;
        struct contact_world *world = make_case(&scene, number, &height);

        for (int i = 0; i < 30; i++) {
            struct body_motion motion[2], moved[2];
            struct contact_wrench wrench[2], turned[2];
            double Q[9], shift[3], size;

            fixture_two_motions(&seed, height, motion);
            scene_random_rotation(&seed, 3, Q);
            for (int axis = 0; axis < 3; axis++) {
                shift[axis] = 2 * random_number(&seed);
            }
            fixture_move_all(Q, shift, motion, moved);
            fixture_evaluate(world, motion, wrench);
            fixture_evaluate(world, moved, turned);
            size = vec3_norm(wrench[0].force) + 1e-3;
            fixture_expect_turned(turned, Q, wrench, 1e-9 * size, 1e-10 * size);
        }
        world->ops->destroy(world);
    }
}

TEST(the_same_motion_gives_the_same_bits_whatever_came_before)
{
    uint64_t seed = 5;

    for (int number = 0; number < CASES; number++) {
        struct scene scene;
        double height;
        struct contact_world *world = make_case(&scene, number, &height);
        struct contact_world *fresh = make_case(&scene, number, &height);
        struct body_motion motion[20][2];
        struct contact_wrench first[20][2], again[2];

        for (int i = 0; i < 20; i++) {
            fixture_two_motions(&seed, height, motion[i]);
            fixture_evaluate(world, motion[i], first[i]);
        }
        for (int i = 0; i < 200; i++) {
            int pick = (int)(10 + 9.99 * random_number(&seed));
            struct body_motion apart[2];

            /* Now and then apart, so that contacts end and begin anew */
            if (i % 3 == 0) {
                memcpy(apart, motion[pick], sizeof apart);
                apart[1].p[2] += 1;
                fixture_evaluate(world, apart, again);
                assert_true(number % FIXTURE_KINDS == 0 || vec3_norm(again[0].force) == 0);
            }
            fixture_evaluate(world, motion[pick], again);
            assert_memory_equal(again, first[pick], sizeof again);
        }
        for (int i = 19; i >= 0; i--) {
            fixture_evaluate(fresh, motion[i], again);
            assert_memory_equal(again, first[i], sizeof again);
        }
        fresh->ops->destroy(fresh);
        world->ops->destroy(world);
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
    fixture_evaluate(world, motion, last);
    for (int i = 1; i <= steps; i++) {
        double change = 0;

        for (int axis = 0; axis < 3; axis++) {
            motion[1].p[axis] = from[1].p[axis] + way[axis] * i / steps;
        }
        fixture_evaluate(world, motion, now);
        for (int axis = 0; axis < 3; axis++) {
            change += fabs(now[1].force[axis] - last[1].force[axis]);
            change += 20 * fabs(now[0].moment[axis] - last[0].moment[axis]);
        }
        jump = fmax(jump, change);
        memcpy(last, now, sizeof last);
    }
    return jump;
}

TEST(the_wrench_is_continuous_in_the_pose)
{
    uint64_t seed = 29;

    for (int kind = 0; kind < FIXTURE_KINDS; kind++) {
        struct scene scene;
        double height = fixture_two_bodies(&scene, kind);
        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < 6; i++) {
            struct body_motion motion[2];
            double way[3] = {0.03 * random_number(&seed), 0.03 * random_number(&seed),
                             0.002 * random_number(&seed)};
            double coarse, fine;

            fixture_two_motions(&seed, height, motion);
            if (i % 3 == 0) {
                /* Over the edge */
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

TEST(the_elastic_force_is_the_slope_of_the_stored_energy)
{
    uint64_t seed = 41;

    for (int kind = 0; kind < 3; kind++) {
        struct scene scene;
        double height = fixture_two_bodies(&scene, kind);
        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < 20; i++) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2];
            struct contact_patch patch[2];
            double step = 1e-6, slope;

            fixture_two_motions(&seed, height, motion);
            for (int b = 0; b < 2; b++) {
                memset(motion[b].w, 0, sizeof motion[b].w);
                memset(motion[b].v, 0, sizeof motion[b].v);
            }
            fixture_evaluate(world, motion, wrench);
            if (wrench[1].force[2] == 0) {
                continue;
            }
            for (int side = 0; side < 2; side++) {
                struct body_motion moved[2];
                struct contact_wrench unused[2];

                memcpy(moved, motion, sizeof moved);
                moved[1].p[2] += (side ? 1 : -1) * step;
                fixture_evaluate(world, moved, unused);
                patch[side].potential_j = 0;
                world->ops->patches(world, &patch[side], 1);
            }
            slope = (patch[0].potential_j - patch[1].potential_j) / (2 * step);
            /* Where a mesh's own boundary moves through the overlap the bed is not conservative */
            assert_near(wrench[1].force[2], slope, (kind == 0 ? 1e-5 : 3e-2) * slope);
        }
    }
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
