/* SPDX-License-Identifier: Apache-2.0 */
/* The foot meshes: what the generator writes is what is committed, and it is a foot (COMAN's in all
 * detail, WALK-MAN's by what differs). */
#include "contact/mesh/mesh.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "tests/unit/arena_fixture.h"
#include "tests/physics/near.h"
#include "tests/test.h"

#define SOLE_Z (-0.0932)

/* The published outline of the right sole (xy in the ankle frame). */
static const double outline[21][2] = {
    {-0.06, -0.023},   {-0.055, -0.0328}, {-0.05, -0.0387},  {-0.0409, -0.0434}, {-0.028, -0.045},
    {0.068, -0.045},   {0.082, -0.0418},  {0.0952, -0.0362}, {0.1081, -0.0285},  {0.1186, -0.0193},
    {0.1269, -0.0045}, {0.1299, 0.0071},  {0.1299, 0.0206},  {0.1272, 0.0308},   {0.1245, 0.0349},
    {0.1183, 0.0408},  {0.1055, 0.045},   {-0.035, 0.045},   {-0.0462, 0.0408},  {-0.0559, 0.0308},
    {-0.06, 0.0192},
};

static const struct mesh *read_mesh(const char *name)
{
    char path[512];
    const struct mesh *mesh = NULL;
    struct error error = {0};

    snprintf(path, sizeof path, "%s/config/meshes/%s.obj", HIL_SOURCE_DIR, name);
    if (mesh_read_obj(path, &arena, &mesh, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    return mesh;
}

static const struct mesh *read_foot(const char *side)
{
    return read_mesh(strcmp(side, "right") == 0 ? "coman-foot-right" : "coman-foot-left");
}

static double outline_area(void)
{
    double twice = 0;

    for (int i = 0; i < 21; i++) {
        const double *a = outline[i], *b = outline[(i + 1) % 21];

        twice += a[0] * b[1] - b[0] * a[1];
    }
    return twice / 2;
}

/* Signed area of a face seen from above, times its longest edges' measure of shape: 1 for an
 * equilateral triangle. */
static double flat_area(const struct mesh *mesh, size_t f, double *quality)
{
    const double *p[3];
    double edges = 0, area;

    for (int i = 0; i < 3; i++) {
        p[i] = mesh->vertex[mesh->face[f][i]];
    }
    for (int i = 0; i < 3; i++) {
        const double *a = p[i], *b = p[(i + 1) % 3];

        edges += (b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]);
    }
    area =
        ((p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0])) / 2;
    *quality = 4 * sqrt(3) * fabs(area) / edges;
    return area;
}

static bool in_sole(const struct mesh *mesh, size_t f)
{
    for (int i = 0; i < 3; i++) {
        if (mesh->vertex[mesh->face[f][i]][2] != SOLE_Z) {
            return false;
        }
    }
    return true;
}

TEST(generator_writes_the_committed_files_byte_for_byte)
{
    static const char *const foot[][2] = {
        {"coman", "right"}, {"coman", "left"}, {"walkman", "right"}, {"walkman", "left"}};

    for (size_t s = 0; s < sizeof foot / sizeof foot[0]; s++) {
        char command[1024], path[512], made[4096], kept[4096];
        FILE *generator, *file;
        size_t n;

        snprintf(command, sizeof command, "'%s' %s %s", FOOT_MESH, foot[s][0], foot[s][1]);
        snprintf(path, sizeof path, "%s/config/meshes/%s-foot-%s.obj", HIL_SOURCE_DIR, foot[s][0],
                 foot[s][1]);
        generator = popen(command, "r");
        file = fopen(path, "r");
        assert_non_null(generator);
        assert_non_null(file);
        do {
            n = fread(made, 1, sizeof made, generator);
            assert_int_equal(fread(kept, 1, sizeof kept, file), n);
            assert_memory_equal(made, kept, n);
        } while (n > 0);
        assert_int_equal(pclose(generator), 0);
        fclose(file);
    }
}

TEST(generator_refuses_other_words_with_exit_code_2)
{
    char command[1024];
    FILE *generator;

    snprintf(command, sizeof command, "'%s' coman both 2>&1", FOOT_MESH);
    generator = popen(command, "r");
    assert_non_null(generator);
    assert_int_not_equal(fgetc(generator), EOF);
    while (fgetc(generator) != EOF) {
    }
    assert_int_equal(pclose(generator), 2 << 8);
}

TEST(a_foot_has_504_faces_and_is_closed)
{
    /* The reader has refused whatever is not closed, manifold and outward */
    assert_int_equal(read_foot("right")->nface, 504);
    assert_int_equal(read_foot("left")->nface, 504);
}

