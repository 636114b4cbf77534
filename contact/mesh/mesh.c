/* SPDX-License-Identifier: Apache-2.0 */
/* Memory and volume of triangle meshes, and the box as a mesh. */
#include "contact/mesh/mesh.h"
#include "base/vec3.h"

#include <string.h>

struct mesh *mesh_alloc(const char *name, size_t nvertex, size_t nface, struct arena *arena,
                        double (**vertex)[3], int (**face)[3], struct error *error)
{
    struct mesh *mesh = arena_alloc(arena, 1, sizeof *mesh);
    const char *copy = arena_strdup(arena, name);

    *vertex = arena_alloc(arena, nvertex, sizeof **vertex);
    *face = arena_alloc(arena, nface, sizeof **face);
    if (!mesh || !copy || !*vertex || !*face) {
        error_set(error, ERROR_MEMORY, "%s: no memory for %zu faces", name, nface);
        return NULL;
    }
    *mesh = (struct mesh){copy, nvertex, nface, (const double(*)[3]) * vertex,
                          (const int(*)[3]) * face};
    return mesh;
}

const struct mesh *mesh_copy(const struct mesh *mesh, struct arena *arena, struct error *error)
{
    double(*vertex)[3];
    int(*face)[3];
    struct mesh *copy =
        mesh_alloc(mesh->name, mesh->nvertex, mesh->nface, arena, &vertex, &face, error);

    if (copy) {
        memcpy(vertex, mesh->vertex, mesh->nvertex * sizeof *vertex);
        memcpy(face, mesh->face, mesh->nface * sizeof *face);
    }
    return copy;
}

double mesh_volume(const struct mesh *mesh)
{
    double six = 0;

    /* Tetrahedra from one vertex, to avoid cancellation when the mesh is far from the origin */
    for (size_t f = 0; f < mesh->nface; f++) {
        const int *corner = mesh->face[f];
        const double *at = mesh->vertex[corner[0]];
        double e1[3], e2[3], normal[3], from[3];

        vec3_sub(mesh->vertex[corner[1]], at, e1);
        vec3_sub(mesh->vertex[corner[2]], at, e2);
        vec3_cross(e1, e2, normal);
        vec3_sub(at, mesh->vertex[0], from);
        six += vec3_dot(from, normal);
    }
    return six / 6;
}

/* ---- the box ---- */

/* Returns the number of a box's lattice point; 0 <= at[] <= n, and at least one coordinate is 0 or
 * n. Order: bottom, top, then the layers between them, each around its rim. */
static int mesh_box_vertex_number(int n, const int at[3])
{
    int i = at[0], j = at[1], k = at[2];
    int rim, side = n + 1;

    if (k == 0) {
        return i * side + j;
    }
    if (k == n) {
        return side * side + i * side + j;
    }
    if (j == 0) {
        rim = i;
    } else if (i == n) {
        rim = n + j;
    } else if (j == n) {
        rim = 3 * n - i;
    } else {
        rim = 4 * n - j;
    }
    return 2 * side * side + (k - 1) * 4 * n + rim;
}

/* Computes the vertices of a box with half extents half (m) and n cells per edge. */
static void mesh_box_place_vertices(const double half[3], int n, double (*vertex)[3])
{
    for (int i = 0; i <= n; i++) {
        for (int j = 0; j <= n; j++) {
            bool rim = i == 0 || i == n || j == 0 || j == n;

            for (int k = 0; k <= n; k += rim ? 1 : n) {
                int at[3] = {i, j, k};
                double *v = vertex[mesh_box_vertex_number(n, at)];

                /* Exactly symmetric about 0 */
                for (int axis = 0; axis < 3; axis++) {
                    v[axis] = half[axis] * (2 * at[axis] - n) / n;
                }
            }
        }
    }
}

/* Writes the two triangles of one cell of the side whose outward normal is sign * axis. */
static void mesh_box_add_cell(int n, int axis, int sign, int u, int v, int (*face)[3])
{
    static const int step[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    int corner[4];

    for (int c = 0; c < 4; c++) {
        /* A negative side is walked in the opposite direction, so that it is counterclockwise from
         * outside */
        int s = sign > 0 ? c : 3 - c;
        int at[3];

        at[axis] = sign > 0 ? n : 0;
        at[(axis + 1) % 3] = u + step[s][0];
        at[(axis + 2) % 3] = v + step[s][1];
        corner[c] = mesh_box_vertex_number(n, at);
    }
    memcpy(face[0], (int[3]){corner[0], corner[1], corner[2]}, sizeof face[0]);
    memcpy(face[1], (int[3]){corner[0], corner[2], corner[3]}, sizeof face[1]);
}

enum error_code mesh_box(const double half_extent[3], int cells, struct arena *arena,
                         const struct mesh **mesh, struct error *error)
{
    size_t n = (size_t)cells, next = 0;
    double(*vertex)[3];
    int(*face)[3];
    struct mesh *box = mesh_alloc("box", 6 * n * n + 2, 12 * n * n, arena, &vertex, &face, error);

    if (!box) {
        return ERROR_MEMORY;
    }

    /* Vertices, then the cells of each side */
    mesh_box_place_vertices(half_extent, cells, vertex);
    for (int axis = 0; axis < 3; axis++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            for (int cell = 0; cell < cells * cells; cell++) {
                mesh_box_add_cell(cells, axis, sign, cell / cells, cell % cells, face + next);
                next += 2;
            }
        }
    }
    *mesh = box;
    return ERROR_NONE;
}
