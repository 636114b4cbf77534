/* SPDX-License-Identifier: Apache-2.0 */
/* Makes a mesh ready for contact: normals and neighbors of faces, planes, bounding-volume trees. */
#include "base/portable_math.h"
#include "contact/mesh/solid_private.h"

#include "base/array.h"
#include "base/vec3.h"

#include <stdlib.h>

#define CONVEX_FACETS 256 /* solids with more facets are not tested for convexity */

void *solid_alloc(struct solid_builder *b, size_t count, size_t size)
{
    void *memory = arena_alloc(b->arena, count, size);

    if (!memory) {
        error_set(b->error, ERROR_MEMORY, "contact: no memory for the %zu faces of '%s'",
                  b->mesh->nface, b->mesh->name);
    }
    return memory;
}

/* ---- faces ---- */

/* Computes the edges of a face, from each corner to the next. */
static void mesh_find_edges(const struct mesh *m, int face, double e[3][3])
{
    for (int i = 0; i < 3; i++) {
        vec3_sub(mesh_corner(m, face, (i + 1) % 3), mesh_corner(m, face, i), e[i]);
    }
}

/* Computes the unit normals of faces. */
static enum error_code solid_make_faces(struct solid_builder *b, struct solid *s)
{
    b->normal = solid_alloc(b, b->mesh->nface, sizeof *b->normal);
    if (!b->normal) {
        return ERROR_MEMORY;
    }
    for (int f = 0; f < (int)b->mesh->nface; f++) {
        double e[3][3], n[3], length;

        mesh_find_edges(b->mesh, f, e);
        vec3_cross(e[0], e[1], n);
        length = vec3_norm(n);
        for (int k = 0; k < 3; k++) {
            b->normal[f][k] = n[k] / length;
        }
    }
    s->normal = (const double(*)[3])b->normal;
    return ERROR_NONE;
}

/* Computes the pseudonormals of vertices. They give the sign of the distance where a vertex is the
 * nearest point. A convex solid uses its planes instead. */
static enum error_code solid_make_vertex_normals(struct solid_builder *b, struct solid *s)
{
    const struct mesh *m = b->mesh;
    double(*vertex_normal)[3] = s->convex ? NULL : solid_alloc(b, m->nvertex, 3 * sizeof(double));

    if (!vertex_normal) {
        return s->convex ? ERROR_NONE : ERROR_MEMORY;
    }
    for (int f = 0; f < (int)m->nface; f++) {
        double e[3][3];

        /* Each face normal, weighted by its angle at the corner, adds to the vertex's pseudonormal
         * (Baerentzen, Aanaes 2005) */
        mesh_find_edges(m, f, e);
        for (int i = 0; i < 3; i++) {
            double *sum = vertex_normal[m->face[f][i]], side[3];
            const double *from = e[i], *to = e[(i + 2) % 3];

            vec3_cross(to, from, side);
            vec3_add_scaled(sum, portable_atan2(vec3_norm(side), -vec3_dot(to, from)), b->normal[f],
                            sum);
        }
    }
    s->vertex_normal = (const double(*)[3])vertex_normal;
    return ERROR_NONE;
}

/* Finds the neighbor of each face across each of its edges. */
static enum error_code solid_make_neighbors(struct solid_builder *b, struct solid *s)
{
    const struct mesh *m = b->mesh;
    size_t n = 3 * m->nface;
    struct half_edge *edge = malloc(n * sizeof *edge);
    enum error_code code;

    b->neighbor = solid_alloc(b, m->nface, sizeof *b->neighbor);
    if (!b->neighbor || !edge) {
        free(edge);
        return error_set(b->error, ERROR_MEMORY, "contact: no memory for the edges of '%s'",
                         m->name);
    }

    /* In a sound mesh each edge occurs twice, as sorted neighbors */
    code = mesh_sort_half_edges(m, edge, b->error);
    for (size_t i = 0; !code && i + 1 < n; i += 2) {
        int x = edge[i].number, y = edge[i + 1].number;

        b->neighbor[x / 3][x % 3] = y / 3;
        b->neighbor[y / 3][y % 3] = x / 3;
    }
    free(edge);
    s->neighbor = (const int(*)[3])b->neighbor;
    return code;
}

/* ---- planes of a convex solid ---- */

/* Checks whether all vertices are behind the planes of all facets, within rounding. Returns false
 * for solids with many facets. */
static bool solid_is_convex(const struct solid_builder *b, const struct solid *s)
{
    if (s->nfacet > CONVEX_FACETS) {
        return false;
    }
    for (size_t i = 0; i < s->nfacet; i++) {
        const struct facet *f = &s->facet[i];

        for (size_t v = 0; v < b->mesh->nvertex; v++) {
            if (vec3_dot(f->normal, b->mesh->vertex[v]) - f->offset > CONVEX * b->size) {
                return false;
            }
        }
    }
    return true;
}

/* Stores the facets' planes of a convex solid by rows, to compute LANES distances at a time; pads
 * with the last plane. */
static enum error_code solid_make_planes(struct solid_builder *b, struct solid *s)
{
    double *plane[PLANE_ROWS];

