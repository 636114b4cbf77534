/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What sticks stays: a block whose load swings inside the cone of friction does not walk, and a
 * block at rest on a slope has no motion that grows.
 */
#include "tests/physics/contact_bodies.h"
#include "tests/physics/near.h"

#define G 9.81
#define PI 3.14159265358979323846

/* How long something has to stay, s; sanitizers, which look for other errors, see a sixth of it. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { HOLD_S = 10 };
#else
enum { HOLD_S = 60 };
#endif

/* ---- loads that swing ---- */

struct swing {
    const char *name;
    double friction[2], tangential, normal, hz; /* parts of the weight */
};

/* Low enough that no edge of it lifts, m. */
#define HALF_HEIGHT 0.025

/* Steps of a sixteenth of a millisecond, and whole numbers of them a cycle. */
#define H 6.25e-5

static void swing_for(struct bodies *b, const struct swing *swing, double seconds)
{
    const int steps = (int)(seconds / H + 0.5);

    for (int n = 0; n < steps; n++) {
        double turn = 2 * PI * swing->hz * (n + 0.5) * H;

        b->gravity[0] = G * swing->tangential * sin(turn);
        b->gravity[2] = -G * (1 + swing->normal * cos(turn));
        step(b, H);
    }
}

/* How far a cube moves in HOLD_S. */
static double drift(const struct swing *swing, bool table)
{
    const struct contact_material material = {1e7, 1, 1, swing->friction[0], swing->friction[1],
                                              0,   0};
    struct scene scene;
    struct bodies b;
    double before[3], moved[3];

    scene_init(&scene, 1);
    if (table) {
        scene_add_box(&scene, -1, 0.5, 0.5, 0.1, 1, &material)->position[2] = -0.1;
    } else {
        scene_add(&scene, -1, CONTACT_HALF_SPACE, &material);
    }
    scene_add_box(&scene, 0, 0.1, 0.075, HALF_HEIGHT, 5, &material);
    scene_add_pair(&scene, 0, 1);
    scene.config.friction = CONTACT_FRICTION_STICKING;
    b = make(&scene, 1.5);
    b.motion[0].p[2] = HALF_HEIGHT - 1.5 * G / (5e6 * 0.2 * 0.15);
    swing_for(&b, swing, 2);
    memcpy(before, b.motion[0].p, sizeof before);
    swing_for(&b, swing, HOLD_S);
    vec3_sub(b.motion[0].p, before, moved);
    return vec3_norm(moved);
}

TEST(a_block_does_not_walk_when_its_load_swings)
{
    static const struct swing swings[] = {
        {"0.2 and 0.5 at 5 Hz", {1.1, 0.9}, 0.2, 0.5, 5},
        {"0.2 and 0.5 at 5 Hz, mu 10", {10, 10}, 0.2, 0.5, 5},
        {"0.4 and 0.8 at 10 Hz", {1.1, 0.9}, 0.4, 0.8, 10},
    };
    double worst = 0;

    for (size_t i = 0; i < sizeof swings / sizeof swings[0]; i++) {
        for (int table = 0; table < 2; table++) {
            double moved = drift(&swings[i], table);

            print_message("# %s, %s: %.1e m in %d s\n", table ? "table" : "ground", swings[i].name,
                          moved, HOLD_S);
            worst = fmax(worst, moved);
        }
    }
    assert_true(worst < 1e-6);
}

/* ---- slopes ---- */

enum { SIZE = 12 + CONTACT_BRISTLE };

/* The rates of a block whose state differs by x from where it is: place, turn, velocities,
 * bristles. */
static void rates_near(const struct bodies *b, const double x[SIZE], double rate[SIZE])
{
    struct bodies at = *b;
    struct body_motion motion_rate[BODIES];
    double y_rate[BRISTLES], turned[9];

    for (int row = 0; row < 3; row++) {
        const double *w = x + 3;

        /* The first order of a turn is all that is asked */
        for (int i = 0; i < 3; i++) {
            const double *R = at.motion[0].R;
            double spin[3][3] = {{0, -w[2], w[1]}, {w[2], 0, -w[0]}, {-w[1], w[0], 0}};

            turned[3 * row + i] = R[3 * row + i] + spin[row][0] * R[i] + spin[row][1] * R[3 + i] +
                                  spin[row][2] * R[6 + i];
        }
    }
    memcpy(at.motion[0].R, turned, sizeof turned);
    for (int i = 0; i < 3; i++) {
        at.motion[0].p[i] += x[i];
        at.motion[0].v[i] += x[6 + i];
        at.motion[0].w[i] += x[9 + i];
    }
    for (int i = 0; i < CONTACT_BRISTLE; i++) {
        at.bristle[i] += x[12 + i];
    }
    derive(&at, at.motion, at.bristle, motion_rate, y_rate);
    for (int i = 0; i < 3; i++) {
        rate[i] = at.motion[0].v[i];
        rate[3 + i] = at.motion[0].w[i];
        rate[6 + i] = motion_rate[0].v[i];
        rate[9 + i] = motion_rate[0].w[i];
    }
    memcpy(rate + 12, y_rate, CONTACT_BRISTLE * sizeof *rate);
}

