/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Capsules in the native contact engine, against closed forms, against the volume below a plane
 * summed over the plane, and against their own stored energy.
 */
#include "base/array.h"

#include "tests/physics/contact_fixture.h"

/* Half of it as hard as the two together: k = 5e7 Pa/m. */
static const struct contact_material hard = {1e6, 1e-2, 0, 0, 0, 0, 0};
static const double stiffness = 5e7;

/* Turns about x by an angle: leans the axis z of a surface that is at its body's origin. */
static void lean(struct body_motion *motion, double angle)
{
    motion->R[4] = motion->R[8] = cos(angle);
    motion->R[5] = -sin(angle);
    motion->R[7] = sin(angle);
}

static struct contact_world *round_on_ground(enum contact_shape shape, double radius, double length,
                                             const struct contact_material *material)
{
    static struct scene scene;
    struct contact_surface *s;

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, material);
    s = scene_add(&scene, 0, shape, material);
    s->radius_m = radius;
    s->length_m = length;
    scene_add_pair(&scene, 0, 1);
    return fixture_native(&scene);
}

static struct contact_world *capsule_on_ground(double radius, double length)
{
    return round_on_ground(CONTACT_CAPSULE, radius, length, &hard);
}

static struct contact_world *two_round(double radius[2], double length[2])
{
    static struct scene scene;

    scene_init(&scene, 2);
    for (int i = 0; i < 2; i++) {
        struct contact_surface *s =
            scene_add(&scene, i, length[i] < 0 ? CONTACT_SPHERE : CONTACT_CAPSULE, &hard);

        s->radius_m = radius[i];
        s->length_m = length[i] < 0 ? 0 : length[i];
    }
    scene_add_pair(&scene, 0, 1);
    return fixture_native(&scene);
}

static double cap_volume(double radius, double depth)
{
    return fixture_pi * depth * depth * (radius - depth / 3);
}

/* How deep the lower side of a capsule is below the plane, over a place on it: the axis runs from
 * (0, 0, low) by length at angle to the plane, in x and up. */
static double depth_below(double radius, double length, double angle, double low, double x,
                          double y)
{
    double from = 0, to = length, best = 0;

    /* The spheres along the axis: a concave function of the place on it where they are over x, y */
    for (int i = 0; i < 100; i++) {
        double s[2] = {from + (to - from) / 3, to - (to - from) / 3}, depth[2];

        for (int k = 0; k < 2; k++) {
            double dx = x - s[k] * cos(angle), room = radius * radius - dx * dx - y * y;

            depth[k] = room > 0 ? sqrt(room) - low - s[k] * sin(angle) : -1e3 - room * -1e6;
        }
        best = fmax(best, fmax(depth[0], depth[1]));
        if (depth[0] < depth[1]) {
            from = s[0];
        } else {
            to = s[1];
        }
    }
    return best;
}

/* ---- on a half-space ---- */

TEST(lying_and_standing_capsules_push_with_k_times_their_volume_below)
{
    const double R = 0.06, L = 0.18, depth[] = {1e-5, 1e-4, 1e-3, 5e-3, 2e-2};
    struct contact_world *world = capsule_on_ground(R, L);
    struct body_motion motion;
    struct contact_wrench wrench;
    struct contact_patch patch;

    for (int i = 0; i < 5; i++) {
        double x = depth[i], down = R - x;
        double segment = R * R * acos(down / R) - down * sqrt(R * R - down * down);
        double force = stiffness * (segment * L + cap_volume(R, x));

        scene_place(&motion, 0.1, 0.2, R - x);
        lean(&motion, fixture_pi / 2);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], force, 1e-4 * force);
        assert_near(vec3_norm(wrench.moment), 0, 1e-6 * force);
        assert_int_equal(world->ops->patches(world, &patch, 1), 1);
        assert_near(patch.penetration_m, x, 1e-12);

        force = stiffness * cap_volume(R, x);
        scene_place(&motion, 0.1, 0.2, L / 2 + R - x);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], force, 1e-9 * force);
        assert_near(vec3_norm(wrench.moment), 0, 1e-9 * force);
    }
}

