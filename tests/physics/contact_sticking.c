/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction of the native engine, against what it promises: at rest it holds and nothing
 * creeps, sliding it is Coulomb's law, it takes energy and never gives more than it stored, and
 * what it does to one body it does to the other.
 */
#include "tests/physics/contact_bodies.h"
#include "tests/physics/near.h"

#define G 9.81
#define H 1e-4 /* of prescribed motions, s */

/* 5e5 Pa/m together; static and dynamic friction apart, and some viscous. */
static const struct contact_material rough = {1e6, 1, 0.3, 0.7, 0.5, 0.05, 0};

/* 5e6 Pa/m without a bounce: on softer ground friction tilts a block, and springs lean with it. */
static const struct contact_material dull = {1e7, 1, 300, 0.5, 0.4, 0, 0};

enum kind { ON_GROUND, ON_TABLE, BALL_ON_TABLE, BALL_ON_GROUND, BALLS, KINDS };

static const char *const kind_name[KINDS] = {"box on ground", "box on table", "ball on table",
                                             "ball on ground", "ball on ball"};

/* A block with so many bumps of 10 um that its patch has hundreds of springs. */
static const struct mesh *rough_block(void)
{
    static const double half[3] = {0.06, 0.04, 0.03};
    static struct mesh block;
    const struct mesh *box;
    double(*vertex)[3];

    if (block.nvertex > 0) {
        return &block;
    }
    assert_ok(mesh_box(half, 8, &arena, &box, NULL));
    vertex = arena_alloc(&arena, box->nvertex, sizeof *vertex);
    assert_non_null(vertex);
    for (size_t v = 0; v < box->nvertex; v++) {
        memcpy(vertex[v], box->vertex[v], sizeof *vertex);
        if (vertex[v][2] < -0.999 * half[2]) {
            vertex[v][2] += 1e-5 * sin(470 * vertex[v][0] + 0.3) * cos(390 * vertex[v][1]);
        }
    }
    block = *box;
    block.vertex = (const double(*)[3])vertex;
    return &block;
}

/* Body 0 comes down on body 1, or on the ground where there is no other; 0.1 mm deep at 0. */
static void make_scene(enum kind kind, const struct contact_material *material,
                       enum contact_friction friction, struct scene *scene)
{
    scene_init(scene, 2);
    switch (kind) {
    case ON_GROUND:
    case BALL_ON_GROUND:
        scene_add(scene, -1, CONTACT_HALF_SPACE, material);
        break;
    case ON_TABLE:
    case BALL_ON_TABLE:
        scene_add_box(scene, 1, 0.3, 0.3, 0.1, 1, material)->position[2] = -0.1;
        break;
    default:
        scene_add(scene, 1, CONTACT_SPHERE, material)->radius_m = 0.2;
        scene->surface[0].position[2] = -0.2;
    }
    if (kind == ON_GROUND) {
        scene_add(scene, 0, CONTACT_MESH, material)->mesh = rough_block();
        scene->surface[1].position[2] = 0.0299;
    } else if (kind == ON_TABLE) {
        scene_add_box(scene, 0, 0.06, 0.04, 0.03, 3, material)->position[2] = 0.0299;
    } else {
        scene_add(scene, 0, CONTACT_SPHERE, material)->radius_m = 0.05;
        scene->surface[1].position[2] = 0.0499;
    }
    scene_add_pair(scene, 0, 1);
    scene->config.friction = friction;
}

static struct contact_world *make_world(const struct scene *scene)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    assert_no_error(contact_native_create(&scene->config, &arena, &world, &error), error.text);
    return world;
}

/* y: NULL without bristles. */
static void evaluate(struct contact_world *world, const struct body_motion *motion, const double *y,
                     double ahead_s, double *rate, struct contact_wrench *wrench)
{
    int pair[1] = {0};
    struct contact_bristles bristles = {y, ahead_s, rate, pair, 1};

    if (world->ops->evaluate(world, motion, y ? &bristles : NULL, wrench) != ERROR_NONE) {
        fail_msg("%s", world->ops->failure(world));
    }
}

