/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the pressure field of a solid: the depth inside it, cell by cell. */
#include "contact/mesh/field.h"

#include "base/portable_math.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FLAT 1e-9  /* eigenvalue over the trace; below it, parallel to all sides */
#define STEEP 0.05 /* minimum speed of a spoke away from a side, over its length */
#define ROOM 0.98  /* a ball fits if no surface point is within this part of its squared radius */
#define BALL_STEPS 24   /* steps in which a ball shrinks until it fits */
#define BALL_LEAVES 128 /* leaves of the tree of faces searched in one step */
#define CORE 0.02       /* largest part of a core's volume that may be inverted */

struct field_builder {
    const struct solid *solid;
    size_t nvertex;
    const char *name;
    struct arena *arena;
    struct error *error;

    double (*spoke)[3]; /* of each vertex: vector inward for a depth of 1 m */
    /* smallest speed at which the spoke leaves an adjacent side */
    double *least;
    double *depth; /* depth at the spoke's end, m */
    double (*node)[4];
};

static enum error_code field_no_memory(const struct field_builder *b)
{
    return error_set(b->error, ERROR_MEMORY, "contact: no memory for the field in '%s'", b->name);
}

/* ---- convex solids ---- */

/* Solves the 4 x 4 equations m x = y (y in the last column) by Gaussian elimination with pivoting.
 * Returns false when they are singular. */
static bool field_solve_four(double m[4][5], double x[4])
{
    for (int i = 0; i < 4; i++) {
        int best = i;

        /* Moves the largest pivot of the column to row i */
        for (int r = i + 1; r < 4; r++) {
            best = fabs(m[r][i]) > fabs(m[best][i]) ? r : best;
        }
        if (fabs(m[best][i]) < 1e-9) {
            return false;
        }
        for (int c = 0; c < 5; c++) {
            double t = m[i][c];

            m[i][c] = m[best][c];
            m[best][c] = t;
        }

        /* Eliminates the unknown from the rows below */
        for (int r = i + 1; r < 4; r++) {
            double part = m[r][i] / m[i][i];

            for (int c = i; c < 5; c++) {
                m[r][c] -= part * m[i][c];
            }
        }
    }

    /* Back substitution */
    for (int i = 4; i-- > 0;) {
        x[i] = m[i][4];
        for (int c = i + 1; c < 4; c++) {
            x[i] -= m[i][c] * x[c];
        }
        x[i] /= m[i][i];
    }
    return true;
}

/* Returns the depth of the point with equal depth under four sides, m; 0 if another side is
 * nearer. */
static double sides_common_depth(const struct solid *s, const int side[4])
{
    double m[4][5], x[4];

    /* normal . p + depth = offset for each side; p and the depth are unknown */
    for (int i = 0; i < 4; i++) {
        const struct facet *f = &s->facet[side[i]];

        memcpy(m[i], f->normal, sizeof f->normal);
        m[i][3] = 1;
        m[i][4] = f->offset;
    }
    if (!field_solve_four(m, x)) {
        return 0;
    }
    for (size_t i = 0; i < s->nfacet; i++) {
        const struct facet *f = &s->facet[i];

        if (f->offset - vec3_dot(f->normal, x) < x[3] - 1e-9 * s->radius) {
            return 0;
        }
    }
    return x[3];
}

/* ---- spokes ---- */

/* Computes sums over the sides around each vertex, weighted by their angles there: products of the
 * normal's components (xx, yy, zz, xy, xz, yz), and the normal. */
static void field_sum_normals(const struct field_builder *b, double (*sum)[9])
{
    const struct solid *s = b->solid;

    for (size_t f = 0; f < s->nface; f++) {
        const double *n = s->normal[f];

        for (int i = 0; i < 3; i++) {
            const double *at = s->vertex[s->face[f][i]];
            double *m = sum[s->face[f][i]], to[3], from[3], side[3], angle;

            /* Angle of the triangle at this corner */
            vec3_sub(s->vertex[s->face[f][(i + 1) % 3]], at, to);
            vec3_sub(s->vertex[s->face[f][(i + 2) % 3]], at, from);
            vec3_cross(to, from, side);
            angle = portable_atan2(vec3_norm(side), vec3_dot(to, from));

            /* n n^T and n, weighted */
            for (int k = 0; k < 3; k++) {
                m[k] += angle * n[k] * n[k];
                m[6 + k] += angle * n[k];
            }
            m[3] += angle * n[0] * n[1];
            m[4] += angle * n[0] * n[2];
            m[5] += angle * n[1] * n[2];
        }
    }
}

/* Computes a vertex's spoke: the shortest vector whose dot product with each adjacent normal is
 * -1, in the least-squares sense. */