TEST(sole_tiles_the_published_outline)
{
    const struct mesh *foot = read_foot("right");
    double area = 0, largest = 0, worst = 1, sum = 0, quality;
    int faces = 0;

    for (size_t f = 0; f < foot->nface; f++) {
        if (in_sole(foot, f)) {
            double down = -flat_area(foot, f, &quality);

            assert_true(down > 0); /* none folds over: together they tile */
            area += down;
            largest = fmax(largest, down);
            worst = fmin(worst, quality);
            sum += quality;
            faces++;
        }
    }
    assert_near(area, outline_area(), 1e-15);
    assert_near(area, 0.0157, 5e-5); /* the published figure */
    assert_true(largest < 0.01 * area);
    assert_true(worst > 0.3);
    assert_true(sum / faces > 0.75);
}

TEST(sole_centroids_integrate_pressure_as_the_outline_does)
{
    const struct mesh *foot = read_foot("right");
    double moment[2] = {0, 0}, exact[2] = {0, 0}, quality;

    for (int i = 0; i < 21; i++) {
        const double *a = outline[i], *b = outline[(i + 1) % 21];
        double part = (a[0] * b[1] - b[0] * a[1]) / 6;

        exact[0] += part * (a[0] + b[0]);
        exact[1] += part * (a[1] + b[1]);
    }
    for (size_t f = 0; f < foot->nface; f++) {
        if (in_sole(foot, f)) {
            double area = -flat_area(foot, f, &quality);

            for (int c = 0; c < 3; c++) {
                moment[0] += area * foot->vertex[foot->face[f][c]][0] / 3;
                moment[1] += area * foot->vertex[foot->face[f][c]][1] / 3;
            }
        }
    }
    assert_near(moment[0], exact[0], 1e-17);
    assert_near(moment[1], exact[1], 1e-17);
}

TEST(only_the_sole_is_within_a_centimeter_of_the_floor)
{
    const struct mesh *foot = read_foot("right");

    for (size_t f = 0; f < foot->nface; f++) {
        double z = 0;

        for (int c = 0; c < 3; c++) {
            z += foot->vertex[foot->face[f][c]][2] / 3;
        }
        assert_true(in_sole(foot, f) || z > SOLE_Z + 0.01);
    }
}

TEST(the_left_foot_mirrors_the_right_one)
{
    const struct mesh *right = read_foot("right"), *left = read_foot("left");

    assert_int_equal(left->nvertex, right->nvertex);
    for (size_t v = 0; v < right->nvertex; v++) {
        assert_true(left->vertex[v][0] == right->vertex[v][0]);
        assert_true(left->vertex[v][1] == -right->vertex[v][1]);
        assert_true(left->vertex[v][2] == right->vertex[v][2]);
    }
    for (size_t f = 0; f < right->nface; f++) {
        assert_int_equal(left->face[f][0], right->face[f][0]);
        assert_int_equal(left->face[f][1], right->face[f][2]);
        assert_int_equal(left->face[f][2], right->face[f][1]);
    }
    assert_near(mesh_volume(left), mesh_volume(right), 1e-18);
}

TEST(volume_is_that_of_the_two_frustums)
{
    /* The outline's area A at the sole, 0.81 A halfway, 0.64 A at the top, 0.0316 m apart:
     * h/3 (A1 + A2 + sqrt(A1 A2)) for each, to the micrometer that vertices are rounded to */
    double a = outline_area(), h = 0.0316;
    double expected = h / 3 * a * ((1 + 0.81 + 0.9) + (0.81 + 0.64 + 0.72));

    assert_near(mesh_volume(read_foot("right")), expected, 1e-4 * expected);
}

/* 0.306 m by 0.16 m, from 0.111 m behind the ankle and 0.09 m outward of it, 0.1435 m below */
TEST(the_sole_of_walkman_is_its_rectangle)
{
    const struct mesh *foot = read_mesh("walkman-foot-right");
    double area = 0, moment[2] = {0, 0}, quality;

    assert_int_equal(foot->nface, 504);
    for (size_t f = 0; f < foot->nface; f++) {
        const int *face = foot->face[f];
        bool sole = true;
        double down;

        for (int c = 0; c < 3; c++) {
            sole = sole && foot->vertex[face[c]][2] == -0.1435;
        }
        if (!sole) {
            continue;
        }
        down = -flat_area(foot, f, &quality);
        assert_true(down > 0);
        area += down;
        for (int m = 0; m < 2; m++) {
            moment[m] +=
                down / 3 *
                (foot->vertex[face[0]][m] + foot->vertex[face[1]][m] + foot->vertex[face[2]][m]);
        }
    }
    assert_near(area, 0.306 * 0.16, 1e-15);
    assert_near(moment[0], 0.306 * 0.16 * 0.042, 1e-16);
    assert_near(moment[1], 0.306 * 0.16 * -0.01, 1e-16);
}

TEST_GROUP(open_arena, close_arena)
