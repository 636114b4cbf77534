/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The generator when memory runs out: the n-th allocation fails, for every n, and each time the
 * answer is an error and nothing is lost. Linked with --wrap for calloc and realloc.
 */
#include "model/symbolic/symbolic.h"
#include "tests/unit/model/symbolic/evaluate.h"
#include "tests/test.h"

static long countdown = -1; /* 0: the next allocation fails; negative: none does */
static long outstanding;

void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void __real_free(void *memory);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);
void __wrap_free(void *memory);

void *__wrap_calloc(size_t count, size_t size)
{
    void *memory = countdown-- == 0 ? NULL : __real_calloc(count, size);

    outstanding += memory != NULL;
    return memory;
}

void *__wrap_realloc(void *memory, size_t size)
{
    void *grown = countdown-- == 0 ? NULL : __real_realloc(memory, size);

    outstanding += grown && !memory;
    return grown;
}

void __wrap_free(void *memory)
{
    outstanding -= memory != NULL;
    __real_free(memory);
}

TEST(every_failed_allocation_is_an_error_and_loses_nothing)
{
    const struct symbolic_options options = {.lanes = 4};
    static char text[8 << 20];
    struct random_tree tree;
    struct error error;
    uint64_t seed = 71;
    long n = 0;
    enum error_code code;

    assert_ok(limbed_tree_make(&seed, &tree, &error));
    do {
        FILE *file = fmemopen(text, sizeof text, "w");
        long before = outstanding;

        assert_non_null(file);
        countdown = n++;
        code = symbolic_generate(&tree.robot, &options, file, NULL, &error);
        countdown = -1;
        assert_int_equal(outstanding, before);
        assert_true(code == ERROR_NONE || code == ERROR_MEMORY);
        fclose(file);
    } while (code && n < 1000);
    print_message("# %ld allocations\n", n - 1);
    assert_ok(code);
    assert_true(n > 20);
}
