/* SPDX-License-Identifier: Apache-2.0 */
/* Meshes written as OBJ text. */
#include "tools/mesh_write.h"

#include <stdlib.h>

#include "tests/unit/arena_fixture.h"
#include "tests/test.h"

TEST(what_is_written_reads_back_bit_by_bit)
{
    const double half[3] = {0.1 / 3, 1e-6, 123.45678901234567};
    const struct mesh *box, *back = NULL;
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);

    assert_non_null(file);
    assert_int_equal(mesh_box(half, 1, &arena, &box, NULL), ERROR_NONE);
    assert_int_equal(mesh_write_obj(box, file, NULL), ERROR_NONE);
    fclose(file);
    assert_int_equal(mesh_read_obj_text("a.obj", text, size, &arena, &back, NULL), ERROR_NONE);
    assert_int_equal(back->nvertex, box->nvertex);
    assert_int_equal(back->nface, box->nface);
    assert_memory_equal(back->vertex, box->vertex, box->nvertex * sizeof *box->vertex);
    assert_memory_equal(back->face, box->face, box->nface * sizeof *box->face);
    free(text);
}

TEST(writing_to_a_full_device_is_an_error)
{
    const struct mesh *box;
    FILE *full = fopen("/dev/full", "w");
    struct error error;

    if (!full) {
        print_message("SKIP: there is no /dev/full\n");
        skip();
    }
    assert_int_equal(mesh_box((double[3]){1, 1, 1}, 1, &arena, &box, NULL), ERROR_NONE);
    assert_int_equal(mesh_write_obj(box, full, &error), ERROR_SYSTEM);
    fclose(full);
}

TEST_GROUP(open_arena, close_arena)