static void spoke_from_normals(const double sum[9], double spoke[3])
{
    double a[3][3] = {{sum[0], sum[3], sum[4]}, {sum[3], sum[1], sum[5]}, {sum[4], sum[5], sum[2]}};
    const double whole = sum[0] + sum[1] + sum[2];
    double v[3][3];

    /* Compute eigenvalues (diagonal of a) and eigenvectors (columns of v) of a symmetric matrix by
     * Jacobi rotations, until they no longer change */
    bool changes = true;

    memset(v, 0, 9 * sizeof **v);
    v[0][0] = v[1][1] = v[2][2] = 1;
    for (int sweep = 0; sweep < 30 && changes; sweep++) {
        double before[3] = {a[0][0], a[1][1], a[2][2]}, axes[3][3];

        memcpy(axes, v, sizeof axes);
        for (int p = 0; p < 2; p++) {
            for (int q = p + 1; q < 3; q++) {
                double theta = 0.5 * portable_atan2(2 * a[p][q], a[q][q] - a[p][p]);
                double c = portable_cos(theta), s = portable_sin(theta);

                /* Rotates in the plane of p and q by the angle that makes a[p][q] zero: columns,
                 * then rows and eigenvectors */
                for (int k = 0; k < 3; k++) {
                    double x = a[k][p], y = a[k][q];

                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < 3; k++) {
                    double x = a[p][k], y = a[q][k];

                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                    x = v[k][p];
                    y = v[k][q];
                    v[k][p] = c * x - s * y;
                    v[k][q] = s * x + c * y;
                }
            }
        }
        changes = before[0] != a[0][0] || before[1] != a[1][1] || before[2] != a[2][2] ||
                  memcmp(axes, v, sizeof axes) != 0;
    }

    spoke[0] = spoke[1] = spoke[2] = 0;
    for (int i = 0; i < 3; i++) {
        double part = 0;

        for (int k = 0; k < 3; k++) {
            part += v[k][i] * sum[6 + k];
        }
        for (int k = 0; k < 3 && a[i][i] > FLAT * whole; k++) {
            spoke[k] -= part / a[i][i] * v[k][i];
        }
    }
}

/* Finds a surface point with a squared distance to p below limit2: the nearest point in the first
 * BALL_LEAVES leaves of a search that visits nearer boxes first. At the middle of a ball all
 * points are equally near, and any of them is right. Returns false if there is none. */
static bool surface_find_near(const struct solid *s, const double p[3], double limit2,
                              double near[3])
{
    struct {
        const struct tree_node *node;
        double distance2;
    } stack[TREE_DEPTH_MAX];
    int top = 0, leaves = 0;
    bool found = false;

    /* Depth-first search with a stack of boxes and distances */
    stack[top].node = s->faces.node;
    stack[top++].distance2 = box_distance2(&s->faces.node->box, p);
    while (top > 0 && leaves < BALL_LEAVES) {
        const struct tree_node *node = stack[--top].node;

        if (stack[top].distance2 >= limit2) {
            continue;
        }

        /* Inner node: pushes the farther child first, so that the nearer one is visited first */
        if (node->count == 0) {
            const struct tree_node *left = node + 1, *child[2] = {left, left + left->size};
            double d[2] = {box_distance2(&child[0]->box, p), box_distance2(&child[1]->box, p)};
            int far = d[0] <= d[1];

            for (int i = 0; i < 2; ++i, far = !far) {
                stack[top].node = child[far];
                stack[top++].distance2 = d[far];
            }
            continue;
        }

        /* Leaf: a nearer point reduces the search distance */
        leaves++;
        for (int i = 0; i < node->count; i++) {
            double point[3], to[3], d2;

            solid_nearest_of_face(s, s->faces.item[node->first + i], p, point);
            vec3_sub(p, point, to);
            d2 = vec3_dot(to, to);
            if (d2 < limit2) {
                memcpy(near, point, sizeof point);
                limit2 = d2;
                found = true;
            }
        }
    }
    return found;
}

/* Returns the depth at a spoke's end, m: how far a ball that touches the sides around the vertex
 * can move along the spoke. The ball shrinks until no surface point is nearer to its center than
 * those sides. Returns 0 if the spoke leaves a side too slowly. */