/* Bristles over h seconds of a motion that stays. */
static void follow(struct contact_world *world, const struct body_motion *motion, double h,
                   double y[CONTACT_BRISTLE])
{
    double k[4][CONTACT_BRISTLE], at[CONTACT_BRISTLE];
    const double part[4] = {0, h / 2, h / 2, h}, weight[4] = {h / 6, h / 3, h / 3, h / 6};
    struct contact_wrench wrench[BODIES];

    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < CONTACT_BRISTLE; i++) {
            at[i] = y[i] + (s ? part[s] * k[s - 1][i] : 0);
        }
        evaluate(world, motion, at, 0, k[s], wrench);
    }
    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < CONTACT_BRISTLE; i++) {
            y[i] += weight[s] * k[s][i];
        }
    }
}

static double square(const double y[CONTACT_BRISTLE])
{
    return y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3];
}

/* ---- at rest ---- */

TEST(bristles_at_rest_hold_and_do_not_yield)
{
    for (int kind = 0; kind < KINDS; kind++) {
        struct contact_wrench wrench[BODIES];
        struct body_motion motion[BODIES];
        double y[CONTACT_BRISTLE] = {0}, rate[CONTACT_BRISTLE], moved = 0, held;
        struct contact_world *world;
        struct scene scene;

        make_scene(kind, &rough, CONTACT_FRICTION_STICKING, &scene);
        world = make_world(&scene);
        assert_int_equal(world->nbristle, CONTACT_BRISTLE);
        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], 0, 0, 0);

        /* Moved to where the force is two thirds of what friction can hold, and stopped there */
        motion[0].v[0] = 2e-6;
        do {
            follow(world, motion, 10 * H, y);
            moved += 2e-6 * 10 * H;
            evaluate(world, motion, y, 0, NULL, wrench);
        } while (-wrench[0].force[0] < 2.0 / 3 * 0.7 * wrench[0].force[2] && moved < 0.01);
        motion[0].v[0] = 0;
        evaluate(world, motion, y, 0, rate, wrench);
        held = -wrench[0].force[0];
        assert_near(held, 0.47 * wrench[0].force[2], 0.03 * wrench[0].force[2]);
        assert_near(wrench[0].force[1], 0, 1e-9 * held);

        /* Linear until then, and for ever so: what is stored is the work; no rate at all */
        assert_near(held * moved / 2, square(y) / 2, 0.02 * square(y));
        for (int i = 0; i < CONTACT_BRISTLE; i++) {
            assert_true(rate[i] == 0);
        }

        /* Back where it came from it bears nothing */
        motion[0].v[0] = -2e-6;
        follow(world, motion, moved / 2e-6, y);
        assert_near(sqrt(square(y)), 0, 1e-6 * sqrt(held * moved));
    }
}

/* ---- energy and momentum ---- */

/* A smooth closed path of body 0 over body 1: lifts off, comes down, slides, rolls, spins; t from
 * 0 to 1, height and tilts in their own rhythm: normal force and patch change all the time. */
static void wander(uint64_t *seed, double amplitude[6][3], double phase[6][3])
{
    for (int axis = 0; axis < 6; axis++) {
        for (int k = 0; k < 3; k++) {
            amplitude[axis][k] = random_number(seed) / (1 + k);
            phase[axis][k] = 4 * random_number(seed);
        }
    }
}

static void place_on_path(double t, double period, double amplitude[6][3], double phase[6][3],
                          struct body_motion *motion)
{
    const double size[6] = {2e-3, 2e-3, 4e-4, 2e-3, 2e-3, 0.03};
    double x[6] = {0}, v[6] = {0}, c, s;

    for (int axis = 0; axis < 6; axis++) {
        for (int k = 0; k < 3; k++) {
            double w = 2 * 3.14159265358979323846 * (k + 1);

            x[axis] += size[axis] * amplitude[axis][k] * sin(w * t + phase[axis][k]);
            v[axis] += size[axis] * amplitude[axis][k] * w * cos(w * t + phase[axis][k]) / period;
        }
    }

