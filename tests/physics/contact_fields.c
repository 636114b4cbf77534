/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two meshes in the native engine by the pressure field of one of them, against closed forms: no
 * work around closed paths, no drift, thick penetration, spheres, friction of a spinning face.
 */

#include "contact/native/private.h"
#include "tests/physics/contact_fixture.h"

/* Two surfaces of these have 5e5 Pa/m, and no friction. */
static const struct contact_material slippery = {1e6, 1, 0, 0, 0, 0, 0};
static const double stiffness = 5e5;

static void onto_sphere(double p[3], const double *radius)
{
    double length = vec3_norm(p);

    for (int i = 0; i < 3; i++) {
        p[i] *= *radius / length;
    }
}

static const struct mesh *ball_mesh(double radius, int cells)
{
    return fixture_reshape((const double[3]){radius, radius, radius}, cells, onto_sphere, &radius);
}

/* One half of a block of 4 x 4 x 4 cells is little more than half as high, with a slope between:
 * not convex. */
static void onto_step(double p[3], const double *half)
{
    if (p[0] > 0.4 * *half) {
        p[2] = 0.55 * (p[2] + *half) - *half;
    }
}

/* ---- closed paths ---- */

enum pair_kind {
    BOX_ON_TABLE,
    BOX_OVER_EDGE,
    FOOT_ON_TERRAIN,
    BALL_ON_BALL,
    BALL_IN_STEP,
    STEP_ON_TERRAIN,
    CAPSULE_OVER_EDGE,
    PAIR_KINDS
};

static const char *const pair_name[PAIR_KINDS] = {
    "box on table",   "box over an edge", "foot on terrain",           "ball on ball",
    "ball in a step", "step on terrain",  "capsule over a foot's edge"};

static struct contact_surface *add_mesh(struct scene *scene, int body, const struct mesh *mesh)
{
    struct contact_surface *s = scene_add(scene, body, CONTACT_MESH, &slippery);

    s->mesh = mesh;
    return s;
}

/* The second surface is on the scene's last body; at: a place where it touches the first. */
static void make_pair(struct scene *scene, enum pair_kind kind, int nbody, double at[3])
{
    static const double half = 0.04;
    const double step[3] = {half, half, half};
    const int second = nbody - 1, first = nbody - 2;
    struct contact_surface *capsule;

    scene_init(scene, (size_t)nbody);
    scene_add_pair(scene, 0, 1);
    at[0] = at[1] = at[2] = 0;
    switch (kind) {
    case BOX_ON_TABLE:
    case BOX_OVER_EDGE:
        scene_add_box(scene, first, 0.2, 0.3, 0.02, 1, &slippery);
        scene_add_box(scene, second, 0.075, 0.075, 0.075, 7, &slippery);
        at[0] = kind == BOX_OVER_EDGE ? 0.2 : 0;
        at[2] = 0.094;
        break;
    case FOOT_ON_TERRAIN:
        add_mesh(scene, first, fixture_terrain(24));
        add_mesh(scene, second, fixture_foot);
        at[2] = 0.05 + 0.0932;
        break;
    case BALL_ON_BALL:
        add_mesh(scene, first, ball_mesh(0.05, 8));
        add_mesh(scene, second, ball_mesh(0.05, 8));
        at[2] = 0.09;
        break;
    case BALL_IN_STEP:
        add_mesh(scene, first, fixture_reshape(step, 4, onto_step, &half));
        add_mesh(scene, second, ball_mesh(0.02, 6));
        at[0] = 0.031;
        at[2] = 0.022;
        break;
    case CAPSULE_OVER_EDGE:
        add_mesh(scene, first, fixture_foot);
        capsule = scene_add(scene, second, CONTACT_CAPSULE, &slippery);
        capsule->radius_m = 0.03;
        capsule->length_m = 0.1;
        at[0] = 0.12;
        at[2] = -0.0932 - 0.076;
        break;
    default:
        add_mesh(scene, first, fixture_terrain(24));
        add_mesh(scene, second, fixture_reshape(step, 4, onto_step, &half));
        at[2] = 0.088;
    }
}

