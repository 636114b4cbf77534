/* SPDX-License-Identifier: Apache-2.0 */
/* The contact engine "simbody" against contact.h's law worked out by hand. */

#include "tests/physics/contact_fixture.h"

/* Of the right foot's outline, by the shoelace formulas, in the ankle frame. */
static const double sole_area = 0.015662135;
static const double sole_centroid[2] = {0.03163532671844123, 0.001426234343742623};

/* ---- the normal law ---- */

TEST(box_on_half_space_pushes_with_k_a_d)
{
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_patch patch;
    double k = scene_stiffness(&scene_foot, &scene_ground), area = 0.15 * 0.15;
    double depth[] = {1e-7, 1e-4, 1e-3, 6e-3};

    fixture_box_on_ground(&scene);

    struct contact_world *world = fixture_simbody(&scene);

    for (size_t i = 0; i < sizeof depth / sizeof *depth; i++) {
        double d = depth[i], force = k * area * d;

        scene_place(&motion, 0.3, -0.2, 0.075 - d);
        fixture_evaluate(world, &motion, &wrench);
        /* 0.075 - d itself rounds at 1e-17 m */
        double rounding = 1e-12 * force + k * area * 2e-17;

        assert_near(wrench.force[2], force, rounding);
        for (int axis = 0; axis < 3; axis++) {
            assert_near(axis < 2 ? wrench.force[axis] : 0, 0, rounding);
            assert_near(wrench.moment[axis], 0, rounding);
        }
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        assert_int_equal(patch.pair, 0);
        assert_near(patch.potential_j, force * d / 2, 1e-9 * force * d);
        assert_near(patch.dissipation_w, 0, 1e-12);
    }
    world->ops->destroy(world);
}

TEST(foot_pushes_with_its_sole_area_at_the_soles_centroid)
{
    const double d = 0.0017;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    double k = scene_stiffness(&scene_foot, &scene_ground), force = k * sole_area * d;

    fixture_on_ground(&scene, CONTACT_MESH)->mesh = fixture_foot;

    struct contact_world *world = fixture_simbody(&scene);

    scene_place(&motion, 1, 2, 0.0932 - d);
    fixture_evaluate(world, &motion, &wrench);
    assert_near(wrench.force[2], force, 1e-12 * force);

    /* About the ankle: the sole's centroid times the force */
    assert_near(wrench.moment[0], sole_centroid[1] * force, 1e-13 * force);
    assert_near(wrench.moment[1], -sole_centroid[0] * force, 1e-13 * force);
    assert_near(wrench.moment[2], 0, 1e-12 * force);
    world->ops->destroy(world);
}

TEST(tilted_foot_pushes_with_its_mean_depth)
{
    const double tilt = 0.02, d = 0.004;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    double k = scene_stiffness(&scene_foot, &scene_ground), c = cos(tilt), s = sin(tilt);
    const double pitch[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
    /* All of the sole stays below the ground, so the depth is linear over the triangles */
    double force = k * sole_area * (d + s * sole_centroid[0]);

    fixture_on_ground(&scene, CONTACT_MESH)->mesh = fixture_foot;

    struct contact_world *world = fixture_simbody(&scene);

    scene_place(&motion, 0, 0, 0.0932 * c - d);
    memcpy(motion.R, pitch, sizeof pitch);
    fixture_evaluate(world, &motion, &wrench);
    assert_near(wrench.force[2], force, 1e-12 * force);
    assert_near(wrench.force[0], 0, 1e-12 * force);
    world->ops->destroy(world);
}

TEST(sinking_adds_the_dissipation_and_rising_takes_it_away)
{
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_patch patch;
    double c = scene_dissipation(&scene_foot, &scene_ground), d = 1e-3;
    double elastic = scene_stiffness(&scene_foot, &scene_ground) * 0.0225 * d;
    double rate[] = {0.2, -0.2, 3, -3, -1000};

    fixture_box_on_ground(&scene);

    struct contact_world *world = fixture_simbody(&scene);

    for (size_t i = 0; i < sizeof rate / sizeof *rate; i++) {
        double force = fmax(0, elastic * (1 + c * rate[i]));
        double power = force > 0 ? elastic * c * rate[i] * rate[i] : 0;

        scene_place(&motion, 0, 0, 0.075 - d);
        motion.v[2] = -rate[i];
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], force, 1e-11 * elastic);
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        assert_near(patch.dissipation_w, power, 1e-11 * elastic);
    }
    world->ops->destroy(world);
}