    /* Rotation about z after one about x; that about y is left out, so that w is their sum */
    scene_place(motion, x[0], x[1], x[2] - 2e-4);
    c = cos(x[5]);
    s = sin(x[5]);
    memcpy(motion->R,
           (double[9]){c, -s * cos(x[3]), s * sin(x[3]), s, c * cos(x[3]), -c * sin(x[3]), 0,
                       sin(x[3]), cos(x[3])},
           sizeof motion->R);
    memcpy(motion->v, v, sizeof motion->v);
    motion->w[0] = c * v[3];
    motion->w[1] = s * v[3];
    motion->w[2] = v[5];
}

/* The power of what friction adds to a scene without it, on body 0. */
static double friction_power(enum kind kind, struct contact_world *world,
                             struct contact_world *frictionless, const struct body_motion *motion,
                             const double *y, double *rate)
{
    struct contact_wrench with[BODIES], without[BODIES];
    double power = 0;

    evaluate(world, motion, y, 0, rate, with);
    evaluate(frictionless, motion, NULL, 0, NULL, without);
    for (int i = 0; i < 3; i++) {
        power += (with[0].force[i] - without[0].force[i]) * motion[0].v[i];
        power += (with[0].moment[i] - without[0].moment[i]) * motion[0].w[i];
        /* What acts on one acts on the other */
        if (kind != ON_GROUND && kind != BALL_ON_GROUND) {
            assert_near(with[0].force[i] + with[1].force[i], 0, 1e-9);
        }
    }
    return power;
}

/* Whatever normal forces, patches and normals do: friction never gives more than it has taken, at
 * any time. */
TEST(friction_makes_no_energy_while_loads_change)
{
    const struct contact_material slick = {1e6, 1, 0.3, 0, 0, 0, 0};
    uint64_t seed = 5;

    for (int kind = 0; kind < KINDS; kind++) {
        struct contact_world *world, *frictionless;
        struct scene scene;
        const int paths = kind == ON_GROUND ? 2 : 6; /* hundreds of springs */
        /* The midpoint rule errs by the square of its steps, by 1e-3 of what a ball stores at
         * 12000 of them */
        const int steps = kind == ON_GROUND || kind == ON_TABLE ? 12000 : 24000;
        double least = 1, most_stored = 0;

        make_scene(kind, &rough, CONTACT_FRICTION_STICKING, &scene);
        world = make_world(&scene);
        make_scene(kind, &slick, CONTACT_FRICTION_REGULARIZED, &scene);
        frictionless = make_world(&scene);
        for (int path = 0; path < paths; path++) {
            const double period = path % 2 ? 0.3 : 3, h = period / steps;
            double amplitude[6][3], phase[6][3], y[CONTACT_BRISTLE] = {0}, taken = 0, lost = 0;
            struct body_motion motion[BODIES];

            scene_place(&motion[1], 0, 0, 0);
            wander(&seed, amplitude, phase);
            for (int n = 0; n < 2 * steps; n++) {
                double k1[CONTACT_BRISTLE], k2[CONTACT_BRISTLE], middle[CONTACT_BRISTLE], power;

                /* Midpoint rule for the work and the bristles alike */
                place_on_path((n + 0.0) * h / period, period, amplitude, phase, motion);
                friction_power(kind, world, frictionless, motion, y, k1);
                for (int i = 0; i < CONTACT_BRISTLE; i++) {
                    middle[i] = y[i] + h / 2 * k1[i];
                }
                place_on_path((n + 0.5) * h / period, period, amplitude, phase, motion);
                power = friction_power(kind, world, frictionless, motion, middle, k2);
                for (int i = 0; i < CONTACT_BRISTLE; i++) {
                    y[i] += h * k2[i];
                }
                taken -= h * power;
                lost = taken - square(y) / 2;
                most_stored = fmax(most_stored, square(y) / 2);
                least = fmin(least, lost);
            }
            assert_true(taken > 0);
        }
        print_message("# %s: friction gave at most %.1e J, stored up to %.1e J\n", kind_name[kind],
                      -least, most_stored);
        assert_true(most_stored > 0);
        assert_true(least > -1e-3 * most_stored);
    }
}

