/* SPDX-License-Identifier: Apache-2.0 */
/*
 * terrain-mesh: writes ground that is not flat as OBJ text: a bump, a ramp, stairs or waves, smooth
 * or rough, in the middle of a level plate (z = 0) that leads to it and away from it.
 *
 *     terrain-mesh bump --height 0.09 --side-slope 9 --rough 0.02 --seed 1 >FILE
 *
 * Meters; x forward, 0 where the shape begins, y left, 0 in its middle, z up. The same arguments
 * give the same file on every machine, to the micrometer.
 *
 * The surface is the top of a closed solid, as a contact mesh has to be: the plate is thick, so
 * that whatever lies on it is nearer to the top than to the bottom, and contact, which takes the
 * depth under the nearest side, is right for all that touches. The top is a grid of lines along x
 * and y, each of its rectangles two triangles; where it is level the lines are far apart, because a
 * tick costs by the triangles under a foot.
 *
 * Shapes, of height H and length L, s from -1 to 1 along x and t along y:
 *
 *     bump   H (1 - s^2)^2 (1 - t^2)^2; steepest sideways at t = 1/sqrt(3), which with the side
 *            slope asked for gives its width (without: as wide as the plate, and 1 for the factor)
 *     ramp   up at the slope asked for, level, down at the same slope
 *     steps  so many up and down again, all treads of one length; risers lean by 5 mm
 *     waves  so many of H (1 - cos)/2
 *
 * Rough: the points of the grid are lifted by R u^2, u uniform in [0, 1). Few high ones among many
 * low ones, as in ground made of random lifts, make a few steep facets among many flat ones. In the
 * end all heights are scaled for the highest point to be at H.
 */
#include "base/count.h"
#include "base/options.h"
#include "base/random.h"
#include "contact/mesh/mesh.h"
#include "tools/mesh_write.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINES_MAX 100 /* of the grid along an axis: at most 22,000 triangles in all */
#define BREAKS_MAX 84
#define STEPS_MAX 20
#define RISER_RUN 0.005    /* m */
#define STEEPEST 1.5396007 /* of (1 - s^2)^2: 8/(3 sqrt(3)) */
#define RADIANS 0.017453292519943295
#define TURN 6.283185307179586

enum terrain_shape { SHAPE_BUMP, SHAPE_RAMP, SHAPE_STEPS, SHAPE_WAVES };

struct terrain {
    enum terrain_shape shape;
    double height, length, width, lead, depth; /* m */
    double side_slope, slope;                  /* deg */
    double cell, rough;                        /* m */
    int64_t count, seed;

    double span; /* of the shape across, m */
    int nx, ny;  /* lines of the grid */
    double x[LINES_MAX], y[LINES_MAX];
    int nvertex, nface;
    double vertex[LINES_MAX * LINES_MAX + 4 * LINES_MAX + 1][3];
    int face[2 * LINES_MAX * LINES_MAX + 12 * LINES_MAX][3];
};

/* ---- the shapes ---- */

static double bump_factor(double s)
{
    return (1 - s * s) * (1 - s * s);
}

/* From 0 to 1 at each place along the way where a slope or a tread begins or ends: n of them. */
static int terrain_find_breaks(const struct terrain *t, double at[BREAKS_MAX],
                               double height[BREAKS_MAX])
{
    const double tread = t->length / (double)(2 * t->count - 1);
    int n = 0;

    at[n] = height[n] = 0;
    n++;
    if (t->shape == SHAPE_RAMP) {
        at[n] = t->height / tan(t->slope * RADIANS);
        height[n++] = 1;
        at[n] = t->length - at[1];
        height[n++] = 1;
    }
    for (int step = 0; t->shape == SHAPE_STEPS && step < 2 * t->count; step++) {
        int up = step < t->count ? step : (int)(2 * t->count) - step;
        int next = step < t->count ? step + 1 : up - 1;

        /* The first riser begins at 0, the last ends at the length */
        if (step > 0) {
            at[n] = step * tread - (step < t->count ? 0 : RISER_RUN);
            height[n++] = (double)up / (double)t->count;
        }
        at[n] = step * tread + (step < t->count ? RISER_RUN : 0);
        height[n++] = (double)next / (double)t->count;
    }
    if (t->shape != SHAPE_STEPS) {
        at[n] = t->length;
        height[n++] = 0;
    }
    return n;
}

/* Height of the shape for a height of 1, somewhere on it. */
static double terrain_find_height(const struct terrain *t, double x, double y)
{
    double at[BREAKS_MAX], height[BREAKS_MAX];
    int i = 1, n;

    if (t->shape == SHAPE_BUMP) {
        double across = t->side_slope > 0 ? bump_factor(2 * y / t->span) : 1;

        return bump_factor(2 * x / t->length - 1) * across;
    }
    if (t->shape == SHAPE_WAVES) {
        return (1 - cos(TURN * (double)t->count * x / t->length)) / 2;
    }
    n = terrain_find_breaks(t, at, height);
    while (i + 1 < n && at[i] <= x) {
        i++;
    }
    return height[i - 1] + (height[i] - height[i - 1]) * (x - at[i - 1]) / (at[i] - at[i - 1]);
}