static void multiply(double a[SIZE][SIZE], double b[SIZE][SIZE], double out[SIZE][SIZE])
{
    double product[SIZE][SIZE] = {{0}};

    for (int i = 0; i < SIZE; i++) {
        for (int k = 0; k < SIZE; k++) {
            for (int j = 0; j < SIZE; j++) {
                product[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    memcpy(out, product, sizeof product);
}

static double largest(double a[SIZE][SIZE])
{
    double most = 0;

    for (int i = 0; i < SIZE; i++) {
        for (int j = 0; j < SIZE; j++) {
            most = fmax(most, fabs(a[i][j]));
        }
    }
    return most;
}

/* The mean growth of the fastest linear motion about rest over 5 minutes, 1/s, by the exponential
 * of the linearized rates: 2^25 steps of 1e-5 s. Places and bristles that stay keep the norm. */
static double growth(const struct bodies *b)
{
    const double h = 1e-5, change[3] = {1e-9, 1e-7, 1e-7};
    static double A[SIZE][SIZE], E[SIZE][SIZE], term[SIZE][SIZE];
    double begin = 0;

    for (int j = 0; j < SIZE; j++) {
        double x[SIZE] = {0}, more[SIZE], less[SIZE], d = change[j < 6 ? 0 : j < 12 ? 1 : 2];

        x[j] = d;
        rates_near(b, x, more);
        x[j] = -d;
        rates_near(b, x, less);
        for (int i = 0; i < SIZE; i++) {
            A[i][j] = (more[i] - less[i]) / (2 * d) * h;
        }
    }
    memset(term, 0, sizeof term);
    memset(E, 0, sizeof E);
    for (int i = 0; i < SIZE; i++) {
        term[i][i] = E[i][i] = 1;
    }
    for (int order = 1; order < 8; order++) {
        multiply(term, A, term);
        for (int i = 0; i < SIZE; i++) {
            for (int j = 0; j < SIZE; j++) {
                term[i][j] /= order;
                E[i][j] += term[i][j];
            }
        }
    }
    for (int doubling = 0; doubling < 25; doubling++) {
        multiply(E, E, E);
        if (doubling == 20) {
            begin = largest(E); /* of 21 s */
        }
    }
    return log(largest(E) / begin) / (335.54 - 20.97);
}

/* A box on the ground, of layers that damp so much. */
static struct bodies make_box(double young, double dissipation, double height)
{
    const struct contact_material material = {young, 1, dissipation, 1.1, 0.9, 0, 0};
    struct scene scene;
    struct bodies b;

    scene_init(&scene, 1);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &material);
    scene_add_box(&scene, 0, 0.075, 0.075, height / 2, 7, &material);
    scene_add_pair(&scene, 0, 1);
    scene.config.friction = CONTACT_FRICTION_STICKING;
    b = make(&scene, 1.5);
    b.motion[0].p[2] = height / 2 - 1.5 * G / (young / 2 * 0.15 * 0.15);
    return b;
}

/* At rest on a slope, by gravity that leans slowly and layers that let nothing ring: where it
 * stands does not depend on them. */
static struct bodies box_on_slope(double young, double height, double angle)
{
    struct bodies b = make_box(young, 100, height);

    for (int n = 0; n < 40000; n++) {
        double lean = angle * fmin(1, n / 10000.0);

        b.gravity[0] = G * sin(lean);
        b.gravity[2] = -G * cos(lean);
        step(&b, 1e-4);
    }
    return b;
}

/* How far the box moves in some seconds from there, on layers that damp as much as they are asked
 * to. */
static double stay(const struct bodies *rest, double young, double dissipation, double height,
                   double seconds, struct bodies *b)
{
    double moved[3];

    *b = make_box(young, dissipation, height);
    b->motion[0] = rest->motion[0];
    memcpy(b->gravity, rest->gravity, sizeof b->gravity);
    memcpy(b->bristle, rest->bristle, sizeof b->bristle);
    run(b, seconds, 1e-4);
    vec3_sub(b->motion[0].p, rest->motion[0].p, moved);
    return vec3_norm(moved);
}

TEST(a_block_at_rest_on_a_slope_has_no_motion_that_grows)
{
    static const double young[] = {1e7, 1e8}, dissipation[] = {0.3, 3, 30};
    double fastest = -1, furthest = 0;

    for (int y = 0; y < 2; y++) {
        for (int degrees = 15; degrees <= 40; degrees += 5) {
            for (int high = 0; high < 2; high++) {
                const double height = high ? 0.3 : 0.15;
                struct bodies rest;

                if ((high && degrees > 20) || (y == 0 && degrees > 35)) {
                    continue; /* it falls over */
                }
                rest = box_on_slope(young[y], height, degrees * PI / 180);
                for (int c = 0; c < 3; c++) {
                    struct bodies b;
                    double moved = stay(&rest, young[y], dissipation[c], height, 4, &b);
                    double rate = growth(&b);

                    print_message("# %g Pa/m, %g s/m, %s at %d degrees: moved %.1e m in 4 s, "
                                  "grows by %.2e/s\n",
                                  young[y] / 2, dissipation[c], high ? "high box" : "cube", degrees,
                                  moved, rate);
                    fastest = fmax(fastest, rate);
                    furthest = fmax(furthest, moved);
                }
            }
        }
    }
    assert_true(fastest < 0.01);
    assert_true(furthest < 1e-6);
}

/* A cube of mu 1.1 at rest for a minute on slopes to 40 degrees, layers that damp little. */
TEST(a_block_rests_on_a_slope_for_a_minute)
{
    static const int degrees[] = {30, 40};
    double furthest = 0;

    for (size_t i = 0; i < sizeof degrees / sizeof degrees[0]; i++) {
        struct bodies rest = box_on_slope(1e8, 0.15, degrees[i] * PI / 180), b;
        double moved = stay(&rest, 1e8, 0.3, 0.15, HOLD_S, &b);

        print_message("# at %d degrees: moved %.1e m in %d s, at %.1e m/s then\n", degrees[i],
                      moved, HOLD_S, vec3_norm(b.motion[0].v));
        furthest = fmax(furthest, moved);
    }
    assert_true(furthest < 1e-6);
}

TEST_GROUP(set_up, tear_down)
