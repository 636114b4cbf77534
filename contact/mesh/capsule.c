/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the mesh of a capsule: rings of vertices about the axis, and a vertex at each tip. */
#include "base/portable_math.h"
#include "contact/mesh/mesh.h"

#include <math.h>

#define PI 3.14159265358979323846
#define SIDES 16
#define RINGS 4 /* rings per end, including its equator */
#define VERTICES (2 * RINGS * SIDES + 2)
#define FACES (2 * SIDES * (2 * RINGS - 1) + 2 * SIDES)
#define BOTTOM (VERTICES - 2)
#define TOP (VERTICES - 1)

/* Computes the vertices: rings from the lowest to the highest; the equators of both ends are in
 * the middle. */
static void capsule_place_vertices(double radius, double length, double (*vertex)[3])
{
    /* Radius at which the polygon has the area of the circle */
    const double wide = radius * sqrt(2 * PI / (SIDES * portable_sin(2 * PI / SIDES)));
    double around[SIDES][2];

    for (int i = 0; i < SIDES; i++) {
        around[i][0] = portable_cos(2 * PI * i / SIDES);
        around[i][1] = portable_sin(2 * PI * i / SIDES);
    }

    /* Rings at equal angles from the equator of their end */
    for (int ring = 0; ring < 2 * RINGS; ring++) {
        int from_equator = ring < RINGS ? ring - (RINGS - 1) : ring - RINGS;
        double angle = from_equator * PI / 2 / RINGS, out = wide * portable_cos(angle);
        double z = wide * portable_sin(angle) + (ring < RINGS ? -length / 2 : length / 2);

        for (int i = 0; i < SIDES; i++) {
            double *v = vertex[ring * SIDES + i];

            v[0] = out * around[i][0];
            v[1] = out * around[i][1];
            v[2] = z;
        }
    }
    for (int k = 0; k < 2; k++) {
        vertex[BOTTOM][k] = vertex[TOP][k] = 0;
    }
    vertex[BOTTOM][2] = -length / 2 - wide;
    vertex[TOP][2] = length / 2 + wide;
}

static size_t capsule_add_face(int (*face)[3], size_t n, int a, int b, int c)
{
    face[n][0] = a;
    face[n][1] = b;
    face[n][2] = c;
    return n + 1;
}

/* Writes the faces. */
static void capsule_connect(int (*face)[3])
{
    const int last = (2 * RINGS - 1) * SIDES;
    size_t n = 0;

    for (int i = 0; i < SIDES; i++) {
        int next = (i + 1) % SIDES;

        n = capsule_add_face(face, n, BOTTOM, next, i);
        for (int ring = 0; ring < 2 * RINGS - 1; ring++) {
            int low = ring * SIDES, high = low + SIDES;

            n = capsule_add_face(face, n, low + i, low + next, high + next);
            n = capsule_add_face(face, n, low + i, high + next, high + i);
        }
        n = capsule_add_face(face, n, TOP, last + i, last + next);
    }
}

enum error_code mesh_capsule(double radius, double length, struct arena *arena,
                             const struct mesh **mesh, struct error *error)
{
    double(*vertex)[3];
    int(*face)[3];
    struct mesh *capsule = mesh_alloc("capsule", VERTICES, FACES, arena, &vertex, &face, error);

    if (!capsule) {
        return ERROR_MEMORY;
    }

    /* A shorter axis would give degenerate faces */
    capsule_place_vertices(radius, fmax(length, 1e-3 * radius), vertex);
    capsule_connect(face);
    *mesh = capsule;
    return ERROR_NONE;
}
