/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The native engine's tangents: without friction the slopes of the wrench, with friction no less
 * than what it resists.
 */
#include "base/array.h"

#include "tests/physics/contact_fixture.h"

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

TEST(tangents_are_the_slopes_of_the_wrench_without_friction)
{
    uint64_t seed = 8;

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

TEST(tangents_resist_sliding_at_least_as_much_as_friction_does)
{
    struct scene scene;
    double height = fixture_two_bodies(&scene, 0);
    struct contact_world *world = fixture_native(&scene);
    const double speed[] = {0, 2e-3, 0.01, 0.05, 1};

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

/* The tangents of a plate about its middle: per area stiffness and damping along z, friction across
 * it. */
static void expect_plate(const struct contact_tangent *t, const double half[2], double stiffness,
                         double damping, double friction, double tolerance)
{
    double x2 = half[0] * half[0] / 3, y2 = half[1] * half[1] / 3;
    const double along[6] = {0, 0, 1, y2, x2, 0}, across[6] = {1, 1, 0, 0, 0, x2 + y2};
    const double lever[6] = {1, 1, 1, y2, x2, x2 + y2};

    for (int row = 0; row < 6; row++) {
        for (int column = row; column < 6; column++) {
            double K = row == column ? stiffness * along[row] : 0;
            double D = row == column ? damping * along[row] + friction * across[row] : 0;
            double size = sqrt(lever[row] * lever[column]);

            assert_near(entry(t->K, row, column), K, tolerance * stiffness * size);
            assert_near(entry(t->D, row, column), D, tolerance * (damping + friction) * size);
        }
    }
}

/* So that no two faces of the bottom are one. */
static void roughen(double p[3], const double *height)
{
    if (p[2] < -0.999 * *height) {
        p[2] += 1e-6 * sin(470 * p[0] + 0.3) * cos(390 * p[1]);
    }
}

/* A plate that is pressed by depth into the ground, or leaves it, at a speed: its springs make
 * k A (1 + c rate) upward, and the tangents follow from the integrals of 1, x^2 and y^2 over the
 * plate, into however many batches its springs go. */
TEST(a_plate_has_the_tangents_of_its_area_at_any_speed)
{
    static const int cells[] = {1, 7, 30}; /* the last one's are no plane: 1800 springs */
    static const double rates[] = {0, 0.1, -0.5, -0.99, -1.01, 5}; /* in 1 / c: 1 + c rate >= 0 */
    const double half[2] = {0.06, 0.09}, depth = 1e-4, area = 4 * half[0] * half[1];
    const double k = scene_stiffness(&scene_foot, &scene_ground);
    const double c = scene_dissipation(&scene_foot, &scene_ground);

    for (size_t n = 0; n < ARRAY_COUNT(cells) * ARRAY_COUNT(rates); n++) {
        double rate = rates[n % ARRAY_COUNT(rates)] / c, pushes = fmax(1 + c * rate, 0);
        struct scene scene;
        struct contact_surface *s = fixture_box_on_ground(&scene);
        struct contact_world *world;
        struct contact_wrench wrench;
        struct contact_tangent t;
        struct body_motion motion;
        double tolerance = 1e-9;

        s->half_extent_m[0] = half[0];
        s->half_extent_m[1] = half[1];
        s->half_extent_m[2] = 0.03;
        s->cells_per_edge = cells[n / ARRAY_COUNT(rates)];
        if (s->cells_per_edge == 30) {
            s->shape = CONTACT_MESH;
            s->mesh = fixture_reshape(s->half_extent_m, 30, roughen, &s->half_extent_m[2]);
            tolerance = 0.01; /* as rough as it is, of its depth */
        }
        for (int i = 0; i < 2; i++) {
            struct contact_material *m = &scene.surface[i].material;

            m->static_friction = m->dynamic_friction = 0;
            m->viscous_friction = 0.7;
        }
        world = fixture_native(&scene);
        scene_place(&motion, 0.3, -0.2, 0.03 - depth);
        motion.v[2] = -rate;
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], k * area * depth * pushes,
                    tolerance * k * area * depth * fmax(pushes, 1));
        if (world->ops->tangents(world, &t, 1) == 1) {
            assert_int_equal(t.body_b, 0);
            expect_plate(&t, half, k * area * pushes, pushes > 0 ? c * k * area * depth : 0,
                         0.7 * k * area * depth * pushes, tolerance);
        } else {
            assert_true(pushes == 0);
        }
    }
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