/* At any bristles and any motion friction stays below mu f_n. */
TEST(friction_stays_within_its_limit)
{
    const struct contact_material slick = {1e6, 1, 0.3, 0, 0, 0, 0};
    uint64_t seed = 11;

    for (int kind = 0; kind < KINDS; kind++) {
        struct contact_world *world, *frictionless;
        struct scene scene;

        make_scene(kind, &rough, CONTACT_FRICTION_STICKING, &scene);
        world = make_world(&scene);
        make_scene(kind, &slick, CONTACT_FRICTION_REGULARIZED, &scene);
        frictionless = make_world(&scene);
        for (int n = 0; n < 200; n++) {
            struct contact_wrench with[BODIES], without[BODIES];
            struct body_motion motion[BODIES];
            double y[CONTACT_BRISTLE], change[3], fastest = 0;

            scene_place(&motion[0], 0, 0, 0);
            scene_place(&motion[1], 0, 0, 0);
            for (int i = 0; i < CONTACT_BRISTLE; i++) {
                y[i] = 0.1 * random_number(&seed);
            }
            for (int i = 0; i < 3; i++) {
                motion[0].v[i] = 0.2 * random_number(&seed);
                motion[0].w[i] = 2 * random_number(&seed);
                fastest += fabs(motion[0].v[i]) + 0.2 * fabs(motion[0].w[i]);
            }
            evaluate(world, motion, y, 0, NULL, with);
            evaluate(frictionless, motion, NULL, 0, NULL, without);
            vec3_sub(with[0].force, without[0].force, change);
            assert_true(vec3_norm(change) <=
                        (0.7 + 0.05 * fastest) * vec3_norm(without[0].force) * (1 + 1e-12));
        }
    }
}

/* ---- ahead ---- */

/* The bristles some time ahead are where their rates lead to, and the tangents' damping is the
 * slope of the force against the velocity; both as an implicit step needs them. */
TEST(bristles_ahead_are_those_that_the_rates_lead_to)
{
    for (int kind = 0; kind < KINDS; kind++) {
        const double y[CONTACT_BRISTLE] = {1e-6, -7e-7, 0, 5e-7};
        double rate[CONTACT_BRISTLE], soon[CONTACT_BRISTLE], change;
        struct contact_wrench wrench[BODIES], faster[BODIES];
        struct body_motion motion[BODIES];
        struct contact_tangent tangent, then;
        const int yy = CONTACT_TANGENT_AT(CONTACT_MOVE_Y, CONTACT_MOVE_Y);
        struct contact_world *world;
        struct scene scene;

        make_scene(kind, &rough, CONTACT_FRICTION_STICKING, &scene);
        world = make_world(&scene);
        scene_place(&motion[0], 0, 0, 0);
        scene_place(&motion[1], 0, 0, 0);
        motion[0].v[0] = 2e-6;
        motion[0].w[2] = 1e-5;
        evaluate(world, motion, y, 0, rate, wrench);
        evaluate(world, motion, y, 1e-9, soon, wrench);
        for (int i = 0; i < BRISTLE_BENT; i++) {
            assert_near(soon[i], rate[i], 1e-5 * sqrt(square(rate)));
        }

        /* While it sticks the force goes with the velocity, by the tangents' damping */
        evaluate(world, motion, y, 1e-3, soon, wrench);
        assert_int_equal(world->ops->tangents(world, &tangent, 1), 1);
        motion[0].v[1] += 1e-7;
        evaluate(world, motion, y, 1e-3, rate, faster);
        change = (wrench[0].force[1] - faster[0].force[1]) / 1e-7;
        assert_near(change, tangent.D[yy], 1e-4 * change);
        assert_near(tangent.friction_D[yy], tangent.D[yy], 1e-12 * change);
        assert_int_equal(world->ops->tangents(world, &then, 1), 1);
        assert_near(fabs(then.friction[CONTACT_MOVE_Y] - tangent.friction[CONTACT_MOVE_Y]) / 1e-7,
                    change, 1e-4 * change);
        assert_near((rate[1] - soon[1]) * 1e-3 / 1e-7, tangent.bristle_per_m_s,
                    1e-4 * tangent.bristle_per_m_s);
    }
}

