/* SPDX-License-Identifier: Apache-2.0 */
/*
 * foot-mesh: writes the collision mesh of one foot of a robot as OBJ text, in the ankle frame
 * (origin on its axes, x forward, y left, z up, meters).
 *
 *     foot-mesh coman|walkman right|left >FILE
 *
 * The sole is the robot's published outline, flat. The top is assumed (D in the terms of the robot
 * data): flat, the outline at 4/5 of its size. 504 triangles in all, as many as the paper's foot
 * (Table 2).
 *
 * The sole is a set of rings: the outline, cut into 42 pieces of nearly equal length, then copies
 * of it scaled toward its centroid with fewer and fewer points, stitched into triangles. Springs
 * sit at triangle centroids, so many small triangles of like size integrate the pressure well. The
 * triangles tile the outline: their areas add up to the outline's. The wall has two rows, so that
 * the centroids of the lower one lie a centimeter above the sole: the wall stays out of a contact
 * that is not deeper than that.
 */
#include "base/count.h"
#include "contact/mesh/mesh.h"
#include "tools/mesh_write.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define NRIM 42 /* points of the outline after cutting */
#define NVERTEX_MAX 512
#define NFACE 504
#define TOP_SCALE 0.8

/* The right sole (xy, counterclockwise seen from above), its z and that of the top */
struct outline {
    const char *name, *title;
    int count; /* at most NRIM */
    const double (*point)[2];
    double sole_z, top_z;
};

static const double coman_outline[][2] = {
    {-0.06, -0.023},   {-0.055, -0.0328}, {-0.05, -0.0387},  {-0.0409, -0.0434}, {-0.028, -0.045},
    {0.068, -0.045},   {0.082, -0.0418},  {0.0952, -0.0362}, {0.1081, -0.0285},  {0.1186, -0.0193},
    {0.1269, -0.0045}, {0.1299, 0.0071},  {0.1299, 0.0206},  {0.1272, 0.0308},   {0.1245, 0.0349},
    {0.1183, 0.0408},  {0.1055, 0.045},   {-0.035, 0.045},   {-0.0462, 0.0408},  {-0.0559, 0.0308},
    {-0.06, 0.0192},
};

/* The rectangle of 2015 */
static const double walkman_outline[][2] = {
    {-0.111, -0.09}, {0.195, -0.09}, {0.195, 0.07}, {-0.111, 0.07}};

#define OUTLINE(points) (int)ARRAY_COUNT(points), points
static const struct outline robots[] = {
    {"coman", "COMAN", OUTLINE(coman_outline), -0.0932, -0.03},
    {"walkman", "WALK-MAN", OUTLINE(walkman_outline), -0.1435, -0.08},
};

struct ring {
    int first, count;   /* vertices */
    double along[NRIM]; /* where each lies along the outline, 0 to 1 */
};

struct foot {
    const struct outline *outline;
    double vertex[NVERTEX_MAX][3];
    int face[NFACE][3];
    int nvertex, nface;
    double rim[NRIM][2]; /* the cut outline */
    double along[NRIM];  /* of its points, 0 to 1 */
    double centroid[2];
};

static int foot_add_vertex(struct foot *foot, double x, double y, double z)
{
    double *v = foot->vertex[foot->nvertex];

    v[0] = mesh_write_round(x);
    v[1] = mesh_write_round(y);
    v[2] = z;
    return foot->nvertex++;
}

static void foot_add_face(struct foot *foot, int a, int b, int c, bool upward)
{
    int *f = foot->face[foot->nface++];

    f[0] = a;
    f[1] = upward ? b : c;
    f[2] = upward ? c : b;
}

static double outline_edge_length(const struct outline *outline, int edge)
{
    const double *a = outline->point[edge], *b = outline->point[(edge + 1) % outline->count];

    return sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]));
}

