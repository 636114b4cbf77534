/* SPDX-License-Identifier: Apache-2.0 */
/* What is around the facets of a solid, so that a search can often be left out. */
#include "base/vec3.h"
#include "contact/solid.h"

#include <math.h>

/* What is known about the surroundings of a facet: see struct facet. corner: its vertices. */
static void look_around(const struct solid *s, const int *corner, struct facet *f)
{
    enum { MOST = 256 }; /* a crowd is not worth the time */
    double margin = f->radius, apart = margin, cosine = 1;
    struct box box;
    int near[MOST];
    size_t n;

    for (int k = 0; k < 3; ++k) {
        box.low[k] = f->center[k] - f->radius - margin;
        box.high[k] = f->center[k] + f->radius + margin;
    }
    n = tree_collect(&s->faces, &box, near, MOST);
    if (n == MOST) {
        return;
    }
    for (size_t i = 0; i < n; ++i) {
        const int *v = s->face[near[i]];
        double point[3], to[3];
        bool touches = false;

        for (int k = 0; k < 3 * f->count; ++k) {
            touches = touches || v[k % 3] == corner[k / 3];
        }
        if (touches) {
            cosine = fmin(cosine, vec3_dot(s->normal[near[i]], f->normal));
        } else {
            solid_nearest_of_face(s, near[i], f->center, point);
            vec3_sub(point, f->center, to);
            apart = fmin(apart, vec3_norm(to) - f->radius);
        }
    }
    if (cosine > 0 && apart > 0) {
        f->lean[0] = cosine;
        f->lean[1] = sqrt(1 - cosine * cosine);
        f->room = apart / 3;
    }
}

/* Where all vertices of a facet are corners of it, which is so without any inside or on its edges,
 * what touches it is what has one of them. */
void solid_look_around(const struct solid *solid, const int *ring_vertex, struct facet *facet)
{
    for (size_t i = 0; i < solid->nfacet; ++i) {
        struct facet *f = &facet[i];

        if (f->tiles == f->count - 2) {
            look_around(solid, ring_vertex + f->first, f);
        }
    }
}