/* ---- the grid ---- */

/* Adds lines from the last one on to a place, no wider than a cell if they are to be fine, an even
 * number: a bump has its top on one. */
static bool lines_add(double *line, int *n, double to, double cell, bool fine)
{
    const double from = line[*n - 1];
    const int parts = fine ? 2 * (int)ceil((to - from) / cell / 2 - 1e-9) : 1;

    for (int i = 1; i <= parts; i++) {
        if (*n == LINES_MAX) {
            return false;
        }
        line[(*n)++] = i < parts ? from + (to - from) * i / parts : to;
    }
    return true;
}

static bool terrain_make_lines(struct terrain *t)
{
    const bool fine = t->rough > 0 || t->shape == SHAPE_BUMP || t->shape == SHAPE_WAVES;
    const bool narrow = t->span < t->width;
    double at[BREAKS_MAX], height[BREAKS_MAX];
    const int n = terrain_find_breaks(t, at, height);
    bool room = true;

    /* Along: the way there, the shape, the way on */
    t->x[t->nx++] = -t->lead;
    t->x[t->nx++] = 0;
    for (int i = 1; i < n; i++) {
        room = room && lines_add(t->x, &t->nx, at[i], t->cell, fine);
    }
    room = room && lines_add(t->x, &t->nx, t->length + t->lead, t->cell, false);

    /* Across */
    t->y[t->ny++] = -t->width / 2;
    if (narrow) {
        t->y[t->ny++] = -t->span / 2;
    }
    room = room && lines_add(t->y, &t->ny, t->span / 2, t->cell,
                             t->rough > 0 || (t->shape == SHAPE_BUMP && t->side_slope > 0));
    if (narrow) {
        room = room && lines_add(t->y, &t->ny, t->width / 2, t->cell, false);
    }
    return room;
}

/* ---- the solid ---- */

static int terrain_add_vertex(struct terrain *t, double x, double y, double z)
{
    double *v = t->vertex[t->nvertex];

    v[0] = mesh_write_round(x);
    v[1] = mesh_write_round(y);
    v[2] = mesh_write_round(z);
    return t->nvertex++;
}

static void terrain_add_face(struct terrain *t, int a, int b, int c)
{
    int *f = t->face[t->nface++];

    f[0] = a;
    f[1] = b;
    f[2] = c;
}

/* The points of the top, by x, then y; their heights are scaled for the highest to be right. */
static void terrain_add_points(struct terrain *t)
{
    struct random_stream random = random_named((uint64_t)t->seed, "terrain");
    double z[LINES_MAX][LINES_MAX], highest = 0;

    for (int i = 0; i < t->nx; i++) {
        for (int j = 0; j < t->ny; j++) {
            const bool inside = i > 1 && i < t->nx - 2 && t->x[i] < t->length &&
                                (t->span == t->width || fabs(t->y[j]) < t->span / 2 - 1e-9);
            const double u = random_uniform(&random);

            z[i][j] = 0;
            if (inside) {
                z[i][j] = t->height * terrain_find_height(t, t->x[i], t->y[j]) + t->rough * u * u;
            }
            highest = fmax(highest, z[i][j]);
        }
    }
    for (int i = 0; i < t->nx; i++) {
        for (int j = 0; j < t->ny; j++) {
            terrain_add_vertex(t, t->x[i], t->y[j], z[i][j] * (t->height / highest));
        }
    }
}

/* Two triangles to a rectangle; which way they are cut alternates, so that none is preferred. */
static void terrain_add_top(struct terrain *t)
{
    for (int i = 0; i + 1 < t->nx; i++) {
        for (int j = 0; j + 1 < t->ny; j++) {
            const int a = i * t->ny + j, b = a + t->ny, c = b + 1, d = a + 1;

            if ((i + j) % 2 == 0) {
                terrain_add_face(t, a, b, c);
                terrain_add_face(t, a, c, d);
            } else {
                terrain_add_face(t, a, b, d);
                terrain_add_face(t, b, c, d);
            }
        }
    }
}