/* Shares the NRIM points out: each new one goes to the edge with the longest pieces. */
static void foot_cut_outline(struct foot *foot)
{
    const struct outline *outline = foot->outline;
    int pieces[NRIM], n = 0;
    double perimeter = 0, run = 0;

    /* How many pieces each edge gets */
    for (int e = 0; e < outline->count; e++) {
        pieces[e] = 1;
        perimeter += outline_edge_length(outline, e);
    }
    for (int extra = outline->count; extra < NRIM; extra++) {
        int longest = 0;

        for (int e = 1; e < outline->count; e++) {
            if (outline_edge_length(outline, e) / pieces[e] >
                outline_edge_length(outline, longest) / pieces[longest]) {
                longest = e;
            }
        }
        pieces[longest]++;
    }

    /* Their points, each at its fraction of the perimeter */
    for (int e = 0; e < outline->count; e++) {
        const double *a = outline->point[e], *b = outline->point[(e + 1) % outline->count];

        for (int p = 0; p < pieces[e]; p++) {
            double s = (double)p / pieces[e];

            foot->rim[n][0] = a[0] + s * (b[0] - a[0]);
            foot->rim[n][1] = a[1] + s * (b[1] - a[1]);
            foot->along[n++] = (run + s * outline_edge_length(outline, e)) / perimeter;
        }
        run += outline_edge_length(outline, e);
    }
}

static void foot_find_centroid(struct foot *foot)
{
    const struct outline *outline = foot->outline;
    double twice = 0, sum[2] = {0, 0};

    for (int i = 0; i < outline->count; i++) {
        const double *a = outline->point[i], *b = outline->point[(i + 1) % outline->count];
        double part = a[0] * b[1] - b[0] * a[1];

        twice += part;
        sum[0] += part * (a[0] + b[0]);
        sum[1] += part * (a[1] + b[1]);
    }
    foot->centroid[0] = sum[0] / (3 * twice);
    foot->centroid[1] = sum[1] / (3 * twice);
}

/* The point of the cut outline at a fraction of its length. */
static void foot_outline_point(const struct foot *foot, double along, double out[2])
{
    int i = NRIM - 1;

    while (foot->along[i] > along) {
        --i;
    }

    double end = i + 1 < NRIM ? foot->along[i + 1] : 1;
    double s = (along - foot->along[i]) / (end - foot->along[i]);
    const double *a = foot->rim[i], *b = foot->rim[(i + 1) % NRIM];

    out[0] = a[0] + s * (b[0] - a[0]);
    out[1] = a[1] + s * (b[1] - a[1]);
}

/* The outline scaled about its centroid: its NRIM points, or count evenly spaced ones. */
static struct ring foot_add_ring(struct foot *foot, int count, double scale, double z)
{
    struct ring ring = {.first = foot->nvertex, .count = count};

    for (int i = 0; i < count; i++) {
        double p[2] = {0};

        ring.along[i] = count == NRIM ? foot->along[i] : (double)i / count;
        foot_outline_point(foot, ring.along[i], p);
        foot_add_vertex(foot, foot->centroid[0] + scale * (p[0] - foot->centroid[0]),
                        foot->centroid[1] + scale * (p[1] - foot->centroid[1]), z);
    }
    return ring;
}

/* The fraction at which a ring's piece after point i has its middle. */
static double ring_middle(const struct ring *ring, int i)
{
    double end = i + 1 < ring->count ? ring->along[i + 1] : 1;

    return (ring->along[i] + end) / 2;
}

/* Fills the band between two rings: walks both, always stepping on the one that is behind. Seen
 * from the side of the triangles' normals outer runs counterclockwise if upward. */
static void foot_stitch_rings(struct foot *foot, const struct ring *outer, const struct ring *inner,
                              bool upward)
{
    int o = 0, i = 0;

    while (o < outer->count || i < inner->count) {
        int here = outer->first + o % outer->count, there = inner->first + i % inner->count;
        bool step_outer = i == inner->count ||
                          (o < outer->count && ring_middle(outer, o) <= ring_middle(inner, i));

        if (step_outer) {
            ++o;
            foot_add_face(foot, here, outer->first + o % outer->count, there, upward);
        } else {
            ++i;
            foot_add_face(foot, here, inner->first + i % inner->count, there, upward);
        }
    }
}

/* Closes a ring with a fan about the centroid. */
static void foot_close_ring(struct foot *foot, const struct ring *ring, double z, bool upward)
{
    int hub = foot_add_vertex(foot, foot->centroid[0], foot->centroid[1], z);

    for (int i = 0; i < ring->count; i++) {
        foot_add_face(foot, ring->first + i, ring->first + (i + 1) % ring->count, hub, upward);
    }
}