TEST(sphere_on_half_space_obeys_hertz)
{
    const double radius = 0.02, d = 4e-4, rate = 0.5;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_patch patch;
    double stiff = 1e9;

    fixture_on_ground(&scene, CONTACT_SPHERE)->radius_m = radius;
    for (int pass = 0; pass < 2; pass++) {
        /* First the law as Simbody combines two materials, then a ground so stiff that it does not
         * give, where the textbook's formula has only the sphere's modulus */
        double e1 = scene_foot.young_pa, e2 = pass ? stiff * e1 : scene_ground.young_pa;
        double a = pow(e1, 2. / 3), b = pow(e2, 2. / 3), share = b / (a + b);
        double modulus = pass ? e1 : pow(a * b / (a + b), 1.5);
        double c =
            scene_foot.dissipation_s_per_m * share + scene_ground.dissipation_s_per_m * (1 - share);
        double elastic = 4. / 3 * modulus * sqrt(radius) * pow(d, 1.5);
        double tolerance = pass ? 3e-6 : 1e-11;

        scene.surface[0].material.young_pa = e2;

        struct contact_world *world = fixture_simbody(&scene);

        scene_place(&motion, -1, 1, radius - d);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], elastic, tolerance * elastic);
        assert_near(vec3_norm(wrench.moment), 0, 1e-12 * elastic);
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        assert_near(patch.potential_j, 0.4 * elastic * d, tolerance * elastic * d);

        motion.v[2] = -rate;
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], elastic * (1 + 1.5 * c * rate), tolerance * elastic);
        world->ops->destroy(world);
    }
}

TEST(half_space_is_solid_below_its_own_z_axis)
{
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    /* z of the wall's frame along world x: solid at x < 0.5 */
    const double wall[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
    double k = scene_stiffness(&scene_foot, &scene_ground);

    fixture_box_on_ground(&scene);
    memcpy(scene.surface[0].rotation, wall, sizeof wall);
    scene.surface[0].position[0] = 0.5;

    struct contact_world *world = fixture_simbody(&scene);

    scene_place(&motion, 0.5 + 0.074, 7, -3);
    fixture_evaluate(world, &motion, &wrench);
    assert_near(wrench.force[0], k * 0.0225 * 1e-3, 1e-9 * k * 0.0225);
    assert_near(wrench.force[1], 0, 1e-9);
    assert_near(wrench.force[2], 0, 1e-9);
    scene_place(&motion, 0.5 + 0.076, 7, -3);
    fixture_evaluate(world, &motion, &wrench);
    assert_true(vec3_norm(wrench.force) == 0);
    world->ops->destroy(world);
}

/* ---- friction ---- */

static double smooth_step(double x)
{
    return x * x * x * (10 + x * (-15 + 6 * x));
}

TEST(friction_follows_the_stribeck_curve_against_the_motion)
{
    double us = scene_mean(scene_foot.static_friction, scene_ground.static_friction);
    double ud = scene_mean(scene_foot.dynamic_friction, scene_ground.dynamic_friction);
    double uv = scene_mean(scene_foot.viscous_friction, scene_ground.viscous_friction);
    double ratio[] = {0.01, 0.3, 1, 1.7, 3, 12, 300};
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_patch patch;

    fixture_box_on_ground(&scene);

    struct contact_world *world = fixture_simbody(&scene);

    for (size_t i = 0; i < sizeof ratio / sizeof *ratio; i++) {
        double u = ratio[i], speed = u * SCENE_TRANSITION_M_S, mu;
        double direction[2] = {0.6, -0.8};

        if (u < 1) {
            mu = us * smooth_step(u);
        } else if (u < 3) {
            mu = us - (us - ud) * smooth_step((u - 1) / 2);
        } else {
            mu = ud;
        }
        mu += uv * speed;
        scene_place(&motion, 0, 0, 0.074);
        motion.v[0] = direction[0] * speed;
        motion.v[1] = direction[1] * speed;
        fixture_evaluate(world, &motion, &wrench);
        for (int axis = 0; axis < 2; axis++) {
            double expected = -direction[axis] * mu * wrench.force[2];

            assert_near(wrench.force[axis], expected, 1e-11 * wrench.force[2]);
        }
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        assert_near(patch.dissipation_w, mu * wrench.force[2] * speed,
                    1e-11 * wrench.force[2] * speed);
    }
    world->ops->destroy(world);
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