TEST(bristles_that_are_not_numbers_are_refused)
{
    const double y[CONTACT_BRISTLE] = {0, NAN, 0, 0};
    int pair[1] = {0};
    struct contact_bristles bristles = {.y = y, .pair = pair, .npair = 1};
    struct contact_wrench wrench[BODIES];
    struct body_motion motion[BODIES];
    struct contact_world *world;
    struct scene scene;

    make_scene(ON_GROUND, &rough, CONTACT_FRICTION_STICKING, &scene);
    world = make_world(&scene);
    scene_place(&motion[0], 0, 0, 0);
    scene_place(&motion[1], 0, 0, 0);
    assert_int_equal(world->ops->evaluate(world, motion, &bristles, wrench), ERROR_INPUT);
    assert_non_null(strstr(world->ops->failure(world), "bristles of pair 0"));
}

/* ---- bodies ---- */

/* A cube on a slope, by gravity that leans. */
static struct bodies cube_on_slope(bool table, double angle)
{
    struct scene scene;
    struct bodies b;

    cube_on_ground(&scene, table, &dull);
    scene.config.friction = CONTACT_FRICTION_STICKING;
    b = make(&scene, 1.5);
    b.gravity[0] = G * sin(angle);
    b.gravity[2] = -G * cos(angle);
    b.motion[0].p[2] = 0.075 - 1.5 * G / (5e6 * 0.15 * 0.15);
    return b;
}

TEST(a_block_below_the_static_cone_stays)
{
    for (int table = 0; table < 2; table++) {
        struct bodies b = cube_on_slope(table, 0.7 * atan(0.5));
        double rest;

        run(&b, 2, 2.5e-4);
        rest = b.motion[0].p[0];
        run(&b, 4, 2.5e-4);
        print_message("# came %.1f um to rest, then moved %.1e m at %.1e m/s\n", 1e6 * rest,
                      b.motion[0].p[0] - rest, vec3_norm(b.motion[0].v));
        assert_true(rest < 2e-3); /* leaning on its springs */
        assert_near(b.motion[0].p[0], rest, 1e-9);
    }
}

TEST(a_block_above_it_slides_as_dynamic_friction_lets_it)
{
    for (int table = 0; table < 2; table++) {
        const double angle = atan(1.1 * 0.5), expected = G * (sin(angle) - 0.4 * cos(angle));
        struct bodies b = cube_on_slope(table, angle);
        double before;

        run(&b, 0.5, 2e-4);
        before = b.motion[0].v[0];
        run(&b, 0.1, 2e-4);
        /* It still rocks a little on its springs */
        assert_near((b.motion[0].v[0] - before) / 0.1, expected, 2e-3 * G);
    }
}

/* The moment that brakes a spin is that of Coulomb's friction, and the spin ends. */
TEST(a_spinning_block_stops)
{
    const double lever = 0.15 / 6 * (sqrt(2) + log(1 + sqrt(2)));
    struct bodies b = cube_on_slope(false, 0);
    double braked = 0.4 * 1.5 * G * lever / b.inertia[0], before;

    run(&b, 0.2, 2.5e-4);
    b.motion[0].w[2] = 20;
    run(&b, 0.02, 2.5e-4);
    before = b.motion[0].w[2];
    run(&b, 0.05, 2.5e-4);
    assert_near((before - b.motion[0].w[2]) / 0.05, braked, 0.02 * braked);
    run(&b, 20 / braked + 1, 2.5e-4);
    assert_near(b.motion[0].w[2], 0, 1e-9);
    assert_near(vec3_norm(b.motion[0].v), 0, 1e-9);
}

TEST_GROUP(set_up, tear_down)
