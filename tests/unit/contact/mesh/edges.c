/* SPDX-License-Identifier: Apache-2.0 */
/* Half-edges being sorted, against the order by comparison. */
#include "contact/mesh/mesh.h"

#include "tests/unit/arena_fixture.h"

/* By low vertex, high vertex, number. */
static int compare(const struct half_edge *x, const struct half_edge *y)
{
    return x->low != y->low     ? x->low - y->low
           : x->high != y->high ? x->high - y->high
                                : x->number - y->number;
}

/* Each half-edge of the mesh is there once, as the mesh has it, and in order. */
static void assert_sorted(const struct mesh *mesh)
{
    const size_t n = 3 * mesh->nface;
    struct half_edge *edge = arena_alloc(&arena, n, sizeof *edge);
    bool *seen = arena_alloc(&arena, n, sizeof *seen);

    assert_true(edge && seen);
    assert_ok(mesh_sort_half_edges(mesh, edge, NULL));
    for (size_t i = 0; i < n; i++) {
        const struct half_edge *e = &edge[i];
        const int *face = mesh->face[e->number / 3];

        assert_false(seen[e->number]);
        seen[e->number] = true;
        assert_int_equal(e->forward ? e->low : e->high, face[e->number % 3]);
        assert_int_equal(e->forward ? e->high : e->low, face[(e->number + 1) % 3]);
        assert_true(e->low < e->high);
        assert_true(i == 0 || compare(&edge[i - 1], e) < 0);
    }
}

TEST_WITH(half_edges_of_boxes_are_sorted, open_arena, close_arena)
{
    const double half[3] = {1, 2, 3};
    const struct mesh *mesh;

    for (int cells = 1; cells < 9; cells++) {
        assert_ok(mesh_box(half, cells, &arena, &mesh, NULL));
        assert_sorted(mesh);
    }
}

/* Two hubs at the ends of a spindle, whose vertices are numbered first and last, or both first. */
TEST_WITH(half_edges_around_hubs_are_sorted, open_arena, close_arena)
{
    enum { RIM = 200 };
    static const double vertex[RIM + 2][3];

    for (int last = 0; last < 2; last++) {
        int face[2 * RIM][3];

        for (int i = 0; i < RIM; i++) {
            int first = last ? 1 : 2, hub = last ? RIM + 1 : 1;
            int a = first + i, b = first + (i + 1) % RIM;
            int faces[2][3] = {{0, b, a}, {a, b, hub}};

            for (int k = 0; k < 6; k++) {
                face[2 * i + k / 3][k % 3] = faces[k / 3][k % 3];
            }
        }
        assert_sorted(&(struct mesh){.name = "spindle",
                                     .nvertex = RIM + 2,
                                     .nface = 2 * RIM,
                                     .vertex = vertex,
                                     .face = (const int(*)[3])face});
    }
}