TEST(capsule_at_any_angle_pushes_with_k_times_the_volume_below_at_its_center)
{
    const double R = 0.06, L = 0.18, angle[] = {0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.2, 1.57};
    const double step = 2.5e-4;
    struct contact_world *world = capsule_on_ground(R, L);

    for (int i = 0; i < 9; i++) {
        for (int deep = 0; deep < 2; deep++) {
            double low = R - (deep ? 1e-2 : 2e-3), volume = 0, first = 0, force;
            struct body_motion motion;
            struct contact_wrench wrench;

            for (double x = -R + step / 2; x < L + R; x += step) {
                for (double y = step / 2; y < R; y += step) {
                    double depth = depth_below(R, L, angle[i], low, x, y);

                    volume += 2 * depth * step * step;
                    first += 2 * depth * step * step * x;
                }
            }

            /* The middle of the axis is at the body's origin, its z along the axis and up */
            scene_place(&motion, 0, 0, low + L / 2 * sin(angle[i]));
            motion.R[0] = motion.R[8] = sin(angle[i]);
            motion.R[2] = cos(angle[i]);
            motion.R[6] = -cos(angle[i]);
            fixture_evaluate(world, &motion, &wrench);
            force = stiffness * volume;
            assert_near(wrench.force[2], force, 2e-3 * force);
            assert_near(wrench.moment[1], -stiffness * (first - volume * L / 2 * cos(angle[i])),
                        2e-3 * force * R);
        }
    }
}

/* Computes the volume of a cylinder below the plane, and its moment about the middle of the axis,
 * as sums over strips along the axis. height: of the middle; angle: of the axis from the
 * vertical. */
static void cylinder_below(double radius, double length, double angle, double height,
                           double *volume, double *moment)
{
    enum { STRIPS = 200000 };

    *volume = *moment = 0;
    for (int i = 0; i < STRIPS; i++) {
        const double up = radius * (2 * (i + 0.5) / STRIPS - 1), above = height + up * sin(angle);
        const double to = fmax(fmin(-above / (cos(angle) + 1e-300), length / 2), -length / 2);
        const double part =
            2 * sqrt(radius * radius - up * up) * 2 * radius / STRIPS * (to + length / 2);

        *volume += part;
        *moment -= part * ((to - length / 2) / 2 * sin(angle) - up * cos(angle));
    }
}

/* The cases are rolling and tipping wheels, a foot on its flat end, and a long cylinder that
 * leans. */
TEST(cylinder_at_any_angle_pushes_with_k_times_the_volume_below_at_its_center)
{
    static const double size[][2] = {{0.08, 0.03}, {0.05, 0.4}};
    static const double angle[] = {0, 1e-3, 0.03, 0.2, 0.7, 1.2, 1.5, 1.57079, 1.5707963267948966};

    for (size_t i = 0; i < ARRAY_COUNT(size) * ARRAY_COUNT(angle); i++) {
        const double R = size[i % 2][0], L = size[i % 2][1], lean_by = angle[i / 2], h = 1e-6;
        struct contact_world *world = round_on_ground(CONTACT_CYLINDER, R, L, &hard);
        double force[3], moment[3], energy[3], volume, about;

        for (int k = 0; k < 3; k++) {
            /* Level, raised by h, and leaned less by h/R */
            const double a = lean_by - (k == 2 ? h / R : 0);
            const double height =
                R * fabs(sin(lean_by)) + L / 2 * fabs(cos(lean_by)) - 6e-3 + (k == 1 ? h : 0);
            struct body_motion motion;
            struct contact_wrench wrench;
            struct contact_patch patch;

            scene_place(&motion, 0, 0, height);
            motion.R[0] = motion.R[8] = cos(a);
            motion.R[2] = sin(a);
            motion.R[6] = -sin(a);
            fixture_evaluate(world, &motion, &wrench);
            assert_int_equal(world->ops->patches(world, &patch, 1), 1);
            force[k] = wrench.force[2];
            moment[k] = wrench.moment[1];
            energy[k] = patch.potential_j;
            cylinder_below(R, L, a, height, &volume, &about);
            assert_near(wrench.force[2], stiffness * volume, 1e-4 * stiffness * volume);
            assert_near(wrench.moment[1], stiffness * about, 1e-4 * stiffness * volume * R);
            assert_near(vec3_norm((const double[3]){wrench.moment[0], wrench.moment[2], 0}), 0,
                        1e-9 * force[k]);
        }

        /* The force is the slope of the stored energy */
        assert_near((energy[1] - energy[0]) / h, -(force[0] + force[1]) / 2, 1e-3 * force[0]);
        assert_near((energy[0] - energy[2]) / (h / R), -(moment[0] + moment[2]) / 2,
                    2e-3 * force[0] * R);
    }
}