/* The walls down from the rim of the top, counterclockwise seen from above, and the bottom. */
static void terrain_add_walls(struct terrain *t)
{
    const int count = 2 * (t->nx + t->ny) - 4;
    int top[4 * LINES_MAX], n = 0, low = t->nvertex;

    for (int i = 0; i + 1 < t->nx; i++) {
        top[n++] = i * t->ny;
    }
    for (int j = 0; j + 1 < t->ny; j++) {
        top[n++] = (t->nx - 1) * t->ny + j;
    }
    for (int i = t->nx - 1; i > 0; i--) {
        top[n++] = i * t->ny + t->ny - 1;
    }
    for (int j = t->ny - 1; j > 0; j--) {
        top[n++] = j;
    }
    for (int i = 0; i < count; i++) {
        terrain_add_vertex(t, t->vertex[top[i]][0], t->vertex[top[i]][1], -t->depth);
    }

    const int middle = terrain_add_vertex(t, t->length / 2, 0, -t->depth);

    for (int i = 0; i < count; i++) {
        const int k = (i + 1) % count;

        terrain_add_face(t, low + i, low + k, top[k]);
        terrain_add_face(t, low + i, top[k], top[i]);
        terrain_add_face(t, low + k, low + i, middle);
    }
}

/* ---- what it is like ---- */

/* A facet of the shape, seen from above. */
struct facet_slope {
    double degrees, area;
};

static int facet_slope_compare(const void *a, const void *b)
{
    double x = ((const struct facet_slope *)a)->degrees;
    double y = ((const struct facet_slope *)b)->degrees;

    return (x > y) - (x < y);
}

/* The slopes that half and 90 % of the shape's area do not exceed, and the largest; degrees. */
static void terrain_find_slopes(const struct terrain *t, double out[3])
{
    static struct facet_slope slope[2 * LINES_MAX * LINES_MAX];
    double area = 0, sum = 0;
    int n = 0;

    for (int f = 0; f < 2 * (t->nx - 1) * (t->ny - 1); f++) {
        const double *a = t->vertex[t->face[f][0]], *b = t->vertex[t->face[f][1]];
        const double *c = t->vertex[t->face[f][2]];
        const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        const double v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
        const double nx = u[1] * v[2] - u[2] * v[1], ny = u[2] * v[0] - u[0] * v[2];
        const double nz = u[0] * v[1] - u[1] * v[0];
        const double x = (a[0] + b[0] + c[0]) / 3, y = (a[1] + b[1] + c[1]) / 3;

        if (x > 0 && x < t->length && fabs(y) < t->span / 2) {
            slope[n++] = (struct facet_slope){atan2(hypot(nx, ny), nz) / RADIANS, nz};
            area += nz;
        }
    }
    qsort(slope, (size_t)n, sizeof *slope, facet_slope_compare);
    for (int i = 0; i < n; i++) {
        sum += slope[i].area;
        out[0] = sum <= 0.5 * area || i == 0 ? slope[i].degrees : out[0];
        out[1] = sum <= 0.9 * area || i == 0 ? slope[i].degrees : out[1];
        out[2] = slope[i].degrees;
    }
}

/* The shape's numbers against each other; makes the grid's lines. */
static enum error_code terrain_check(struct terrain *t, struct error *error)
{
    t->span = t->width;
    if (t->shape == SHAPE_BUMP && t->side_slope > 0) {
        t->span = 2 * STEEPEST * t->height / tan(t->side_slope * RADIANS);
        if (t->span > t->width) {
            return error_set(error, ERROR_INPUT,
                             "--side-slope: makes the bump %g m wide, more than --width %g",
                             t->span, t->width);
        }
    }
    if (t->shape == SHAPE_RAMP && 2 * t->height / tan(t->slope * RADIANS) >= t->length) {
        return error_set(error, ERROR_INPUT,
                         "--length: found %g, expected more than the %g m of both slopes",
                         t->length, 2 * t->height / tan(t->slope * RADIANS));
    }
    if (t->shape == SHAPE_STEPS && t->length < 4 * RISER_RUN * (double)(2 * t->count - 1)) {
        return error_set(error, ERROR_INPUT,
                         "--length: found %g, too short for %d steps up and down", t->length,
                         (int)t->count);
    }
    if (!terrain_make_lines(t)) {
        return error_set(error, ERROR_INPUT,
                         "--cell: found %g, too fine: the grid has room for %d lines", t->cell,
                         LINES_MAX);
    }
    return ERROR_NONE;
}

/* Builds the solid and writes it, with the arguments that it was made of. */
static enum error_code terrain_write(struct terrain *t, int argc, char **argv, struct error *error)
{
    struct mesh mesh = {.name = "terrain",
                        .vertex = (const double(*)[3])t->vertex,
                        .face = (const int(*)[3])t->face};
    struct mesh_finding finding;
    enum error_code code;
    double slopes[3] = {0};

    /* A sound solid */
    terrain_add_points(t);
    terrain_add_top(t);
    terrain_add_walls(t);
    mesh.nvertex = (size_t)t->nvertex;
    mesh.nface = (size_t)t->nface;
    code = mesh_check(&mesh, &finding, error);
    if (code != ERROR_NONE) {
        return code;
    }
    if (finding.fault != MESH_SOUND) {
        return error_set(error, ERROR_INPUT, "these numbers give no solid: %s",
                         mesh_fault_text(finding.fault));
    }

