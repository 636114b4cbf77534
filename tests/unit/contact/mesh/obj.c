/* SPDX-License-Identifier: Apache-2.0 */
/* OBJ text in all the forms that are taken, and every way to be refused with its place. */
#include "contact/mesh/solid_store.h"

#include <sys/stat.h>
#include <unistd.h>

#include "tests/unit/arena_fixture.h"
#include "tests/physics/near.h"
#include "tests/mesh_write.h"

#define VERTICES "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
#define FACES "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

static const struct mesh *read_text(const char *text)
{
    const struct mesh *mesh = NULL;
    struct error error = {0};

    if (mesh_read_obj_text("a.obj", text, strlen(text), &arena, &mesh, &error) != ERROR_NONE) {
        fail_msg("%s\n%s", error.text, text);
    }
    return mesh;
}

/* The text is refused as wrong input, and the message begins with start. */
static void refused(const char *text, size_t size, const char *start)
{
    const struct mesh *mesh = NULL;
    struct error error = {0};
    size_t used = arena.used;

    if (mesh_read_obj_text("a.obj", text, size, &arena, &mesh, &error) != ERROR_INPUT ||
        strncmp(error.text, start, strlen(start)) != 0) {
        fail_msg("'%s', expected '%s'", error.text, start);
    }
    assert_non_null(strstr(error.text, "expected"));
    assert_null(mesh);
    assert_int_equal(arena.used, used);
}

TEST(reads_all_corner_forms_and_passes_over_what_is_not_shape)
{
    static const char *const text[] = {
        VERTICES FACES,
        "# c\n\n  \t\nmtllib a.mtl\no tetra\ng one two\ns off\nusemtl steel\n" VERTICES
        "vt 0 0\nvn 0 0 1\nf 1/1 3/1 2/1\nf 1//1 2//1 4//1\nf 1/1/1 4/1/1 3/1/1\nf 2 3/2 4//3",
        VERTICES "f -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n",
        "v 0 0 0 1\nv 1. 0 0 1.0\nv 0 1e0 0\nv +0 .0 1.0E+0\n" FACES,
        "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nv 0 0 1\r\nf 1 3 2\r\nf 1 2 4\r\nf 1 4 3\r\nf 2 3 4\r\n",
        "v 0 \\\n0 0\nv 1 0 0\nv 0 1 0\nv 0 0\\\r\n 1\nf 1\\\n 3 \\\n 2\nf 1 2 4\nf 1 4 3\nf 2 3 "
        "4\n",
        "# a comment may end in a backslash \\\n" VERTICES FACES,
        "g a\\\nb\n" VERTICES FACES,
    };

    for (size_t i = 0; i < sizeof text / sizeof *text; i++) {
        const struct mesh *mesh = read_text(text[i]);

        assert_int_equal(mesh->nvertex, 4);
        assert_int_equal(mesh->nface, 4);
        assert_string_equal(mesh->name, "a.obj");
        assert_near(mesh_volume(mesh), 1.0 / 6, 1e-15);
    }
}

TEST(splits_convex_polygons_into_fans)
{
    /* a hexagonal prism: two hexagons of four triangles, six quads of two */
    const struct mesh *mesh =
        read_text("v 2 0 0\nv 1 2 0\nv -1 2 0\nv -2 0 0\nv -1 -2 0\nv 1 -2 0\n"
                  "v 2 0 1\nv 1 2 1\nv -1 2 1\nv -2 0 1\nv -1 -2 1\nv 1 -2 1\n"
                  "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\nf 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\n"
                  "f 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12\n");

    assert_int_equal(mesh->nface, 20);
    assert_int_equal(mesh->face[0][0], 5);
    assert_int_equal(mesh->face[0][1], 4);
    assert_int_equal(mesh->face[0][2], 3);
    assert_int_equal(mesh->face[1][1], 3);
    assert_near(mesh_volume(mesh), 12, 1e-14);
}

