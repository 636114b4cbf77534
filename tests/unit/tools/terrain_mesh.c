/* SPDX-License-Identifier: Apache-2.0 */
/* Ground meshes: what the generator writes is what is committed, and has the measures asked for. */
#include "contact/mesh/mesh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "tests/physics/near.h"
#include "tests/unit/arena_fixture.h"
#include "tests/test.h"

enum { TEXT = 1 << 20 };

static const double degrees = 57.295779513082323;

/* What the generator writes for some arguments, and its exit status. */
static const char *generate(const char *arguments, size_t *size, int *status)
{
    static char text[TEXT];
    char command[1024];
    FILE *generator;

    snprintf(command, sizeof command, "'%s' %s 2>&1", TERRAIN_MESH, arguments);
    generator = popen(command, "r");
    assert_non_null(generator);
    *size = fread(text, 1, sizeof text - 1, generator);
    text[*size] = '\0';
    *status = pclose(generator) / 256;
    return text;
}

/* The same as a mesh, which the reader has found sound. */
static const struct mesh *make(const char *arguments)
{
    const struct mesh *mesh = NULL;
    struct error error = {0};
    size_t size = 0;
    int status = 0;
    const char *text = generate(arguments, &size, &status);

    assert_int_equal(status, 0);
    if (mesh_read_obj_text("terrain", text, size, &arena, &mesh, &error) != ERROR_NONE) {
        fail_msg("%s", error.text);
    }
    return mesh;
}

static double highest(const struct mesh *mesh)
{
    double z = -HUGE_VAL;

    for (size_t v = 0; v < mesh->nvertex; v++) {
        z = fmax(z, mesh->vertex[v][2]);
    }
    return z;
}

/* Normal of a face, as long as twice its area. */
static void face_normal(const struct mesh *mesh, size_t f, double n[3])
{
    double u[3], v[3];

    vec3_sub(mesh->vertex[mesh->face[f][1]], mesh->vertex[mesh->face[f][0]], u);
    vec3_sub(mesh->vertex[mesh->face[f][2]], mesh->vertex[mesh->face[f][0]], v);
    vec3_cross(u, v, n);
}

static double face_middle(const struct mesh *mesh, size_t f, int axis)
{
    return (mesh->vertex[mesh->face[f][0]][axis] + mesh->vertex[mesh->face[f][1]][axis] +
            mesh->vertex[mesh->face[f][2]][axis]) /
           3;
}

/* The share of a shape's plan (0 < x < length, |y| < half) with slopes up to a limit. */
static double share_up_to(const struct mesh *mesh, double length, double half, double limit_deg)
{
    double within = 0, all = 0;

    for (size_t f = 0; f < mesh->nface; f++) {
        double n[3], x = face_middle(mesh, f, 0), y = face_middle(mesh, f, 1);

        face_normal(mesh, f, n);
        if (n[2] > 1e-9 && x > 0 && x < length && fabs(y) < half) {
            all += n[2];
            within += atan2(hypot(n[0], n[1]), n[2]) * degrees <= limit_deg ? n[2] : 0;
        }
    }
    return within / all;
}

/* ---- the files in config/meshes ---- */

static const struct {
    const char *name, *arguments;
} kept[] = {
    {"bump-3cm", "bump --height 0.03 --side-slope 3 --rough 0.03 --seed 1"},
    {"bump-9cm", "bump --height 0.09 --side-slope 9 --rough 0.015 --seed 3"},
    {"ramp-5deg", "ramp --height 0.1 --length 3 --slope 5"},
};

TEST(generator_writes_the_committed_files_byte_for_byte)
{
    static char file[TEXT];

    for (size_t i = 0; i < sizeof kept / sizeof kept[0]; i++) {
        char path[512];
        size_t size = 0, length;
        int status = 0;
        const char *made = generate(kept[i].arguments, &size, &status);
        FILE *stream;

        snprintf(path, sizeof path, "%s/config/meshes/%s.obj", HIL_SOURCE_DIR, kept[i].name);
        stream = fopen(path, "r");
        assert_non_null(stream);
        length = fread(file, 1, sizeof file, stream);
        fclose(stream);
        assert_int_equal(status, 0);
        assert_int_equal(length, size);
        assert_memory_equal(file, made, size);
    }
}

/* As steep as the ground of the paper's authors, or less: half of it up to 5 degrees, 90 % up to
 * 12.5. And few triangles, by which a tick costs. */
TEST(facets_of_the_bumps_are_like_those_of_the_papers_authors)
{
    const struct mesh *low = make(kept[0].arguments), *high = make(kept[1].arguments);

    assert_near(share_up_to(low, 1.6, 0.88, 4.2), 0.5, 0.02);
    assert_near(share_up_to(high, 1.6, 0.88, 5.9), 0.5, 0.02);
    assert_true(share_up_to(low, 1.6, 0.88, 12.5) > 0.9);
    assert_true(share_up_to(high, 1.6, 0.88, 12.5) > 0.9);
    assert_true(low->nface < 1000 && high->nface < 1000);
}

/* ---- the shapes ---- */