/* A disc spins on its end. Under even pressure the mean lever of friction is two thirds of the
 * radius. */
TEST(friction_brakes_a_cylinder_that_spins_on_its_end)
{
    const struct contact_material rough = {1e6, 1e-2, 0, 0.5, 0.5, 0, 0};
    const double R = 0.08;
    struct contact_world *world = round_on_ground(CONTACT_CYLINDER, R, 0.03, &rough);
    struct body_motion motion;
    struct contact_wrench wrench;

    scene_place(&motion, 0, 0, 0.015 - 1e-3);
    motion.w[2] = 10;
    fixture_evaluate(world, &motion, &wrench);
    assert_near(wrench.moment[2], -0.5 * wrench.force[2] * R * 2 / 3, 1e-3 * wrench.force[2] * R);
    assert_near(hypot(wrench.force[0], wrench.force[1]), 0, 1e-9 * wrench.force[2]);
}

/* ---- on each other ---- */

TEST(crossed_capsules_push_as_paraboloids_do)
{
    double radius[2] = {0.05, 0.07}, length[2] = {0.3, 0.3};
    struct contact_world *world = two_round(radius, length);
    const double angle[] = {0.4, 0.8, 1.2, fixture_pi / 2}, x = 1e-4;

    for (int i = 0; i < 4; i++) {
        struct body_motion motion[2];
        struct contact_wrench wrench[2];
        double force = stiffness * fixture_pi * x * x * sqrt(radius[0] * radius[1]) / sin(angle[i]);

        /* Side by side along x; the axes are z, and the second is turned about x */
        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], radius[0] + radius[1] - x, 0.01, 0.02);
        lean(&motion[1], angle[i]);
        fixture_evaluate(world, motion, wrench);
        assert_near(wrench[1].force[0], force, 2e-3 * force);
        assert_near(wrench[0].force[0], -wrench[1].force[0], 1e-12 * force);
    }
}

TEST(parallel_capsules_push_along_a_line)
{
    double radius[2] = {0.05, 0.07}, length[2] = {0.3, 0.3}, both[2] = {0.3, 0.1};
    const double x = 1e-3, round = 0.05 * 0.07 / 0.12;
    struct body_motion motion[2];
    struct contact_wrench wrench[2];
    double side = stiffness * 4 / 3 * sqrt(2 * round) * pow(x, 1.5);
    double end = stiffness * fixture_pi * round * x * x;

    scene_place(&motion[0], 0, 0, 0);
    scene_place(&motion[1], 0, radius[0] + radius[1] - x, 0);
    fixture_evaluate(two_round(radius, length), motion, wrench);
    assert_near(wrench[1].force[1], side * 0.3 + end, 1e-3 * side * 0.3);
    assert_near(vec3_norm(wrench[1].moment), 0, 1e-9 * side);

    /* The shorter one lies at the longer one's middle; a little beyond its own ends counts too */
    fixture_evaluate(two_round(radius, both), motion, wrench);
    assert_in_range((int)(1e4 * wrench[1].force[1] / (side * 0.1 + end)), 9900, 10700);
}

TEST(tips_push_half_as_much_as_spheres_on_each_other)
{
    double radius[2] = {0.05, 0.07}, length[2] = {0.3, 0.2}, with_sphere[2] = {0.3, -1};
    const double x = 1e-5;
    const double force = stiffness * fixture_pi * 0.05 * 0.07 / 0.12 * x * x;
    struct body_motion motion[2];
    struct contact_wrench wrench[2];

    scene_place(&motion[0], 0, 0, 0);
    scene_place(&motion[1], 0, 0, 0.15 + 0.05 + 0.07 + 0.1 - x);
    fixture_evaluate(two_round(radius, length), motion, wrench);
    assert_near(wrench[1].force[2], force / 2, 0.01 * force);
    scene_place(&motion[1], 0, 0, 0.15 + 0.05 + 0.07 - x);
    fixture_evaluate(two_round(radius, with_sphere), motion, wrench);
    assert_near(wrench[1].force[2], 0.75 * force, 0.01 * force);
}