TEST(refuses_what_is_not_a_mesh_and_says_where)
{
    static const struct {
        const char *text, *start;
    } row[] = {
        {"", "a.obj:1:1: found no faces"},
        {"# nothing\n", "a.obj:2:1: found no faces"},
        {VERTICES, "a.obj:5:1: found no faces"},
        {"vp 1 2\n", "a.obj:1:1: found 'vp'"},
        {" l 1 2\n", "a.obj:1:2: found 'l'"},
        {"\"v\" 0 0 0\n", "a.obj:1:1: found '\"v\"'"},
        {"v 0 0\n", "a.obj:1:6: found the end of the line, expected a finite decimal number for z"},
        {"v nan 0 0\n", "a.obj:1:3: found 'nan', expected a finite decimal number for x"},
        {"v 0 -inf 0\n", "a.obj:1:5: found '-inf', expected a finite decimal number for y"},
        {"v 0 0 0x1p3\n", "a.obj:1:7: found '0x1p3'"},
        {"v 0 0 1e999\n", "a.obj:1:7: found '1e999'"},
        {"v 0 0 1e7\n", "a.obj:1:7: found '1e7', expected a coordinate within"},
        {"v 0 0 1,5\n", "a.obj:1:7: found '1,5'"},
        {"v 0 0 0 2\n", "a.obj:1:9: found '2', expected a weight of 1"},
        {"v 0 0 0 red\n", "a.obj:1:9: found 'red', expected the end of the line"},
        {"v 0 0 0 1 0.5 0.5\n", "a.obj:1:11: found '0.5', expected the end of the line"},
        {VERTICES "f 1 2\n", "a.obj:5:6: found a face of 2 corners"},
        {VERTICES "f\n", "a.obj:5:2: found a face of 0 corners"},
        {VERTICES "f 1 2 5\n", "a.obj:5:7: found vertex 5, expected 1 to 4"},
        {VERTICES "f 1 2 -5\n", "a.obj:5:7: found vertex -5, expected 1 to 4 or -1 to -4"},
        {"f 1 2 3\n" VERTICES, "a.obj:1:3: found vertex 1, expected 1 to 0"},
        {VERTICES "f 0 1 2\n", "a.obj:5:3: found '0', expected a corner"},
        {VERTICES "f 1 2 99999999999999999999\n", "a.obj:5:7: found '99999999999999999999'"},
        {VERTICES "f 1 2 2147483648\n", "a.obj:5:7: found vertex 2147483648"},
        {VERTICES "f 1 2 -4294967293\n", "a.obj:5:7: found vertex -4294967293"},
        {VERTICES "f 1 2 3.0\n", "a.obj:5:7: found '3.0'"},
        {VERTICES "f 1 2 +3\n", "a.obj:5:7: found '+3'"},
        {VERTICES "f 1/ 2 3\n", "a.obj:5:3: found '1/'"},
        {VERTICES "f 1// 2 3\n", "a.obj:5:3: found '1//'"},
        {VERTICES "f 1/1/ 2 3\n", "a.obj:5:3: found '1/1/'"},
        {VERTICES "f 1/0 2 3\n", "a.obj:5:3: found '1/0'"},
        {VERTICES "f 1/1/1/1 2 3\n", "a.obj:5:3: found '1/1/1/1'"},
        {VERTICES "f 1/-/1 2 3\n", "a.obj:5:3: found '1/-/1'"},
        {VERTICES "f 1 2 \x01\x7f\n", "a.obj:5:7: found '?\?'"},
        {VERTICES "f 1 2 2\n", "a.obj:5:3: found a degenerate face"},
        {VERTICES FACES "f 2 3 4\n", "a.obj:9:3: found a duplicate face of the one in line 8"},
        {VERTICES "f 1 3 2\nf 1 2 4\nf 1 4 3\n",
         "a.obj:5:5: found an open edge from vertex 3 to 2"},
        {VERTICES "f 1 3 2\nf 1 2 4\nf 1 3 4\nf 2 3 4\n",
         "a.obj:7:3: found two neighboring faces of opposite orientation"},
        {VERTICES "f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n", "a.obj:5:3: found inward orientation"},
        {VERTICES "v 5 5 5\n" FACES, "a.obj:5:1: found vertex 5 in no face"},
        {VERTICES "v 0 -1 0\nv 0 0 -1\n" FACES "f 1 2 5\nf 1 6 2\nf 1 5 6\nf 2 6 5\n",
         "a.obj:11:3: found an edge with more than two faces"},
        {VERTICES "v -1 0 0\nv 0 -1 0\nv 0 0 -1\n" FACES "f 1 5 6\nf 1 7 5\nf 1 6 7\nf 5 7 6\n",
         "a.obj:12:3: found a vertex in which separate surfaces touch (vertex 1)"},
        {"v 0 0 0\nv 1 0 0\nv 1 1 0.1\nv 0 1 0\nf 1 2 3 4\n", "a.obj:5:"},
        {"v 0 0 0\nv 2 0 0\nv 0.5 0.5 0\nv 0 2 0\nf 1 2 3 4\n", "a.obj:5:7: found a corner that"},
        {"v 0 0 0\nv 2 0 0\nv 0.5 0.5 0\nv 0 2 0\nf 2 3 4 1\n", "a.obj:5:"},
        {"v 0 3 0\nv 2 -2 0\nv -3 1 0\nv 3 1 0\nv -2 -2 0\nf 1 3 5 2 4\nf 1 2 3 4 5\n", "a.obj:7:"},
        {"v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3 4\n", "a.obj:5:1: found a polygon without"},
        {"v 0 0 0\\\n 1 1\n", "a.obj:2:4: found '1', expected the end of the line"},
        {"v 0 0 0\rv 1 0 0\r", "a.obj:1:7: found '0?v'"},
    };

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        refused(row[i].text, strlen(row[i].text), row[i].start);
    }
}