/* A closed path: where it is at the phase from 0 to 2 pi. It slides to and fro, sinks and rises,
 * and tilts meanwhile, all out of step with each other. */
static void path_at(const double at[3], double phase, struct body_motion *motion)
{
    const double turn[3] = {0.05 * cos(phase), 0.05 * sin(2 * phase + 1), 0.15 * cos(phase + 2)};
    double angle = vec3_norm(turn), axis[3];

    for (int i = 0; i < 3; i++) {
        axis[i] = turn[i] / angle;
    }
    scene_place(motion, at[0] + 0.01 * sin(phase), at[1] + 0.01 * sin(2 * phase + 1),
                at[2] + 0.003 * sin(3 * phase + 2));
    mat3_about_axis(axis, angle, motion->R);
}

/* The work of the contact around the path in so many steps; all: the sum of what came and went. */
static double path_work(struct contact_world *world, const double at[3], int steps, double *all)
{
    double sum = 0;

    *all = 0;
    for (int i = 0; i < steps; i++) {
        struct body_motion from, middle, to;
        struct contact_wrench wrench;
        double back[9], turned[9], way[3], work;

        path_at(at, 2 * fixture_pi * i / steps, &from);
        path_at(at, 2 * fixture_pi * (i + 0.5) / steps, &middle);
        path_at(at, 2 * fixture_pi * (i + 1) / steps, &to);
        fixture_evaluate(world, &middle, &wrench);

        /* Force along the way, moment along the small turn */
        vec3_sub(to.p, from.p, way);
        mat3_transpose(from.R, back);
        mat3_mul(to.R, back, turned);
        work = vec3_dot(wrench.force, way) + wrench.moment[0] * (turned[7] - turned[5]) / 2 +
               wrench.moment[1] * (turned[2] - turned[6]) / 2 +
               wrench.moment[2] * (turned[3] - turned[1]) / 2;
        sum += work;
        *all += fabs(work);
    }
    return sum;
}

TEST(no_closed_path_gains_or_loses_energy)
{
    for (int kind = 0; kind < PAIR_KINDS; kind++) {
        double gain[2], all, at[3];
        struct scene scene;

        make_pair(&scene, kind, 1, at);
        for (int law = 0; law < 2; law++) {
            scene.config.mesh_law = law == 0 ? CONTACT_PRESSURE_FIELD : CONTACT_ELASTIC_FOUNDATION;
            gain[law] = path_work(fixture_native(&scene), at, law == 0 ? 1000 : 200, &all);
        }
        print_message("%s: %+.1e J of %.2f J around, the mean of both sums %+.1e J\n",
                      pair_name[kind], gain[0], all, gain[1]);
        assert_true(all > 0.01);
        assert_near(gain[0], 0, 1e-4 * all);
        assert_near(gain[0], 0, 1e-5);
    }
}

/* Steps of half the length leave a quarter of the sum's error: nothing else is left of it. */
TEST(what_is_left_of_a_closed_path_is_the_error_of_the_sum)
{
    struct scene scene;
    double at[3], all, left[3];

    make_pair(&scene, BOX_OVER_EDGE, 1, at);
    for (int i = 0; i < 3; i++) {
        left[i] = path_work(fixture_native(&scene), at, 250 << (2 * i), &all);
    }
    print_message("%.1e, %.1e and %.1e J of %.2f J\n", left[0], left[1], left[2], all);
    assert_true(fabs(left[1]) < 0.15 * fabs(left[0]) && fabs(left[2]) < 0.15 * fabs(left[1]));
}

/* ---- pushes ---- */

TEST(what_lies_on_a_level_table_is_not_pushed_along_it)
{
    uint64_t seed = 5;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;
    double at[3];

    make_pair(&scene, BOX_ON_TABLE, 1, at);

    struct contact_world *world = fixture_native(&scene);

    for (int i = 0; i < 200; i++) {
        scene_place(&motion, 0.02 * random_number(&seed), 0.02 * random_number(&seed), at[2]);
        scene_random_rotation(&seed, 0.1, motion.R);
        fixture_evaluate(world, &motion, &wrench);
        assert_true(wrench.force[2] > 0);
        assert_near(hypot(wrench.force[0], wrench.force[1]), 0, 1e-12 * wrench.force[2]);
    }
}

