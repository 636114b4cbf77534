/* SPDX-License-Identifier: Apache-2.0 */
/* Meshes written as OBJ text. */
#include "tools/mesh_write.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "tests/unit/arena_fixture.h"

static void what_is_written_reads_back_bit_by_bit(void **state)
{
    const double half[3] = {0.1 / 3, 1e-6, 123.45678901234567};
    const struct mesh *box, *back = NULL;
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);

    (void)state;
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

static void writing_to_a_full_device_is_an_error(void **state)
{
    const struct mesh *box;
    FILE *full = fopen("/dev/full", "w");
    struct error error;

    (void)state;
    if (!full) {
        print_message("SKIP: there is no /dev/full\n");
        skip();
    }
    assert_int_equal(mesh_box((double[3]){1, 1, 1}, 1, &arena, &box, NULL), ERROR_NONE);
    assert_int_equal(mesh_write_obj(box, full, &error), ERROR_SYSTEM);
    fclose(full);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_reads_back_bit_by_bit),
        cmocka_unit_test(writing_to_a_full_device_is_an_error),
    };

    return cmocka_run_group_tests_name("tools_mesh_write", tests, open_arena, close_arena);
}