static double spoke_find_depth(const struct field_builder *b, size_t vertex)
{
    const struct solid *s = b->solid;
    const double *at = s->vertex[vertex], *spoke = b->spoke[vertex];
    const double least = b->least[vertex], square = vec3_dot(spoke, spoke);
    double depth = DBL_MAX;

    if (least < STEEP * sqrt(square)) {
        return 0;
    }

    /* No ball inside is wider than the solid */
    for (int k = 0; k < 3; k++) {
        depth = fmin(depth, 0.5 * (s->box.high[k] - s->box.low[k]) / least);
    }
    for (int step = 0; step < BALL_STEPS; step++) {
        double near[3], center[3], to[3], radius = least * depth, ahead, room, root;

        /* A ball without surface points fits if its center is inside the solid */
        vec3_add_scaled(at, depth, spoke, center);
        if (!surface_find_near(s, center, ROOM * radius * radius, near)) {
            if (solid_depth(s, center, 8 * s->radius) > 0) {
                return depth;
            }
            depth /= 2;
            continue;
        }

        /* Depth t at which the nearest point is as far from the center as the adjacent sides: |at
         * - point|^2 + 2 t spoke . (at - point) + t^2 (spoke^2 - least^2) = 0 */
        vec3_sub(at, near, to);
        ahead = -vec3_dot(spoke, to);
        room = square - least * least;
        root = ahead * ahead - room * vec3_dot(to, to);
        if (ahead <= 0 || root < 0) {
            depth /= 2;
            continue;
        }
        depth = fmin(0.999999 * depth, vec3_dot(to, to) / (ahead + sqrt(root)));
    }
    return 0.5 * depth;
}

/* Computes spokes, smallest speeds and end depths for all vertices. On ERROR_MEMORY, field_make
 * frees the arrays. */
static enum error_code field_find_spokes(struct field_builder *b)
{
    double(*sum)[9] = calloc(b->nvertex, sizeof *sum);

    b->spoke = calloc(b->nvertex, sizeof *b->spoke);
    b->least = calloc(b->nvertex, sizeof *b->least);
    b->depth = calloc(b->nvertex, sizeof *b->depth);
    if (!sum || !b->spoke || !b->least || !b->depth) {
        free(sum);
        return field_no_memory(b);
    }
    field_sum_normals(b, sum);
    for (size_t v = 0; v < b->nvertex; v++) {
        spoke_from_normals(sum[v], b->spoke[v]);
    }
    free(sum);

    /* Compute for each vertex the smallest speed at which its spoke leaves an adjacent side */
    const struct solid *s = b->solid;

    for (size_t v = 0; v < b->nvertex; v++) {
        b->least[v] = DBL_MAX;
    }
    for (size_t f = 0; f < s->nface; f++) {
        for (int i = 0; i < 3; i++) {
            int v = s->face[f][i];

            b->least[v] = fmin(b->least[v], -vec3_dot(s->normal[f], b->spoke[v]));
        }
    }
    for (size_t v = 0; v < b->nvertex; v++) {
        b->depth[v] = spoke_find_depth(b, v);
    }
    return ERROR_NONE;
}

/* ---- layers ---- */

/* Computes the nodes along the spokes on all layers, their depths, and the innermost point. */
static enum error_code field_make_nodes(struct field_builder *b, struct field *field)
{
    const size_t n = b->nvertex;
    double *inmost;

    field->nvertex = n;

    /* Choose the number of layers. Each layer is as thick as all layers above it; the number
     * makes the first one about as thick as the triangles are wide. */
    const struct solid *s = b->solid;
    double width = 0, depth = 0;
    int layers = 1;

    for (size_t f = 0; f < s->nface; f++) {
        double edge[3];

        vec3_sub(s->vertex[s->face[f][1]], s->vertex[s->face[f][0]], edge);
        width += vec3_norm(edge) / (double)s->nface;
    }
    for (size_t v = 0; v < b->nvertex; v++) {
        depth += b->depth[v] / (double)b->nvertex;
    }
    while (layers < FIELD_MAX_LAYERS && depth > 2 * width) {
        depth /= 2;
        layers++;
    }
    field->nlayer = layers;
    b->node = arena_alloc(b->arena, (size_t)(field->nlayer + 1) * n + 1, sizeof *b->node);
    if (!b->node) {
        return field_no_memory(b);
    }
    field->node = (const double(*)[4])b->node;

    /* The depth doubles from layer to layer; the innermost point is the mean of the spokes'
     * ends */
    inmost = b->node[(size_t)(field->nlayer + 1) * n];
    for (size_t v = 0; v < n; v++) {
        for (int layer = 0; layer <= field->nlayer; layer++) {
            double *node = b->node[(size_t)layer * n + v];
            double part = layer == 0 ? 0 : ldexp(1, layer - field->nlayer);

            node[3] = part * b->depth[v];
            vec3_add_scaled(b->solid->vertex[v], node[3], b->spoke[v], node);
            for (int k = 0; k < 4 && layer == field->nlayer; k++) {
                inmost[k] += node[k] / (double)n;
            }
            field->deepest = fmax(field->deepest, node[3]);
        }
    }
    return ERROR_NONE;
}