/* A cube of side s through a plate of thickness t. Over a cross-section h above its lower face the
 * cube's own depth less c, where that is positive, has the integral g(h) for h up to s/2; what the
 * plate's field of depth t/2 = c adds is the force of the lower face alone. */
static double cube_section(double s, double c, double h)
{
    return h <= c ? 0 : (pow(s - 2 * c, 3) - pow(s - 2 * h, 3)) / 6;
}

TEST(a_thick_body_is_held_by_a_plate_until_its_middle_is_through)
{
    const double s = 0.15, t = 0.02, c = t / 2;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    scene_init(&scene, 1);
    scene_add_box(&scene, -1, 0.4, 0.4, t / 2, 1, &slippery)->position[2] = -t / 2;
    scene_add_box(&scene, 0, s / 2, s / 2, s / 2, 7, &slippery);
    scene_add_pair(&scene, 0, 1);

    struct contact_world *world = fixture_native(&scene);

    for (int i = 1; i <= 75; i++) {
        double x = i * 1e-3, over = x > t ? x - t : 0;
        double first = x < c ? x : x < t ? t - x : 0;
        double expected =
            stiffness * (s * s * first + cube_section(s, c, x) - cube_section(s, c, over));

        scene_place(&motion, 0.01, 0.02, s / 2 - x);
        fixture_evaluate(world, &motion, &wrench);
        assert_near(wrench.force[2], expected, 1e-9 * stiffness * s * s * c);
        assert_near(hypot(wrench.force[0], wrench.force[1]), 0, 1e-9);
        assert_true(wrench.force[2] > 0.04 * stiffness * s * s * c);
    }
}

/* ---- spheres ---- */

/* The force between two spheres a distance d apart: k times the integral over the second's surface
 * of its depth in the first and of the normal's part along the line of centers. */
static double spheres_force(double radius, double d)
{
    const int n = 20000;
    double sum = 0;

    for (int i = 0; i < n; i++) {
        double c = -1 + 2 * (i + 0.5) / n, r = sqrt(d * d + radius * radius + 2 * d * radius * c);

        sum -= r < radius ? (radius - r) * c : 0;
    }
    return stiffness * 2 * fixture_pi * radius * radius * sum * 2 / n;
}

/* Makes an engine with two balls of this mesh. Their centers are `apart` m from each other. */
static struct contact_world *two_balls(struct scene *scene, const struct mesh *ball, double apart,
                                       struct body_motion motion[2])
{
    scene_init(scene, 2);
    add_mesh(scene, 0, ball);
    add_mesh(scene, 1, ball);
    scene_add_pair(scene, 0, 1);
    scene_place(&motion[0], 0, 0, 0);
    scene_place(&motion[1], 0.6 * apart, 0, 0.8 * apart);
    return fixture_native(scene);
}

TEST(balls_converge_to_the_integral_over_spheres)
{
    /* 92 % of the volume in common, a third, and just touching */
    const double radius = 0.1, apart[3] = {0.0107, 0.1, 0.19};

    for (int i = 0; i < 3; i++) {
        double off[3];

        for (int fine = 0; fine < 3; fine++) {
            const struct mesh *ball = ball_mesh(radius, 5 << fine);
            struct scene scene;
            struct body_motion motion[2];
            struct contact_wrench wrench[2];

            fixture_evaluate(two_balls(&scene, ball, apart[i], motion), motion, wrench);
            off[fine] = vec3_norm(wrench[1].force) / spheres_force(radius, apart[i]) - 1;
            print_message("%g m apart, %zu triangles: %+.2e off\n", apart[i], ball->nface,
                          off[fine]);
        }

        /* Of second order in the size of the triangles */
        assert_true(fabs(off[1]) < fabs(off[0]) / 2.2 && fabs(off[2]) < fabs(off[1]) / 3);
        assert_near((4 * off[2] - off[1]) / 3, 0, i < 2 ? 1e-3 : 4e-2);
    }
}

/* However much of two balls is in common, each facet meets some cells only: what is looked at grows
 * as the facets do, not as their square. */
