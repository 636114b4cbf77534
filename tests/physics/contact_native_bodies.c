/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Free rigid bodies on the native contact engine, integrated here by a Runge-Kutta method of fourth
 * order: what they do has to be what mechanics says, whatever the engine does inside.
 */

#include "tests/physics/contact_bodies.h"
#include "tests/physics/near.h"

#define G 9.81

/* ---- the tests ---- */

TEST(a_box_at_rest_is_carried_with_its_weight)
{
    for (int table = 0; table < 2; table++) {
        struct scene scene;
        struct contact_wrench wrench;
        struct bodies b;

        cube_on_ground(&scene, table, &plain);
        scene.surface[1].material.dissipation_s_per_m = 100;
        b = make(&scene, 1.5);
        b.gravity[2] = -G;
        b.motion[0].p[2] = 0.075;
        run(&b, 2, 2e-4);
        b.world->ops->evaluate(b.world, b.motion, NULL, &wrench);
        assert_near(wrench.force[2], 14.715, 1e-4);
        assert_near(b.motion[0].p[2], 0.075 - 14.715 / (5e5 * 0.0225), 1e-8);
        assert_near(vec3_norm(b.motion[0].v), 0, 1e-5);
    }
}

/* Any force f(x) (1 + d x') on a mass: the speeds before and after are tied by
 * v1/d + ln(1 - d v1)/d^2 = -v0/d + ln(1 + d v0)/d^2 (integrate x'' dx). */
static double rebound(double d, double v0)
{
    double goal = -v0 / d + log1p(d * v0) / (d * d), low = 0, high = fmin(v0, (1 - 1e-12) / d);

    for (int i = 0; i < 200; i++) {
        double v = (low + high) / 2;

        if (v / d + log1p(-d * v) / (d * d) > goal) {
            low = v;
        } else {
            high = v;
        }
    }
    return low;
}

TEST(a_bouncing_sphere_loses_what_the_dissipation_says)
{
    const double speed[] = {0.05, 0.3, 1};

    for (int box = 0; box < 2; box++) {
        struct scene scene;
        struct bodies b;
        /* Hertz's law damps half as much again */
        double d = 0.3 * (box ? 1 : 1.5);

        scene_init(&scene, 1);
        if (box) {
            scene_add_box(&scene, -1, 0.2, 0.2, 0.1, 3, &plain)->position[2] = -0.1;
        } else {
            scene_add(&scene, -1, CONTACT_HALF_SPACE, &plain);
        }
        scene_add(&scene, 0, CONTACT_SPHERE, &plain)->radius_m = 0.05;
        scene_add_pair(&scene, 0, 1);
        b = make(&scene, 0.1);
        for (int i = 0; i < 3; i++) {
            scene_place(&b.motion[0], 0.01, 0.02, 0.05 + 1e-9);
            b.motion[0].v[2] = -speed[i];
            for (int n = 0; n < 200000 && b.motion[0].p[2] <= 0.05 + 2e-9; n++) {
                step(&b, 2e-5);
            }
            assert_near(b.motion[0].v[2], rebound(d, speed[i]), 1e-4 * speed[i]);
        }
    }
}

TEST(colliding_bodies_exchange_momentum_and_lose_none)
{
    uint64_t seed = 31;

    for (int n = 0; n < 40; n++) {
        struct scene scene;
        struct bodies b;
        double before[6] = {0}, after[6] = {0}, change = 0, first[3];

        scene_init(&scene, 2);
        scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 3, &plain);
        if (n % 2) {
            scene_add(&scene, 1, CONTACT_SPHERE, &plain)->radius_m = 0.05;
        } else {
            scene_add_box(&scene, 1, 0.05, 0.06, 0.07, 2, &plain);
        }
        scene_add_pair(&scene, 0, 1);
        b = make(&scene, 1.5);
        b.mass[1] = 0.7;
        b.inertia[1] = 1e-3;
        scene_place(&b.motion[1], 0.02 * random_number(&seed), 0.02 * random_number(&seed), 0.16);
        scene_random_rotation(&seed, 0.2, b.motion[1].R);
        for (int i = 0; i < 3; i++) {
            b.motion[0].w[i] = random_number(&seed);
            b.motion[1].w[i] = random_number(&seed);
            b.motion[1].v[i] = 0.1 * random_number(&seed) - (i == 2 ? 0.5 : 0);
            first[i] = b.motion[0].v[i];
        }
        for (int s = 0; s < 1201; s++) {
            double *sum = s == 0 ? before : after;

            memset(sum, 0, sizeof before);
            for (int k = 0; k < 2; k++) {
                double arm[3];

                vec3_cross(b.motion[k].p, b.motion[k].v, arm);
                for (int i = 0; i < 3; i++) {
                    sum[i] += b.mass[k] * b.motion[k].v[i];
                    sum[3 + i] += b.mass[k] * arm[i] + b.inertia[k] * b.motion[k].w[i];
                }
            }
            step(&b, 2.5e-4);
        }
        for (int i = 0; i < 3; i++) {
            change = fmax(change, fabs(b.motion[0].v[i] - first[i]));
        }
        assert_true(change > 0.05);
        for (int i = 0; i < 6; i++) {
            /* Of the method's order in the step */
            assert_near(after[i], before[i], i < 3 ? 1e-12 : 1e-7);
        }
    }
}

TEST(stacked_boxes_stay)
{
    struct scene scene;
    struct contact_wrench wrench[BODIES];
    struct bodies b;

    scene_init(&scene, 3);
    scene_add_box(&scene, -1, 0.5, 0.5, 0.1, 1, &plain)->position[2] = -0.1;
    scene.surface[0].material.young_pa = 1e7;
    for (int n = 0; n < 3; n++) {
        scene_add_box(&scene, n, 0.075, 0.075, 0.075, 7, &plain);
        /* Softer than this a tower of three topples by itself */
        scene.surface[1 + n].material.young_pa = 1e7;
        scene.surface[1 + n].material.dissipation_s_per_m = 60;
        scene_add_pair(&scene, n, n + 1);
    }
    b = make(&scene, 1.5);
    b.gravity[2] = -G;
    for (int n = 0; n < 3; n++) {
        b.motion[n].p[0] = 0.004 * n;
        b.motion[n].p[2] = 0.075 + 0.15 * n;
    }
    run(&b, 2, 2.5e-4);
    b.world->ops->evaluate(b.world, b.motion, NULL, wrench);
    for (int n = 0; n < 3; n++) {
        /* The tower leans by 1 mrad, and so do the springs by half of it; against that little force
         * friction lets the boxes creep, at a fraction of the transition velocity */
        assert_near(b.motion[n].p[0], 0.004 * n, 0.25 * SCENE_TRANSITION_M_S * 2);
        assert_near(b.motion[n].p[1], 0, 1e-6);
        assert_true(b.motion[n].R[8] > 1 - 1e-4);
        assert_true(vec3_norm(b.motion[n].v) < 0.3 * SCENE_TRANSITION_M_S);
        assert_near(wrench[n].force[2], 14.715, 0.1);
    }
}

TEST_GROUP(set_up, tear_down)
