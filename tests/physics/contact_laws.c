/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Laws of sticking friction beside each other, on one plane block on an elastic foundation: why
 * contact.h has the one that it has. Nothing here is the engine's; docs/contact.md has the table.
 * HIL_CURVES names a folder for the curves that it draws: ratchet.csv and crate.csv.
 */
#include "tests/test.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define G 9.81
#define PI 3.14159265358979323846

#define MASS 1.5        /* kg */
#define WIDTH 0.15      /* m, of a cube */
#define STIFFNESS 2e7   /* Pa/m */
#define DISSIPATION 0.3 /* s/m */
#define LENGTH 1e-4     /* l_b of the laws that follow the load, m */
#define DELAY 1e-3      /* t_d, s */
#define RELAX 0.5e-3    /* t_y, s */
#define SHEAR_RATIO 0.8
enum { ELEMENTS = 15, MOTION = 6, STATE = MOTION + ELEMENTS, POINTS = 401 };

enum law {
    LOAD_ENERGY,    /* stiffness N/l_b, the state a root of energy */
    LOAD_KINEMATIC, /* stiffness N/l_b, the state a length */
    ANCHORS,        /* a spring an element, anchored in the material */
    AREA,           /* stiffness of the area, at its centroid */
    LAWS
};

static const char *const law_name[LAWS] = {"N/l_b, root of energy", "N/l_b, length",
                                           "an anchor an element", "area, at its centroid"};

/* x: place of the center (m) and tilt, their rates, the law's state. */
struct block {
    enum law law;
    double gravity[2];
    double x[STATE];
};

/* Places and velocities of the elements, and their normal forces. */
struct elements {
    double at[ELEMENTS], velocity[ELEMENTS], slip[ELEMENTS], force[ELEMENTS];
    double normal, center, area, centroid; /* sums, center of pressure, centroid of what touches */
};

static void find_elements(const double x[STATE], struct elements *e)
{
    const double c = cos(x[2]), s = sin(x[2]), a = WIDTH / 2;
    const double stiffness = STIFFNESS * WIDTH * WIDTH / ELEMENTS;
    double lever = 0, moment = 0;

    memset(e, 0, sizeof *e);
    for (int i = 0; i < ELEMENTS; i++) {
        const double along = WIDTH * ((i + 0.5) / ELEMENTS - 0.5);
        const double depth = -(x[1] + along * s - a * c);
        const double sinking = -(x[4] + x[5] * (along * c + a * s));

        e->at[i] = along * c + a * s;
        e->slip[i] = x[3] - x[5] * (along * s - a * c);
        if (depth > 0) {
            e->force[i] = fmax(0, stiffness * depth * (1 + DISSIPATION * sinking));
            e->normal += e->force[i];
            lever += e->force[i] * e->at[i];
            e->area += 1;
            moment += e->at[i];
        }
    }
    e->center = e->normal > 0 ? lever / e->normal : 0;
    e->centroid = e->area > 0 ? moment / e->area : 0;
}

/* The slip velocity of the block's material at a distance ahead of the center. */
static double slip_at(const struct elements *e, double ahead)
{
    const double part = (ahead - e->at[0]) / (e->at[ELEMENTS - 1] - e->at[0]);

    return e->slip[0] + part * (e->slip[ELEMENTS - 1] - e->slip[0]);
}

/* Friction, and the rates of the law's state; none of the laws reaches its limit here. */
static double find_friction(enum law law, const struct elements *e, const double *y, double *rate)
{
    const double each = SHEAR_RATIO * STIFFNESS * WIDTH * WIDTH / ELEMENTS;
    double sum = 0, root, slip;

    switch (law) {
    case LOAD_ENERGY:
        root = sqrt(e->normal / LENGTH);
        slip = slip_at(e, e->center);
        rate[0] = root * slip;
        return -root * (y[0] + DELAY * rate[0]);
    case LOAD_KINEMATIC:
        rate[0] = slip_at(e, e->center);
        return -e->normal / LENGTH * (y[0] + DELAY * rate[0]);
    case ANCHORS:
        for (int i = 0; i < ELEMENTS; i++) {
            rate[i] = e->force[i] > 0 ? e->slip[i] : -y[i] / RELAX;
            sum -= e->force[i] > 0 ? each * (y[i] + DELAY * e->slip[i]) : 0;
        }
        return sum;
    default:
        root = sqrt(each * ELEMENTS);
        rate[0] = root * slip_at(e, e->centroid);
        return -root * (y[0] + DELAY * rate[0]);
    }
}

