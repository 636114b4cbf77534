/* SPDX-License-Identifier: Apache-2.0 */
/* The box as a mesh, its measures, and what mesh_check calls sound. */
#include "contact/mesh/mesh.h"

#include <float.h>

#include "tests/unit/arena_fixture.h"
#include "tests/physics/near.h"

static struct mesh_finding check(const struct mesh *mesh)
{
    struct mesh_finding finding;

    assert_ok(mesh_check(mesh, &finding, NULL));
    return finding;
}

/* A tetrahedron with its right angle at the origin: volume 1/6. */
static const double corner[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const int side[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

static const struct mesh tetrahedron = {"tetrahedron", 4, 4, corner, side};

TEST(tetrahedron_is_sound_and_has_its_volume)
{
    assert_int_equal(check(&tetrahedron).fault, MESH_SOUND);
    assert_near(mesh_volume(&tetrahedron), 1.0 / 6, 1e-15);
}

TEST(volume_of_a_mesh_far_from_the_origin_keeps_its_digits)
{
    double far[4][3];
    struct mesh mesh = tetrahedron;

    for (int v = 0; v < 4; v++) {
        for (int i = 0; i < 3; i++) {
            far[v][i] = corner[v][i] + 524288;
        }
    }
    mesh.vertex = (const double(*)[3])far;
    assert_near(mesh_volume(&mesh), 1.0 / 6, 1e-14);
}

TEST(box_has_twelve_faces_a_square_cell_and_shares_its_vertices)
{
    const double half[3] = {0.075, 0.05, 0.02};
    const int cells[] = {1, 2, 3, 7, 32};

    for (size_t i = 0; i < sizeof cells / sizeof *cells; i++) {
        const struct mesh *box;
        size_t n = (size_t)cells[i];

        assert_ok(mesh_box(half, cells[i], &arena, &box, NULL));
        assert_int_equal(box->nface, 12 * n * n);
        assert_int_equal(box->nvertex, 6 * n * n + 2);
        assert_int_equal(check(box).fault, MESH_SOUND);
        /* Sums of nface terms: their rounding is at most nface half ulps */
        double rounding = (double)box->nface * DBL_EPSILON;
        double volume = 8 * half[0] * half[1] * half[2];

        assert_near(mesh_volume(box), volume, rounding * volume);
    }
}

TEST(box_of_seven_cells_has_the_588_faces_of_the_paper)
{
    const struct mesh *box;

    assert_ok(mesh_box((double[3]){0.075, 0.075, 0.075}, 7, &arena, &box, NULL));
    assert_int_equal(box->nface, 588);
}

TEST(every_box_face_lies_in_a_side_and_looks_outward)
{
    const double half[3] = {1, 2, 3};
    const struct mesh *box;

    assert_ok(mesh_box(half, 3, &arena, &box, NULL));
    for (size_t f = 0; f < box->nface; f++) {
        const double *p[3];
        int sides = 0;

        for (int i = 0; i < 3; i++) {
            p[i] = box->vertex[box->face[f][i]];
        }
        for (int axis = 0; axis < 3; axis++) {
            int u = (axis + 1) % 3, v = (axis + 2) % 3;
            double normal = (p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) -
                            (p[1][v] - p[0][v]) * (p[2][u] - p[0][u]);

            if (p[0][axis] == p[1][axis] && p[1][axis] == p[2][axis]) {
                assert_true(fabs(p[0][axis]) == half[axis]);
                assert_true(normal * p[0][axis] > 0);
                sides++;
            }
        }
        assert_int_equal(sides, 1);
    }
}

TEST(box_reports_an_arena_that_is_used_up)
{
    struct arena small CLOSED_BY(arena_fini);
    const struct mesh *box = NULL;
    struct error error;

    assert_ok(arena_init(&small, 4096, NULL));
    assert_int_equal(mesh_box((double[3]){1, 1, 1}, 64, &small, &box, &error), ERROR_MEMORY);
    assert_null(box);
}

TEST(names_each_fault_of_a_surface_and_its_first_face)
{
    static const double bad_coordinate[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, NAN, 0}, {0, 0, 1}};
    static const double too_far[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1e7}};
    static const double flat[4][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 0, 1}};
    static const double five[5][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {9, 9, 9}};
    /* Two tetrahedra that share a vertex, or an edge */
    static const double seven[7][3] = {{0, 0, 0},  {1, 0, 0},  {0, 1, 0}, {0, 0, 1},
                                       {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    static const int low_index[1][3] = {{0, 1, -1}}, high_index[1][3] = {{0, 1, 4}};
    static const int twice[1][3] = {{0, 1, 1}};
    static const int duplicate[5][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {3, 1, 2}};
    static const int apart[5][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {2, 0, 1}};
    static const int pillow[2][3] = {{0, 1, 2}, {0, 2, 1}};
    static const int flipped[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
    static const int inward[4][3] = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
    static const int pinched[8][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
                                      {0, 4, 5}, {0, 6, 4}, {0, 5, 6}, {4, 6, 5}};
    static const int hinge[8][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
                                    {0, 1, 5}, {0, 6, 1}, {0, 5, 6}, {1, 6, 5}};
    const struct {
        struct mesh mesh;
        enum mesh_fault fault;
        size_t face;
    } row[] = {
        {{"", 4, 0, corner, side}, MESH_EMPTY, 0},
        {{"", 4, 1, corner, low_index}, MESH_BAD_INDEX, 0},
        {{"", 4, 1, corner, high_index}, MESH_BAD_INDEX, 0},
        {{"", 4, 4, bad_coordinate, side}, MESH_BAD_COORDINATE, 0},
        {{"", 4, 4, too_far, side}, MESH_BAD_COORDINATE, 1},
        {{"", 4, 4, flat, side}, MESH_DEGENERATE_FACE, 0},
        {{"", 4, 1, corner, twice}, MESH_DEGENERATE_FACE, 0},
        {{"", 4, 5, corner, duplicate}, MESH_DUPLICATE_FACE, 4},
        {{"", 4, 5, corner, apart}, MESH_DUPLICATE_FACE, 4},
        {{"", 3, 2, corner, pillow}, MESH_DUPLICATE_FACE, 1},
        {{"", 4, 3, corner, side}, MESH_OPEN_EDGE, 0},
        {{"", 4, 4, corner, flipped}, MESH_FLIPPED_FACE, 2},
        {{"", 7, 8, seven, hinge}, MESH_NON_MANIFOLD_EDGE, 4},
        {{"", 7, 8, seven, pinched}, MESH_PINCHED_VERTEX, 4},
        {{"", 5, 4, five, side}, MESH_UNUSED_VERTEX, 0},
        {{"", 4, 4, corner, inward}, MESH_INWARD, 0},
    };

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        struct mesh_finding finding = check(&row[i].mesh);

        if (finding.fault != row[i].fault || finding.face != row[i].face) {
            fail_msg("row %zu: found '%s' at face %zu, expected '%s' at face %zu", i,
                     mesh_fault_text(finding.fault), finding.face, mesh_fault_text(row[i].fault),
                     row[i].face);
        }
    }
}

TEST(separate_closed_pieces_are_sound)
{
    static const double eight[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                       {5, 0, 0}, {6, 0, 0}, {5, 1, 0}, {5, 0, 1}};
    static const int two[8][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
                                  {4, 6, 5}, {4, 5, 7}, {4, 7, 6}, {5, 6, 7}};
    const struct mesh mesh = {"two", 8, 8, eight, two};

    assert_int_equal(check(&mesh).fault, MESH_SOUND);
    assert_near(mesh_volume(&mesh), 1.0 / 3, 1e-15);
}

TEST_GROUP(open_arena, close_arena)