TEST(capsule_without_length_is_a_sphere_from_every_side)
{
    double radius[2] = {0.05, 0.07}, none[2] = {0, 0.2}, sphere[2] = {-1, 0.2};
    const double way[3][3] = {{0, 1, 0}, {0, 0, 1}, {0, 0.6, 0.8}};
    struct body_motion motion[2];
    struct contact_wrench of_capsule[2], of_sphere[2];

    for (int i = 0; i < 3; i++) {
        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], 0, 0.119 * way[i][1], 0.119 * way[i][2] + 0.1);
        fixture_evaluate(two_round(radius, none), motion, of_capsule);
        fixture_evaluate(two_round(radius, sphere), motion, of_sphere);
        for (int k = 0; k < 3; k++) {
            assert_near(of_capsule[1].force[k], of_sphere[1].force[k],
                        1e-9 * vec3_norm(of_sphere[1].force));
        }
    }
}

TEST(capsules_with_a_slack_push_as_thinner_ones_do)
{
    double radius[2] = {0.05, 0.07}, thin[2] = {0.04, 0.06}, length[2] = {0.3, 0.2};

    for (int i = 0; i < 40; i++) {
        struct scene scene;
        struct body_motion motion[2];
        struct contact_wrench wrench[2], of_thin[2];

        /* From touching at full width to 5 mm of what counts */
        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], 0.01, 0.12 - 0.025 * i / 39.0, 0.05);
        lean(&motion[1], 0.3);
        fixture_evaluate(two_round(thin, length), motion, of_thin);
        scene_init(&scene, 2);
        for (int s = 0; s < 2; s++) {
            struct contact_surface *surface = scene_add(&scene, s, CONTACT_CAPSULE, &hard);

            surface->radius_m = radius[s];
            surface->length_m = length[s];
        }
        scene_add_pair(&scene, 0, 1);
        scene.pair[0].slack_m = 0.02;
        fixture_evaluate(fixture_native(&scene), motion, wrench);
        for (int k = 0; k < 3; k++) {
            assert_near(wrench[1].force[k], of_thin[1].force[k],
                        1e-9 * vec3_norm(of_thin[1].force));
            assert_near(wrench[1].moment[k], of_thin[1].moment[k],
                        1e-9 * vec3_norm(of_thin[1].moment));
        }
    }
}

/* ---- energy ---- */

static double stored(struct contact_world *world, const struct body_motion motion[2])
{
    struct contact_wrench wrench[2];
    struct contact_patch patch = {0};

    fixture_evaluate(world, motion, wrench);
    return world->ops->patches(world, &patch, 1) ? patch.potential_j : 0;
}

/* Work around closed loops through poses of two bodies against what is stored on the way. */
TEST(what_a_closed_way_gains_is_nothing_against_what_it_stores)
{
    const int steps = 2000;

    for (int kind = 5; kind <= 7; kind++) {
        struct scene scene;
        double height = fixture_two_bodies(&scene, kind), gained = 0, most = 0;

        for (int s = 0; s < 2; s++) {
            scene.surface[s].material = hard;
        }

        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < steps; i++) {
            double t = 2 * fixture_pi * (i + 0.5) / steps, dt = 2 * fixture_pi / steps;
            struct body_motion motion[2];
            struct contact_wrench wrench[2];

            /* Tilted, pushed along, tilted back: the axis is the body's x */
            scene_place(&motion[0], 0, 0, 0);
            scene_place(&motion[1], 0.05 * sin(t + 0.4), 0.01 * cos(t),
                        height + 1e-3 * cos(2 * t + 0.5));
            fixture_turn_y(&motion[1], 0.3 * cos(t) + 0.2 * sin(2 * t));
            fixture_evaluate(world, motion, wrench);
            gained += dt * (0.05 * cos(t + 0.4) * wrench[1].force[0] -
                            0.01 * sin(t) * wrench[1].force[1] -
                            2e-3 * sin(2 * t + 0.5) * wrench[1].force[2] +
                            (-0.3 * sin(t) + 0.4 * cos(2 * t)) * wrench[1].moment[1]);
            most = fmax(most, stored(world, motion));
        }
        assert_true(most > 0);
        print_message("kind %d: gained %g J, stored %g J\n", kind, gained, most);
        assert_near(gained, 0, 2e-4 * most); /* the sums over the slices and axes */
    }
}

/* ---- what is refused ---- */

TEST(capsules_for_simbody_are_refused)
{
    struct scene scene;
    struct contact_world *world;
    struct error error;

    scene_init(&scene, 1);
    scene_add(&scene, 0, CONTACT_CAPSULE, &hard)->radius_m = 0.1;
    assert_int_equal(contact_simbody_create(&scene.config, &world, &error), ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "capsule"));
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
