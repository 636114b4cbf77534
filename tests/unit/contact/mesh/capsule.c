/* SPDX-License-Identifier: Apache-2.0 */
/* The capsule as a mesh: sound, and as large as the capsule. */
#include "contact/mesh/mesh.h"

#include "tests/physics/near.h"
#include "tests/unit/arena_fixture.h"

TEST(encloses_what_the_capsule_does)
{
    const double length[] = {0, 1e-6, 0.01, 0.18}, R = 0.06, pi = 3.14159265358979323846;

    for (int i = 0; i < 4; i++) {
        const struct mesh *mesh;
        struct mesh_finding finding;
        double side = pi * R * R * length[i], ends = 4 * pi * R * R * R / 3;

        assert_ok(mesh_capsule(R, length[i], false, &arena, &mesh, NULL));
        assert_int_equal(mesh->nface, 256);
        assert_ok(mesh_check(mesh, &finding, NULL));
        assert_int_equal(finding.fault, MESH_SOUND);
        assert_near(mesh_volume(mesh), side + 0.975 * ends, 1e-3 * (side + ends));
        for (size_t v = 0; v < mesh->nvertex; v++) {
            const double *p = mesh->vertex[v];
            double beyond = fmax(fabs(p[2]) - length[i] / 2, 0);

            assert_near(sqrt(p[0] * p[0] + p[1] * p[1] + beyond * beyond), R, 0.014 * R);
        }
    }
}

TEST(cylinder_mesh_has_the_volume_of_a_round_cylinder)
{
    const double length[] = {0.01, 0.3}, R = 0.06, pi = 3.14159265358979323846;

    for (int i = 0; i < 2; i++) {
        const struct mesh *mesh;
        struct mesh_finding finding;

        assert_ok(mesh_capsule(R, length[i], true, &arena, &mesh, NULL));
        assert_ok(mesh_check(mesh, &finding, NULL));
        assert_int_equal(finding.fault, MESH_SOUND);
        assert_near(mesh_volume(mesh), pi * R * R * length[i], 1e-12);
        for (size_t v = 0; v < mesh->nvertex - 2; v++) {
            const double *p = mesh->vertex[v];

            assert_near(sqrt(p[0] * p[0] + p[1] * p[1]), R, 0.0009 * R);
            assert_near(fabs(p[2]), length[i] / 2, 1e-15);
        }
    }
}

TEST(reports_an_arena_that_is_used_up)
{
    struct arena small CLOSED_BY(arena_fini);
    const struct mesh *mesh;
    struct error error;

    assert_ok(arena_init(&small, 4096, &error));
    assert_int_equal(mesh_capsule(1, 1, false, &small, &mesh, &error), ERROR_MEMORY);
}

TEST_GROUP(open_arena, close_arena)
