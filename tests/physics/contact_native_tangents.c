/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The native engine's tangents: without friction the slopes of the wrench, with friction no less
 * than what it resists.
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

#include "tests/physics/contact_fixture.h"
#include "tests/physics/near.h"

/* A velocity's or small displacement's six numbers applied to a body about a point. */
static void disturb(struct body_motion *motion, const double center[3], int axis, double step,
                    bool velocity)
{
    double arm[3], turn[3], e[3] = {axis % 3 == 0, axis % 3 == 1, axis % 3 == 2};

    for (int i = 0; i < 3; i++) {
        arm[i] = motion->p[i] - center[i];
    }
    vec3_cross(e, arm, turn);
    for (int i = 0; i < 3; i++) {
        double *place = velocity ? motion->v : motion->p;

        place[i] += step * (axis < 3 ? e[i] : turn[i]);
        if (axis >= 3 && velocity) {
            motion->w[i] += step * e[i];
        }
    }
    if (axis >= 3 && !velocity) {
        for (int column = 0; column < 3; column++) {
            double v[3] = {motion->R[column], motion->R[3 + column], motion->R[6 + column]};

            vec3_cross(e, v, turn);
            for (int row = 0; row < 3; row++) {
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

    for (int i = 0; i < 3; i++) {
        arm[i] = motion->p[i] - center[i];
    }
    vec3_cross(arm, wrench->force, turn);
    for (int i = 0; i < 3; i++) {
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
    for (int kind = 0; kind < 3; kind++) {
        struct scene scene;
        double height = fixture_two_bodies(&scene, kind);

        for (int s = 0; s < 2; s++) {
            struct contact_material *m = &scene.surface[s].material;

            m->static_friction = m->dynamic_friction = m->viscous_friction = 0;
        }

        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < 10; i++) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2];
            struct contact_tangent t;
            double load;
            int b = scene.pair[0].b;

            fixture_two_motions(&seed, height, motion);
            for (int body = 0; body < 2; body++) {
                memset(motion[body].v, 0, sizeof motion[body].v);
                memset(motion[body].w, 0, sizeof motion[body].w);
            }
            fixture_evaluate(world, motion, wrench);
            if (world->ops->tangents(world, &t, 1) == 0) {
                continue;
            }
            load = vec3_norm(wrench[b].force);
            assert_int_equal(t.pair, 0);
            assert_int_equal(t.body_a, scene.pair[0].a);
            assert_int_equal(t.body_b, b);
            for (int column = 0; column < 6; column++) {
                for (int velocity = 0; velocity < 2; velocity++) {
                    const double *S = velocity ? t.D : t.K, step = 1e-7;
                    double side[2][6], center[3];

                    for (int way = 0; way < 2; way++) {
                        struct body_motion moved[2];

                        memcpy(moved, motion, sizeof moved);
                        disturb(&moved[b], t.center, column, way ? step : -step, velocity);
                        fixture_evaluate(world, moved, wrench);
                        /* The center goes along with the body */
                        memcpy(center, t.center, sizeof center);
                        if (column < 3 && !velocity) {
                            center[column] += way ? step : -step;
                        }
                        about(&moved[b], &wrench[b], center, side[way]);
                    }
                    for (int row = 0; row < 6; row++) {
                        double slope = -(side[1][row] - side[0][row]) / (2 * step);
                        double size =
                            sqrt(entry(S, row, row) * entry(S, column, column)) +
                            entry(S, 2, 2) * (row < 3 ? 1 : 0.02) * (column < 3 ? 1 : 0.02);

                        size += kind > 0 ? 10 * load : 0;

                        /* On a half-space exact but for force times depth; elsewhere normals turn
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
    double height = fixture_two_bodies(&scene, 0);
    struct contact_world *world = fixture_native(&scene);
    const double speed[] = {0, 2e-3, 0.01, 0.05, 1};

    (void)state;
    for (int i = 0; i < 5; i++) {
        struct body_motion motion[2];
        struct contact_wrench wrench[2], faster[2];
        struct contact_tangent t;
        double slope;

        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], 0, 0, height);
        motion[1].v[0] = speed[i];
        fixture_evaluate(world, motion, wrench);
        motion[1].v[0] += 1e-6;
        fixture_evaluate(world, motion, faster);
        /* The steepest slope up to the present speed bounds the mean slope of the last bit */
        assert_int_equal(world->ops->tangents(world, &t, 1), 1);
        slope = (wrench[1].force[0] - faster[1].force[0]) / 1e-6;
        assert_true(t.D[0] > slope * (1 - 1e-6) && t.D[0] > 0);
        assert_true(t.D[0] * motion[1].v[0] >= -faster[1].force[0] * (1 - 1e-6));
        assert_near(t.D[0], t.D[6], 1e-9 * t.D[0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tangents_are_the_slopes_of_the_wrench_without_friction),
        cmocka_unit_test(tangents_resist_sliding_at_least_as_much_as_friction_does),
    };

    return cmocka_run_group_tests_name("contact_native_tangents", tests, fixture_set_up,
                                       fixture_tear_down);
}