/* Checks whether a tetrahedron has a volume above rounding. */
static bool tetrahedron_is_solid(const double *const node[6], const int corner[4])
{
    double to[3][3], across[3], volume, whole;

    for (int i = 0; i < 3; i++) {
        vec3_sub(node[corner[i + 1]], node[corner[0]], to[i]);
    }
    vec3_cross(to[1], to[2], across);
    volume = vec3_dot(to[0], across);
    whole = vec3_dot(to[0], to[0]) * vec3_dot(to[1], to[1]) * vec3_dot(to[2], to[2]);
    return volume * volume > FIELD_NO_VOLUME * whole;
}

/* Computes the box about a prism. Returns false when it has no volume. */
static bool prism_find_box(const struct field *field, int cell, struct box *box)
{
    struct field_prism prism;
    bool solid = false;

    field_find_prism(field, cell, &prism);
    *box = box_of_point(prism.node[0]);
    for (int i = 1; i < prism.nnode; i++) {
        box_add(box, prism.node[i]);
    }
    for (int i = 0; i + 4 <= prism.nnode; i++) {
        solid = solid || tetrahedron_is_solid(prism.node, field_tetrahedron[i]);
    }
    return solid;
}

/* Checks whether the ends of the spokes leave a core whose whole surface is visible from the
 * innermost point. Otherwise the ends meet in a sheet in the middle of the solid, or leave pockets
 * around it. Then tetrahedra to one point would only cancel each other. */
static bool field_has_core(const struct field *field)
{
    const int nface = (int)field->solid->nface;
    double out = 0, in = 0;

    for (int f = 0; f < nface; f++) {
        struct field_prism prism;
        double to[3][3], across[3], volume;

        field_find_prism(field, field->nlayer * nface + f, &prism);
        for (int i = 0; i < 3; i++) {
            vec3_sub(prism.node[i], prism.node[3], to[i]);
        }
        vec3_cross(to[1], to[2], across);
        volume = prism.sign * vec3_dot(to[0], across);
        out += volume > 0 ? volume : 0;
        in -= volume < 0 ? volume : 0;
    }
    return in < CORE * out;
}

/* Builds the tree over the shell's cells that have volume: prisms and, if there is a core, its
 * tetrahedra. */
static enum error_code field_make_tree(struct field_builder *b, struct field *field)
{
    const size_t layers = (size_t)(field->nlayer + field_has_core(field));
    const size_t most = layers * field->solid->nface;
    struct box *box = malloc(most * sizeof *box);
    int *cell = arena_alloc(b->arena, most, sizeof *cell);
    enum error_code code = ERROR_NONE;
    size_t n = 0;

    if (!box || !cell) {
        code = field_no_memory(b);
        goto done;
    }

    /* Skips cells without volume */
    for (size_t i = 0; i < most; i++) {
        if (prism_find_box(field, (int)i, &box[n])) {
            cell[n++] = (int)i;
        }
    }
    field->cell = cell;
    if (n > 0) {
        code = tree_build(box, n, 1, b->arena, &field->tree, b->error);
    }

done:
    free(box);
    return code;
}

enum error_code field_make(const struct solid *solid, const char *name, struct arena *arena,
                           struct field *field, struct error *error)
{
    struct field_builder b = {
        .solid = solid, .nvertex = solid->nvertex, .name = name, .arena = arena, .error = error};
    enum error_code code;

    /* A convex solid with few sides needs only its planes */
    *field = (struct field){.solid = solid};
    if (solid->convex && solid->nfacet <= FIELD_MAX_PLANES) {
        field->planar = true;

        /* The largest depth of a convex solid is the radius of the largest ball in it. Four sides
         * touch that ball, so try all combinations of four sides. */
        const int n = (int)solid->nfacet;
        double deepest = 0;

        for (int i = 0; i < n; i++) {
            for (int j = i + 1; j < n; j++) {
                for (int k = j + 1; k < n; k++) {
                    for (int l = k + 1; l < n; l++) {
                        deepest =
                            fmax(deepest, sides_common_depth(solid, (const int[4]){i, j, k, l}));
                    }
                }
            }
        }
        field->deepest = deepest;
        return ERROR_NONE;
    }

    /* Any other solid gets a shell */
    code = field_find_spokes(&b);
    if (code == ERROR_NONE) {
        code = field_make_nodes(&b, field);
    }
    if (code == ERROR_NONE) {
        code = field_make_tree(&b, field);
    }
    free(b.spoke);
    free(b.least);
    free(b.depth);
    return code;
}