    /* As text */
    terrain_find_slopes(t, slopes);
    printf("# SPDX-License-Identifier: Apache-2.0\n"
           "# Ground (m), not to be edited; made by: terrain-mesh");
    for (int i = 1; i < argc; i++) {
        printf(" %s", argv[i]);
    }
    printf("\n# %d triangles; slopes of half of the shape up to %.1f deg, of 90 %% up to %.1f, of "
           "all up to %.1f.\no terrain\n",
           t->nface, slopes[0], slopes[1], slopes[2]);
    return mesh_write_obj(&mesh, stdout, error);
}

/* ---- the command line ---- */

static struct terrain terrain = {.height = 0.03,
                                 .length = 1.6,
                                 .width = 6,
                                 .lead = 3,
                                 .depth = 0.4,
                                 .slope = 5,
                                 .cell = 0.1,
                                 .count = 3};

#define NUMBER(name, field, help, low, high, of)                                                   \
    {                                                                                              \
        name, OPTION_REAL, "N", help, &terrain.field, .min = low, .max = high, .unit = of          \
    }
#define COMMON_OPTIONS                                                                             \
    NUMBER("--height", height, "of the highest point (0.03)", 0.001, 1, "meters"),                 \
        NUMBER("--length", length, "of the shape, along x (1.6)", 0.1, 20, "meters"),              \
        NUMBER("--width", width, "of the plate, along y (6)", 0.1, 20, "meters"),                  \
        NUMBER("--lead", lead, "level plate before and behind the shape (3)", 0.1, 20, "meters"),  \
        NUMBER("--depth", depth, "of the plate's bottom (0.4)", 0.05, 5, "meters"),                \
        NUMBER("--rough", rough, "lift points at random by up to so much (0)", 0, 0.2, "meters"),  \
        NUMBER("--cell", cell, "largest cell of what is curved or rough (0.1)", 0.005, 1,          \
               "meters"),                                                                          \
    {                                                                                              \
        "--seed", OPTION_INT, "N", "of that chance (0)", &terrain.seed, .min = 0, .max = 1e9       \
    }

static const struct option_spec bump_options[] = {
    COMMON_OPTIONS,
    NUMBER("--side-slope", side_slope,
           "steepest slope sideways of the smooth shape; 0: none, as wide as the plate (0)", 0, 45,
           "degrees"),
};
static const struct option_spec ramp_options[] = {
    COMMON_OPTIONS,
    NUMBER("--slope", slope, "up and down (5)", 0.5, 45, "degrees"),
};
static const struct option_spec count_options[] = {
    COMMON_OPTIONS,
    {"--count", OPTION_INT, "N", "steps up, or waves (3)", &terrain.count, .min = 1,
     .max = STEPS_MAX},
};

static const struct command_spec shapes[] = {
    {.name = "bump",
     .summary = "Write ground with a smooth or rough bump as a closed mesh (OBJ).",
     .program = "terrain-mesh",
     .option = bump_options,
     .noption = ARRAY_COUNT(bump_options)},
    {.name = "ramp",
     .summary = "Write ground with a ramp up and down as a closed mesh (OBJ).",
     .program = "terrain-mesh",
     .option = ramp_options,
     .noption = ARRAY_COUNT(ramp_options)},
    {.name = "steps",
     .summary = "Write ground with stairs up and down as a closed mesh (OBJ).",
     .program = "terrain-mesh",
     .option = count_options,
     .noption = ARRAY_COUNT(count_options)},
    {.name = "waves",
     .summary = "Write ground with waves as a closed mesh (OBJ).",
     .program = "terrain-mesh",
     .option = count_options,
     .noption = ARRAY_COUNT(count_options)},
};

int main(int argc, char **argv)
{
    struct error error;
    enum error_code code;
    size_t s = 0;
    int status;

    while (argc > 1 && s < ARRAY_COUNT(shapes) && strcmp(argv[1], shapes[s].name) != 0) {
        s++;
    }
    if (argc < 2 || s == ARRAY_COUNT(shapes)) {
        fputs("usage: terrain-mesh bump|ramp|steps|waves [OPTIONS] >FILE\n", stderr);
        return STATUS_INPUT;
    }
    if (!options_read(&shapes[s], argc - 1, argv + 1, &status)) {
        return status;
    }
    terrain.shape = (enum terrain_shape)s;
    code = terrain_check(&terrain, &error);
    if (code == ERROR_NONE) {
        code = terrain_write(&terrain, argc, argv, &error);
    }
    return options_flush_output(options_end(&shapes[s], code, &error));
}