    s->convex = solid_is_convex(b, s);
    if (!s->convex) {
        return ERROR_NONE;
    }
    s->nplane = (s->nfacet + SOLID_LANES - 1) / SOLID_LANES * SOLID_LANES;
    for (int row = 0; row < PLANE_ROWS; row++) {
        s->plane[row] = plane[row] = solid_alloc(b, s->nplane, sizeof **plane);
        if (!plane[row]) {
            return ERROR_MEMORY;
        }
        for (size_t i = 0; i < s->nplane; i++) {
            const struct facet *f = &s->facet[i < s->nfacet ? i : s->nfacet - 1];

            plane[row][i] = row == PLANE_OFFSET ? f->offset : f->normal[row];
        }
    }
    return ERROR_NONE;
}

/* ---- trees ---- */

/* Builds the trees over faces and facets and the bounds of the facets' normals. box: scratch with
 * one box per face. */
static enum error_code solid_fill_trees(struct solid_builder *b, struct solid *s, struct box *box)
{
    const struct mesh *m = b->mesh;
    struct box *normal_bounds;
    enum error_code code;

    /* Tree over the faces */
    for (int f = 0; f < (int)m->nface; f++) {
        box[f] = box_of_point(mesh_corner(m, f, 0));
        box_add(&box[f], mesh_corner(m, f, 1));
        box_add(&box[f], mesh_corner(m, f, 2));
    }
    code = tree_build(box, m->nface, 2, b->arena, &s->faces, b->error);
    if (code != ERROR_NONE) {
        return code;
    }

    /* Tree over the facets */
    for (size_t i = 0; i < s->nfacet; i++) {
        const struct facet *f = &s->facet[i];

        box[i] = box_of_point(s->ring[f->first]);
        for (int k = 1; k < f->count; k++) {
            box_add(&box[i], s->ring[f->first + k]);
        }
    }
    code = tree_build(box, s->nfacet, 2, b->arena, &s->facets, b->error);
    if (code != ERROR_NONE) {
        return code;
    }

    /* Bounds of the facets' normals */
    normal_bounds = solid_alloc(b, s->facets.nnode, sizeof *normal_bounds);
    if (!normal_bounds) {
        return ERROR_MEMORY;
    }
    for (size_t i = 0; i < s->nfacet; i++) {
        box[i] = box_of_point(s->facet[i].normal);
    }
    tree_cover(&s->facets, box, normal_bounds);
    s->normal_bounds = normal_bounds;
    return ERROR_NONE;
}

/* Builds the trees, with scratch memory on the heap. */
static enum error_code solid_make_trees(struct solid_builder *b, struct solid *s)
{
    struct box *box = malloc(b->mesh->nface * sizeof *box);
    enum error_code code;

    if (!box) {
        return error_set(b->error, ERROR_MEMORY, "contact: no memory for the trees of '%s'",
                         b->mesh->name);
    }
    code = solid_fill_trees(b, s, box);
    free(box);
    return code;
}

/* ---- making a solid ---- */

enum error_code solid_make(const struct mesh *mesh, struct arena *arena, struct solid *solid,
                           struct error *error)
{
    /* Each step uses the results of the earlier steps */
    static enum error_code (*const step[])(struct solid_builder *, struct solid *) = {
        solid_make_faces,  solid_make_neighbors,      solid_make_facets,
        solid_make_points, solid_make_outlines,       solid_make_moments,
        solid_make_planes, solid_make_vertex_normals, solid_make_trees};
    struct solid_builder b = {.mesh = mesh, .arena = arena, .error = error};
    enum error_code code = ERROR_NONE;

    /* Scratch memory on the heap */
    *solid = (struct solid){
        .nvertex = mesh->nvertex, .nface = mesh->nface, .vertex = mesh->vertex, .face = mesh->face};
    b.group = malloc(mesh->nface * sizeof *b.group);
    b.member = malloc(mesh->nface * sizeof *b.member);
    b.next = malloc(mesh->nvertex * sizeof *b.next);
    b.ring_vertex = malloc(3 * mesh->nface * sizeof *b.ring_vertex);
    if (!b.group || !b.member || !b.next || !b.ring_vertex) {
        code = error_set(error, ERROR_MEMORY, "contact: no memory to prepare '%s'", mesh->name);
        goto done;
    }

    /* Copies the results, which are in the arena */
    const struct mesh *m = b.mesh;
    double diagonal[3];

    solid->box = box_of_point(m->vertex[0]);
    for (size_t v = 1; v < m->nvertex; v++) {
        box_add(&solid->box, m->vertex[v]);
    }
    vec3_sub(solid->box.high, solid->box.low, diagonal);
    b.size = vec3_norm(diagonal);
    solid->radius = b.size / 2;
    for (size_t i = 0; i < ARRAY_COUNT(step); i++) {
        code = step[i](&b, solid);
        if (code != ERROR_NONE) {
            break;
        }
    }

done:
    free(b.group);
    free(b.member);
    free(b.next);
    free(b.ring_vertex);
    return code;
}
