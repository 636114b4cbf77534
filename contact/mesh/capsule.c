/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the mesh of a capsule or cylinder: rings of vertices about the axis, and a vertex at each
 * end of the axis. */
#include "base/portable_math.h"
#include "contact/mesh/mesh.h"

#include <math.h>

#define PI 3.14159265358979323846

enum { SIDES_MAX = 64 };

/* Number of sides, and number of rings per end, including the equator of the end. */
struct rings {
    int sides, rings;
};

/* Computes the vertices: rings from the lowest to the highest, then the bottom and the top vertex.
 * The equators of both ends are the middle rings. */
static void rings_place_vertices(const struct rings *r, double radius, double length,
                                 double (*vertex)[3])
{
    /* Radius at which the polygon has the area of the circle */
    const double wide = radius * sqrt(2 * PI / (r->sides * portable_sin(2 * PI / r->sides)));
    const double tip = length / 2 + (r->rings > 1 ? wide : 0);
    double around[SIDES_MAX][2];

    for (int i = 0; i < r->sides; i++) {
        around[i][0] = portable_cos(2 * PI * i / r->sides);
        around[i][1] = portable_sin(2 * PI * i / r->sides);
    }

    /* Rings at equal angles from the equator of their end */
    for (int ring = 0; ring < 2 * r->rings; ring++) {
        int from_equator = ring < r->rings ? ring - (r->rings - 1) : ring - r->rings;
        double angle = from_equator * PI / 2 / r->rings, out = wide * portable_cos(angle);
        double z = wide * portable_sin(angle) + (ring < r->rings ? -length / 2 : length / 2);

        for (int i = 0; i < r->sides; i++) {
            double *v = *vertex++;

            v[0] = out * around[i][0];
            v[1] = out * around[i][1];
            v[2] = z;
        }
    }
    for (int k = 0; k < 2; k++) {
        vertex[0][k] = vertex[1][k] = 0;
    }
    vertex[0][2] = -tip;
    vertex[1][2] = tip;
}

static size_t rings_add_face(int (*face)[3], size_t n, int a, int b, int c)
{
    face[n][0] = a;
    face[n][1] = b;
    face[n][2] = c;
    return n + 1;
}

/* Writes the faces. */
static void rings_connect(const struct rings *r, int (*face)[3])
{
    const int last = (2 * r->rings - 1) * r->sides, bottom = last + r->sides, top = bottom + 1;
    size_t n = 0;

    for (int i = 0; i < r->sides; i++) {
        int next = (i + 1) % r->sides;

        n = rings_add_face(face, n, bottom, next, i);
        for (int ring = 0; ring < 2 * r->rings - 1; ring++) {
            int low = ring * r->sides, high = low + r->sides;

            n = rings_add_face(face, n, low + i, low + next, high + next);
            n = rings_add_face(face, n, low + i, high + next, high + i);
        }
        n = rings_add_face(face, n, top, last + i, last + next);
    }
}

enum error_code mesh_capsule(double radius, double length, bool flat, struct arena *arena,
                             const struct mesh **mesh, struct error *error)
{
    const struct rings r = flat ? (struct rings){SIDES_MAX, 1} : (struct rings){16, 4};
    const size_t ring = (size_t)r.sides, rings = 2 * (size_t)r.rings;
    double(*vertex)[3];
    int(*face)[3];
    struct mesh *capsule = mesh_alloc(flat ? "cylinder" : "capsule", rings * ring + 2,
                                      2 * ring * rings, arena, &vertex, &face, error);

    if (!capsule) {
        return ERROR_MEMORY;
    }

    /* A shorter axis would give degenerate faces */
    rings_place_vertices(&r, radius, fmax(length, 1e-3 * radius), vertex);
    rings_connect(&r, face);
    *mesh = capsule;
    return ERROR_NONE;
}