static void derive(const struct block *b, const double x[STATE], double rate[STATE])
{
    struct elements e;
    double friction, moment;

    memset(rate, 0, STATE * sizeof *rate);
    find_elements(x, &e);
    friction = find_friction(b->law, &e, x + MOTION, rate + MOTION);
    moment = friction * x[1] + e.normal * e.center; /* at the ground, below the center */
    for (int i = 0; i < 3; i++) {
        rate[i] = x[3 + i];
    }
    rate[3] = b->gravity[0] + friction / MASS;
    rate[4] = b->gravity[1] + e.normal / MASS;
    rate[5] = moment / (MASS * WIDTH * WIDTH / 6);
}

static void step(struct block *b, double h)
{
    double k[4][STATE], at[STATE];
    const double part[4] = {0, h / 2, h / 2, h}, weight[4] = {h / 6, h / 3, h / 3, h / 6};

    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < STATE; i++) {
            at[i] = b->x[i] + (s ? part[s] * k[s - 1][i] : 0);
        }
        derive(b, at, k[s]);
    }
    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < STATE; i++) {
            b->x[i] += weight[s] * k[s][i];
        }
    }
}

static struct block block_at_rest(enum law law)
{
    return (struct block){
        .law = law,
        .gravity = {0, -G},
        .x = {0, WIDTH / 2 - MASS * G / (STIFFNESS * WIDTH * WIDTH)},
    };
}

/* ---- what the laws are compared by ---- */

/* Where the block is, m, at POINTS times from where it was at the first. */
struct curve {
    double every_s, x[POINTS];
};

/* Writes the curves of laws, but those of the second, which is unstable. */
static void write_curves(const char *folder, const char *name, const struct curve curve[LAWS])
{
    char path[4096];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "time_s,follows_the_load_m,anchors_m,area_m\n");
    for (int n = 0; n < POINTS; n++) {
        fprintf(file, "%.6g,%.9g,%.9g,%.9g\n", n * curve[0].every_s, curve[LOAD_ENERGY].x[n],
                curve[ANCHORS].x[n], curve[AREA].x[n]);
    }
    assert_int_equal(fclose(file), 0);
}

/* How far the block moves in a minute whose loads swing by 0.2 and 0.5 of the weight at 5 Hz, m;
 * the curve is its first two seconds. */
static double drift(enum law law, struct curve *curve)
{
    struct block b = block_at_rest(law);
    const double h = 1e-4;
    const int settled = 20000, every = 50;
    double begin = 0;

    curve->every_s = every * h;

    for (int n = 0; n < 620000; n++) {
        double turn = 2 * PI * 5 * (n + 0.5) * h;

        b.gravity[0] = 0.2 * G * sin(turn);
        b.gravity[1] = -G * (1 + 0.5 * cos(turn));
        step(&b, h);
        begin = n == settled - 1 ? b.x[0] : begin;
        if (n >= settled - 1 && (n - settled + 1) % every == 0 &&
            (n - settled + 1) / every < POINTS) {
            curve->x[(n - settled + 1) / every] = b.x[0] - begin;
        }
    }
    return fabs(b.x[0] - begin);
}

