/* SPDX-License-Identifier: Apache-2.0 */
/* Computes what surrounds the facets of a solid, so that contact can often do without a search for
 * the nearest point. */
#include "contact/mesh/solid_private.h"
#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>

/* Which faces touch which facet. */
struct surroundings {
    const struct solid *solid;
    int *vertex_face; /* a face of each vertex */
    int *touched;     /* by face: the last facet that it was found to touch, plus one */
};

/* Marks the faces around one of a facet's corners, walking from face to face across the edges that
 * end in it; returns the least cosine between the facet's normal and theirs, or the one given. */
static double corner_mark_faces(const struct surroundings *on, int vertex, int mark,
                                const double normal[3], double cosine)
{
    const struct solid *s = on->solid;
    const int first = on->vertex_face[vertex];
    int face = first;

    do {
        const int *corner = s->face[face];
        int at = corner[0] == vertex ? 0 : corner[1] == vertex ? 1 : 2;

        if (on->touched[face] != mark) {
            on->touched[face] = mark;
            cosine = fmin(cosine, vec3_dot(s->normal[face], normal));
        }
        face = s->neighbor[face][(at + 2) % 3];
    } while (face != first);
    return cosine;
}

/* Returns the distance, m, of the nearest face that does not touch a facet to the circle about it;
 * the facet's radius when there is none as near as that. */
static double facet_find_room(const struct surroundings *on, const struct facet *f, int mark)
{
    const struct solid *s = on->solid;
    const struct tree_node *node = s->faces.node, *end = tree_end(&s->faces);
    double limit2 = 4 * f->radius * f->radius; /* square of the distance from its center */

    while (node != end) {
        if (box_distance2(&node->box, f->center) >= limit2) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count; i++) {
            int face = s->faces.item[node->first + i];
            double point[3], to[3];

            if (on->touched[face] != mark) {
                solid_nearest_of_face(s, face, f->center, point);
                vec3_sub(point, f->center, to);
                limit2 = fmin(limit2, vec3_dot(to, to));
            }
        }
        ++node;
    }
    return fmin(f->radius, sqrt(limit2) - f->radius);
}

/* Computes bend and clearance of one facet. corner: its corners as vertices of the mesh. mark: a
 * number of its own. */
static void facet_find_surroundings(const struct surroundings *on, const int *corner, int mark,
                                    struct facet *f)
{
    double cosine = 1, apart;

    /* The sharpest bend to a face that touches it, the distance to the nearest that does not */
    for (int k = 0; k < f->count; k++) {
        cosine = corner_mark_faces(on, corner[k], mark, f->normal, cosine);
    }
    if (cosine <= 0) {
        return;
    }
    apart = facet_find_room(on, f, mark);
    if (apart > 0) {
        f->bend_cosine = cosine;
        f->bend_sine = sqrt(1 - cosine * cosine);
        f->clearance = apart / 3;
    }
}

/* Computes the surroundings of a solid that is not convex (the depth in a convex one needs no
 * search), of facets all of whose vertices are corners, none inside or on an edge:
 * only then the faces that touch a facet are those that have one of its corners. */
enum error_code solid_find_surroundings(struct solid_builder *b, struct solid *s)
{
    struct surroundings on = {.solid = s};
    enum error_code code = ERROR_NONE;

    if (s->convex) {
        return ERROR_NONE;
    }
    on.vertex_face = malloc(s->nvertex * sizeof *on.vertex_face);
    on.touched = calloc(s->nface, sizeof *on.touched);
    if (!on.vertex_face || !on.touched) {
        code = error_set(b->error, ERROR_MEMORY, "contact: no memory for the surroundings in '%s'",
                         b->mesh->name);
        goto done;
    }

    /* One face of each vertex, where walks around it begin */
    for (size_t f = 0; f < s->nface; f++) {
        for (int i = 0; i < 3; i++) {
            on.vertex_face[s->face[f][i]] = (int)f;
        }
    }
    for (size_t i = 0; i < s->nfacet; i++) {
        struct facet *f = &b->facet[i];

        /* n corners and nothing else make n - 2 triangles */
        if (f->nface == f->count - 2) {
            facet_find_surroundings(&on, b->ring_vertex + f->first, (int)i + 1, f);
        }
    }

done:
    free(on.vertex_face);
    free(on.touched);
    return code;
}
