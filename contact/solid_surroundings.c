/* SPDX-License-Identifier: Apache-2.0 */
/* What surrounds the facets of a solid, so that contact can often do without a search. */
#include "contact/solid_private.h"
#include "base/vec3.h"

#include <math.h>

/* Whether a face has one of a facet's corners (vertices of the mesh). */
static bool face_touches_facet(const struct solid *s, int face, const int *corner, int ncorner)
{
    for (int k = 0; k < 3 * ncorner; k++) {
        if (s->face[face][k % 3] == corner[k / 3]) {
            return true;
        }
    }
    return false;
}

/* Finds what surrounds one facet. corner: its corners as vertices of the mesh. */
static void facet_find_surroundings(const struct solid *s, const int *corner, struct facet *f)
{
    enum { MOST = 256 }; /* looking at more is not worth the time */
    double margin = f->radius, apart = margin, cosine = 1;
    struct box box;
    int near[MOST];
    size_t n;

    /* The faces within a radius of it */
    for (int k = 0; k < 3; k++) {
        box.low[k] = f->center[k] - f->radius - margin;
        box.high[k] = f->center[k] + f->radius + margin;
    }
    n = tree_collect(&s->faces, &box, near, MOST);
    if (n == MOST) {
        return;
    }

    /* The sharpest bend to one that touches it, the distance to the nearest that does not */
    for (size_t i = 0; i < n; i++) {
        double point[3], to[3];

        if (face_touches_facet(s, near[i], corner, f->count)) {
            cosine = fmin(cosine, vec3_dot(s->normal[near[i]], f->normal));
            continue;
        }
        solid_nearest_of_face(s, near[i], f->center, point);
        vec3_sub(point, f->center, to);
        apart = fmin(apart, vec3_norm(to) - f->radius);
    }
    if (cosine > 0 && apart > 0) {
        f->bend_cosine = cosine;
        f->bend_sine = sqrt(1 - cosine * cosine);
        f->clearance = apart / 3;
    }
}

/* Where all vertices of a facet are corners of it, which is so without any inside or on its edges,
 * what touches it is what has one of them. */
void solid_find_surroundings(const struct solid_builder *b, const struct solid *s)
{
    for (size_t i = 0; i < s->nfacet; i++) {
        struct facet *f = &b->facet[i];

        if (f->nface == f->count - 2) {
            facet_find_surroundings(s, b->ring_vertex + f->first, f);
        }
    }
}