static void multiply(double a[STATE][STATE], double b[STATE][STATE], double out[STATE][STATE])
{
    double product[STATE][STATE] = {{0}};

    for (int i = 0; i < STATE; i++) {
        for (int k = 0; k < STATE; k++) {
            for (int j = 0; j < STATE; j++) {
                product[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    memcpy(out, product, sizeof product);
}

static double largest(double a[STATE][STATE])
{
    double most = 0;

    for (int i = 0; i < STATE; i++) {
        for (int j = 0; j < STATE; j++) {
            most = fmax(most, fabs(a[i][j]));
        }
    }
    return most;
}

/* Where the block stands on a slope: it came there with all motion braked. */
static struct block rest_on_slope(enum law law, double angle)
{
    struct block b = block_at_rest(law);

    for (int n = 0; n < 40000; n++) {
        double lean = angle * fmin(1, n / 10000.0);

        b.gravity[0] = G * sin(lean);
        b.gravity[1] = -G * cos(lean);
        step(&b, 1e-4);
        for (int i = 3; i < MOTION; i++) {
            b.x[i] *= 0.98;
        }
    }
    return b;
}

/* How the block moves on a slope of 30 degrees when it was nudged by 0.01 mm/s. Returns how far it
 * swings in the last quarter, over the first. */
static double swing(enum law law, struct curve *curve)
{
    struct block b = rest_on_slope(law, PI / 6);
    const double h = 1e-4, rest = b.x[0];
    double first = 0, last = 0;

    curve->every_s = 20 * h;
    b.x[3] += 1e-5;
    for (int n = 0; n < POINTS; n++) {
        curve->x[n] = b.x[0] - rest;
        first = n < POINTS / 4 ? fmax(first, fabs(curve->x[n])) : first;
        last = n >= POINTS - POINTS / 4 ? fmax(last, fabs(curve->x[n])) : last;
        for (int i = 0; i < 20; i++) {
            step(&b, h);
        }
    }
    return last / first;
}

/* How fast the fastest motion about rest on a slope grows, 1/s: by powers of a step of the
 * linearized rates, from 1.3 to 10.5 s. */
static double growth(enum law law, double degrees)
{
    struct block b = rest_on_slope(law, degrees * PI / 180);
    static double A[STATE][STATE], E[STATE][STATE], term[STATE][STATE];
    const double h = 1e-5;
    double begin = 0;

    for (int j = 0; j < STATE; j++) {
        double more[STATE], less[STATE], x[STATE], d = j < 3 ? 1e-9 : j < MOTION ? 1e-7 : 1e-9;

        memcpy(x, b.x, sizeof x);
        x[j] += d;
        derive(&b, x, more);
        x[j] -= 2 * d;
        derive(&b, x, less);
        for (int i = 0; i < STATE; i++) {
            A[i][j] = h * (more[i] - less[i]) / (2 * d);
        }
    }
    memset(term, 0, sizeof term);
    memset(E, 0, sizeof E);
    for (int i = 0; i < STATE; i++) {
        term[i][i] = E[i][i] = 1;
    }
    for (int order = 1; order < 8; order++) {
        multiply(term, A, term);
        for (int i = 0; i < STATE; i++) {
            for (int j = 0; j < STATE; j++) {
                term[i][j] /= order;
                E[i][j] += term[i][j];
            }
        }
    }
    for (int doubling = 0; doubling < 20; doubling++) {
        multiply(E, E, E);
        begin = doubling == 16 ? largest(E) : begin;
    }
    return log(largest(E) / begin) / (1e-5 * (1048576 - 131072));
}

/* What friction gives in a cycle that bends under a small load and lets go under a large one, over
 * what it stores at most. */
static double gain(enum law law)
{
    double y[ELEMENTS] = {0}, rate[ELEMENTS] = {0}, work = 0, most = 0;
    const double h = 1e-6;

    for (int n = 0; n < 1000000; n++) {
        const double turn = 2 * PI * n * h, speed = 2 * PI * 2e-6 * cos(turn);
        double x[STATE] = {0};
        struct elements e;

        x[1] = WIDTH / 2 - (2 - sin(2 * turn)) * MASS * G / (STIFFNESS * WIDTH * WIDTH);
        x[3] = speed;
        x[4] = cos(2 * turn) * 4 * PI * MASS * G / (STIFFNESS * WIDTH * WIDTH);
        find_elements(x, &e);
        work += h * speed * find_friction(law, &e, y, rate);
        most = fmax(most, fabs(work));
        for (int i = 0; i < ELEMENTS; i++) {
            y[i] += h * rate[i];
        }
    }
    return work / most;
}

TEST(the_law_of_the_engine_neither_walks_nor_flutters_nor_makes_energy)
{
    static const int numbers[LAWS] = {1, 1, ELEMENTS, 1};
    static struct curve ratchet[LAWS], crate[LAWS];
    const char *folder = getenv("HIL_CURVES");
    double walked[LAWS], grows[LAWS], gained[LAWS], swings[LAWS];

    for (int law = 0; law < LAWS; law++) {
        walked[law] = drift(law, &ratchet[law]);
        swings[law] = swing(law, &crate[law]);
        grows[law] = fmax(growth(law, 20), growth(law, 30));
        gained[law] = gain(law);
        print_message("# %-22s %2d numbers, walks %.1e m, grows %+.2f/s, gives %+.3f of what it "
                      "stored\n",
                      law_name[law], numbers[law], walked[law], grows[law], gained[law]);
    }
    if (folder) {
        write_curves(folder, "ratchet.csv", ratchet);
        write_curves(folder, "crate.csv", crate);
    }
    /* Those that follow the load walk, flutter or make energy; the others do nothing of it. Motion
     * that stays may grow with time, not by a power of it: 0.23/s here. */
    assert_true(walked[LOAD_ENERGY] > 1e-4);
    assert_true(grows[LOAD_ENERGY] > 5 && grows[LOAD_KINEMATIC] > 5);
    assert_true(swings[LOAD_ENERGY] > 10 && swings[LOAD_KINEMATIC] > 10);
    assert_true(gained[LOAD_KINEMATIC] > 0.1);
    for (int law = ANCHORS; law < LAWS; law++) {
        assert_true(walked[law] < 1e-7);
        assert_true(grows[law] < 0.1);
        assert_true(swings[law] < 1);
        assert_true(gained[law] < 1e-3);
    }
}