TEST(work_grows_as_the_facets_do)
{
    const double radius = 0.1, apart[2] = {0.0107, 0.05};

    for (int i = 0; i < 2; i++) {
        double each[3];

        for (int fine = 0; fine < 3; fine++) {
            const struct mesh *ball = ball_mesh(radius, 5 << fine);
            const struct native_engine *engine;
            struct contact_world *world;
            struct scene scene;
            struct body_motion motion[2];
            struct contact_wrench wrench[2];

            world = two_balls(&scene, ball, apart[i], motion);
            fixture_evaluate(world, motion, wrench);
            engine = (const struct native_engine *)world;
            each[fine] = (double)engine->scratch->visits / (double)ball->nface;
            print_message("%zu triangles each, %g m apart: %.1f cells for each\n", ball->nface,
                          apart[i], each[fine]);
        }
        assert_true(each[2] < 30 && each[2] < 1.6 * each[0]);
    }
}

/* ---- friction ---- */

TEST(a_spinning_square_is_braked_by_the_integral_of_its_lever)
{
    /* At a pure spin all of it slides: mu times the force times the mean distance of a square's
     * points from its middle */
    const struct contact_material rough = {1e6, 1, 0, 0.5, 0.5, 0, 0};
    const double lever = 0.15 * (sqrt(2) + log(1 + sqrt(2))) / 6;
    struct scene scene;
    struct body_motion motion;
    struct contact_wrench wrench;

    scene_init(&scene, 1);
    scene.config.transition_velocity_m_s = 1e-6;
    scene_add_box(&scene, -1, 0.2, 0.3, 0.02, 1, &rough);
    scene_add_box(&scene, 0, 0.075, 0.075, 0.075, 7, &rough);
    scene_add_pair(&scene, 0, 1);
    scene_place(&motion, 0, 0, 0.094);
    motion.w[2] = 1;
    fixture_evaluate(fixture_native(&scene), &motion, &wrench);
    print_message("%.2e off\n", -wrench.moment[2] / (0.5 * wrench.force[2] * lever) - 1);
    assert_near(-wrench.moment[2], 0.5 * wrench.force[2] * lever,
                1e-3 * 0.5 * wrench.force[2] * lever);
}

/* ---- any pose ---- */

TEST(any_pose_is_finite_balanced_and_continuous)
{
    uint64_t seed = 11;

    for (int kind = 0; kind < PAIR_KINDS; kind++) {
        const double step = 1e-7;
        struct scene scene;
        double at[3], worst = 0;

        make_pair(&scene, kind, 2, at);

        struct contact_world *world = fixture_native(&scene);

        for (int i = 0; i < 300; i++) {
            struct body_motion motion[2];
            struct contact_wrench wrench[2], next[2];
            double arm[3], turn[3], change[3];

            for (int b = 0; b < 2; b++) {
                scene_place(&motion[b], 0.03 * random_number(&seed), 0.03 * random_number(&seed),
                            b * at[2] * (1 + random_number(&seed)) / 1.2);
                scene_random_rotation(&seed, 3, motion[b].R);
            }
            fixture_evaluate(world, motion, wrench);

            /* Action and reaction, force and moment */
            vec3_sub(motion[1].p, motion[0].p, arm);
            vec3_cross(arm, wrench[1].force, turn);
            for (int k = 0; k < 3; k++) {
                double moments = fabs(wrench[0].moment[k]) + fabs(turn[k]) + 1;

                assert_true(isfinite(wrench[0].force[k]) && isfinite(wrench[0].moment[k]));
                assert_near(wrench[0].force[k] + wrench[1].force[k], 0, 1e-12);
                assert_near(wrench[0].moment[k] + wrench[1].moment[k] + turn[k], 0,
                            1e-12 * moments);
            }

            /* A small step changes the force by no more than the stiffness of all of the smaller
             * surface */
            motion[1].p[i % 3] += step;
            fixture_evaluate(world, motion, next);
            vec3_sub(next[1].force, wrench[1].force, change);
            worst = fmax(worst, vec3_norm(change) / step / stiffness);
        }
        print_message("%s: at most k times %.3g m2\n", pair_name[kind], worst);
        assert_true(worst < 0.2);
    }
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