/* H (1 - s^2)^2 (1 - t^2)^2 at all points of the grid; its side slope where it is steepest */
TEST(a_smooth_bump_is_its_polynomial)
{
    const double half = 8 / (3 * sqrt(3)) * 0.09 / tan(9 / degrees);
    const struct mesh *bump = make("bump --height 0.09 --length 1.6 --side-slope 9 --cell 0.05");
    double steepest = 0, last = 0;

    assert_near(highest(bump), 0.09, 1e-9);
    for (size_t v = 0; v < bump->nvertex; v++) {
        const double *p = bump->vertex[v];
        double s = p[0] / 0.8 - 1, t = p[1] / half, z = 0.09;

        if (p[2] < -0.1) {
            continue; /* the bottom */
        }
        z *= fabs(s) < 1 && fabs(t) < 1 ? pow((1 - s * s) * (1 - t * t), 2) : 0;
        assert_near(p[2], z, 1.1e-6);
    }
    for (double t = 0; t <= 1; t += 1e-4) {
        double z = 0.09 * pow(1 - t * t, 2);

        steepest = fmax(steepest, t > 0 ? (last - z) / (1e-4 * half) : 0);
        last = z;
    }
    assert_near(atan(steepest) * degrees, 9, 1e-3);
}

TEST(a_ramp_rises_and_falls_by_its_slope)
{
    const struct mesh *ramp = make("ramp --height 0.1 --length 3 --slope 5");
    const double run = 0.1 / tan(5 / degrees);

    assert_near(highest(ramp), 0.1, 0);
    for (size_t f = 0; f < ramp->nface; f++) {
        double n[3], x = face_middle(ramp, f, 0);

        face_normal(ramp, f, n);
        if (n[2] > 1e-9) {
            double slope = atan2(-n[0], n[2]) * degrees;
            bool up = x > 0 && x<run, down = x> 3 - run && x < 3;

            assert_near(slope, up ? 5 : down ? -5 : 0, 1e-4);
            assert_near(n[1], 0, 0);
        }
    }
}

/* Three up and three down with a top of one tread: five treads of 0.4 m, 2 cm a step */
TEST(steps_have_treads_of_one_length_and_one_rise)
{
    const struct mesh *steps = make("steps --height 0.06 --length 2 --count 3");
    double tread[4] = {0};

    for (size_t f = 0; f < steps->nface; f++) {
        double n[3], z = face_middle(steps, f, 2), x = face_middle(steps, f, 0);

        face_normal(steps, f, n);
        if (n[2] > 1e-9 && fabs(n[0]) < 1e-12 && x > 0 && x < 2) {
            int level = (int)lround(z / 0.02);

            assert_near(z, 0.02 * level, 1e-9);
            tread[level] += n[2] / 2 / 6;
        }
    }
    assert_near(tread[0], 0, 0);
    assert_near(tread[1], 2 * (0.4 - 0.005), 1e-9);
    assert_near(tread[2], 2 * (0.4 - 0.005), 1e-9);
    assert_near(tread[3], 0.4 - 2 * 0.005, 1e-9);
}

TEST(waves_are_as_many_as_asked_for)
{
    const struct mesh *waves = make("waves --height 0.03 --length 2 --count 4 --cell 0.05");

    for (size_t v = 0; v < waves->nvertex; v++) {
        const double *p = waves->vertex[v];

        if (p[2] > -0.1) {
            double in = p[0] > 0 && p[0] < 2 ? (1 - cos(4 * 3.14159265358979324 * p[0])) / 2 : 0;

            assert_near(p[2], 0.03 * in, 1.1e-6);
        }
    }
}

/* ---- chance, and what is refused ---- */

TEST(a_seed_makes_one_ground_and_another_one_another)
{
    char arguments[64];
    double height[3][8] = {{0}};

    for (int i = 0; i < 3; i++) {
        const struct mesh *mesh;

        snprintf(arguments, sizeof arguments, "waves --rough 0.02 --width 2 --seed %d", i / 2);
        mesh = make(arguments);
        assert_near(highest(mesh), 0.03, 1e-9);
        for (int v = 0; v < 8; v++) {
            height[i][v] = mesh->vertex[60 + v][2];
        }
    }
    assert_memory_equal(height[0], height[1], sizeof height[0]);
    assert_memory_not_equal(height[0], height[2], sizeof height[0]);
}

TEST(numbers_that_make_no_ground_are_refused_with_their_option)
{
    static const char *const wrong[][2] = {
        {"hill", "usage"},
        {"", "usage"},
        {"bump --heigth 0.03", "--height"},
        {"bump --height 2", "--height"},
        {"bump --height 0.3 --side-slope 3", "--side-slope"},
        {"bump --slope 5", "--slope"},
        {"ramp --height 0.1 --slope 5", "--length"},
        {"steps --count 20 --length 0.3", "--length"},
        {"waves --cell 0.005", "--cell"},
    };

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        size_t size = 0;
        int status = 0;
        const char *said = generate(wrong[i][0], &size, &status);

        assert_int_equal(status, 2);
        if (!strstr(said, wrong[i][1])) {
            fail_msg("'%s' said: %s", wrong[i][0], said);
        }
    }
}

TEST_GROUP(open_arena, close_arena)