TEST(a_zero_byte_ends_neither_a_number_nor_the_file)
{
    static const char number[] = "v 0 0 0\0001\n", keyword[] = "v 0 0 0\n\0\n";

    refused(number, sizeof number - 1, "a.obj:1:7: found '0?1'");
    refused(keyword, sizeof keyword - 1, "a.obj:2:1: found '?'");
}

TEST(lines_of_any_length_are_read_and_quoted_short)
{
    size_t size = 4 << 20;
    char *text = malloc(size + 1);

    assert_non_null(text);

    /* One long comment before a good mesh */
    memset(text, 'x', size);
    text[0] = '#';
    memcpy(text + size - sizeof VERTICES FACES, "\n" VERTICES FACES, sizeof VERTICES FACES);
    text[size] = '\0';
    assert_int_equal(read_text(text)->nface, 4);

    /* One long word */
    memset(text, '1', size);
    memcpy(text, "v ", 2);
    refused(text, size,
            "a.obj:1:3: found '1111111111111111111111111111111111...', expected a finite");

    /* a polygon of too many corners */
    for (size_t i = 0; i < size; i += 2) {
        memcpy(text + i, "1 ", 2);
    }
    memcpy(text, "v 0 0 0\nf ", 10);
    refused(text, size, "a.obj:2:515: found one more corner, expected a polygon of at most 256");
    free(text);
}

TEST(too_many_vertices_are_an_error_with_the_limit)
{
    size_t lines = MESH_MAX_VERTICES + 1;
    char *text = malloc(8 * lines);

    assert_non_null(text);
    for (size_t i = 0; i < lines; i++) {
        memcpy(text + 8 * i, "v 0 0 0\n", 8);
    }
    refused(text, 8 * lines, "a.obj:524289:1: found one more vertex, expected at most 524288");
    free(text);
}

/* The same triangle again and again, which a check of the surface would find much later. */
TEST(too_many_faces_are_refused_while_they_are_counted)
{
    static const char corners[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    size_t size = strlen(corners), lines = MESH_MAX_FACES + 1;
    char *text = malloc(size + 8 * lines);

    assert_non_null(text);
    memcpy(text, corners, size);
    for (size_t i = 0; i < lines; i++) {
        memcpy(text + size + 8 * i, "f 1 2 3\n", 8);
    }
    refused(text, size + 8 * lines,
            "a.obj:524292:3: found one more triangle, expected at most 524288");
    free(text);
}

TEST(a_file_that_is_none_is_an_error_and_never_a_hang)
{
    char directory[] = "/tmp/mesh_obj_XXXXXX", fifo[64];
    const char *path[] = {"/nonexistent/a.obj", directory, fifo, "/dev/zero"};

    assert_non_null(mkdtemp(directory));
    snprintf(fifo, sizeof fifo, "%s/fifo", directory);
    assert_int_equal(mkfifo(fifo, 0600), 0);
    for (size_t i = 0; i < sizeof path / sizeof *path; i++) {
        const struct mesh *mesh = NULL;
        struct error error;

        assert_int_equal(solid_store_read_obj(path[i], &arena, &mesh, &error), ERROR_INPUT);
        assert_int_equal(strncmp(error.text, path[i], strlen(path[i])), 0);
        assert_null(mesh);
    }
    unlink(fifo);
    rmdir(directory);
}

TEST(a_file_over_the_size_limit_is_refused_before_it_is_read)
{
    char path[] = "/tmp/mesh_obj_XXXXXX";
    int fd = mkstemp(path);
    const struct mesh *mesh = NULL;
    struct error error;

    assert_true(fd >= 0);
    assert_int_equal(ftruncate(fd, (off_t)MESH_MAX_FILE_BYTES + 1), 0);
    assert_int_equal(solid_store_read_obj(path, &arena, &mesh, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found more than 268435456 bytes"));
    close(fd);
    unlink(path);
}

TEST(an_arena_that_is_used_up_is_reported)
{
    struct arena small;
    const struct mesh *mesh = NULL;
    char *text = NULL;
    size_t size = 0;
    const struct mesh *box;
    FILE *file = open_memstream(&text, &size);

    assert_non_null(file);
    assert_ok(mesh_box((double[3]){1, 1, 1}, 16, &arena, &box, NULL));
    mesh_write_obj(box, file);
    fclose(file);
    assert_ok(arena_init(&small, 4096, NULL));
    assert_int_equal(mesh_read_obj_text("a.obj", text, size, &small, &mesh, NULL), ERROR_MEMORY);
    assert_null(mesh);
    arena_fini(&small);
    free(text);
}

TEST_GROUP(open_arena, close_arena)
