/* SPDX-License-Identifier: Apache-2.0 */
/* The OBJ reader when memory runs out: every allocation fails once, in turn. */
#include "contact/mesh/solid_store.h"
#include "tests/unit/arena_fixture.h"

/* The linker sends the library's calls here (--wrap). */
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);

static int until_failure = -1; /* calls that still succeed; -1: all do */

static bool fails(void)
{
    return until_failure >= 0 && until_failure-- == 0;
}

void *__wrap_malloc(size_t size)
{
    return fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    return fails() ? NULL : __real_calloc(count, size);
}

void *__wrap_realloc(void *memory, size_t size)
{
    return fails() ? NULL : __real_realloc(memory, size);
}

TEST_WITH(every_allocation_that_fails_is_reported_and_nothing_leaks, open_arena, close_arena)
{
    const char *path = HIL_SOURCE_DIR "/config/meshes/coman-foot-right.obj";
    enum error_code code = ERROR_MEMORY;
    int failures = 0;

    while (code != ERROR_NONE) {
        const struct mesh *mesh = NULL;
        struct error error = {0};

        until_failure = failures;
        code = solid_store_read_obj(path, &arena, &mesh, &error);
        until_failure = -1;
        if (code != ERROR_NONE) {
            assert_int_equal(code, ERROR_MEMORY);
            assert_non_null(strstr(error.text, "no memory"));
            assert_null(mesh);
            assert_int_equal(arena.used, 0);
            failures++;
        }
    }
    /* The file; vertices, faces and tags, the first two with places; five arrays of the check */
    assert_true(failures >= 1 + 5 + 5);
}