static void foot_add_rings(struct foot *foot, const struct ring *rim, double rim_scale, int nring,
                           const int *count, double z, bool upward)
{
    struct ring outer = *rim;

    for (int r = 0; r < nring; r++) {
        double scale = rim_scale * (nring - r) / (nring + 1);
        struct ring inner = foot_add_ring(foot, count[r], scale, z);

        foot_stitch_rings(foot, &outer, &inner, upward);
        outer = inner;
    }
    foot_close_ring(foot, &outer, z, upward);
}

static void foot_build_right(struct foot *foot)
{
    /* 42 + 2 (36 + 28 + 20 + 12 + 6) + 4 * 42 + 42 + 2 * 24 = 504 */
    static const int sole_count[] = {36, 28, 20, 12, 6}, top_count[] = {24};

    double sole_z = foot->outline->sole_z, top_z = foot->outline->top_z;

    foot_cut_outline(foot);
    foot_find_centroid(foot);

    struct ring sole = foot_add_ring(foot, NRIM, 1, sole_z);
    struct ring waist = foot_add_ring(foot, NRIM, (1 + TOP_SCALE) / 2, (sole_z + top_z) / 2);
    struct ring top = foot_add_ring(foot, NRIM, TOP_SCALE, top_z);

    foot_add_rings(foot, &sole, 1, 5, sole_count, sole_z, false);
    foot_stitch_rings(foot, &sole, &waist, true);
    foot_stitch_rings(foot, &waist, &top, true);
    foot_add_rings(foot, &top, TOP_SCALE, 1, top_count, top_z, true);
}

/* The left foot: y turned round, and with it the sense of every triangle. */
static void foot_mirror(struct foot *foot)
{
    for (int v = 0; v < foot->nvertex; v++) {
        foot->vertex[v][1] = -foot->vertex[v][1];
    }
    for (int f = 0; f < foot->nface; f++) {
        int second = foot->face[f][1];

        foot->face[f][1] = foot->face[f][2];
        foot->face[f][2] = second;
    }
}

static const struct outline *foot_find_outline(const char *name)
{
    for (size_t i = 0; i < ARRAY_COUNT(robots); i++) {
        if (strcmp(name, robots[i].name) == 0) {
            return &robots[i];
        }
    }
    return NULL;
}

int main(int argc, char **argv)
{
    static struct foot foot;
    struct mesh mesh = {.name = "foot",
                        .vertex = (const double(*)[3])foot.vertex,
                        .face = (const int(*)[3])foot.face};
    struct mesh_finding finding;
    struct error error;

    if (argc != 3 || !foot_find_outline(argv[1]) ||
        (strcmp(argv[2], "right") != 0 && strcmp(argv[2], "left") != 0)) {
        fputs("usage: foot-mesh coman|walkman right|left >FILE\n", stderr);
        return 2;
    }

    /* The foot */
    foot.outline = foot_find_outline(argv[1]);
    foot_build_right(&foot);
    if (strcmp(argv[2], "left") == 0) {
        foot_mirror(&foot);
    }
    mesh.nvertex = (size_t)foot.nvertex;
    mesh.nface = (size_t)foot.nface;

    /* Is a closed surface of as many faces as it should have */
    if (mesh_check(&mesh, &finding, &error) != ERROR_NONE) {
        fprintf(stderr, "foot-mesh: %s\n", error.text);
        return 3;
    }
    if (finding.fault != MESH_SOUND || foot.nface != NFACE) {
        fprintf(stderr, "foot-mesh: %d faces, %s\n", foot.nface, mesh_fault_text(finding.fault));
        return 3;
    }

    /* As text */
    printf("# SPDX-License-Identifier: Apache-2.0\n"
           "# %s, %s foot, in the ankle frame (m); made by foot-mesh, not to be edited.\n"
           "o foot_%s\n",
           foot.outline->title, argv[2], argv[2]);
    if (mesh_write_obj(&mesh, stdout, &error) != ERROR_NONE) {
        fprintf(stderr, "foot-mesh: %s\n", error.text);
        return 3;
    }
    return 0;
}
