/* SPDX-License-Identifier: Apache-2.0 */
/* Arena, errors as values, hash. */
#include "base/arena.h"
#include "base/hash.h"
#include "tests/test.h"

#include <errno.h>

static struct error error;

CLOSED_BENCH(arena, struct arena, arena_fini)

TEST_ON(hands_out_zeroed_aligned_memory_that_does_not_overlap, arena, arena)
{
    unsigned char *last_end = NULL;

    assert_ok(arena_init(arena, 1 << 20, NULL));
    for (size_t size = 1; size < 500; size += 7) {
        unsigned char *p = arena_alloc(arena, size, 1);

        assert_non_null(p);
        assert_int_equal((uintptr_t)p % 64, 0);
        assert_true(p >= last_end);
        for (size_t i = 0; i < size; i++) {
            assert_int_equal(p[i], 0);
        }
        memset(p, 0xa5, size);
        last_end = p + size;
    }
}

TEST_ON(refuses_more_than_its_capacity_and_stays_usable, arena, arena)
{
    assert_ok(arena_init(arena, 4096, NULL));
    assert_null(arena_alloc(arena, 4097, 1));
    assert_non_null(arena_alloc(arena, 4000, 1));
    assert_null(arena_alloc(arena, 65, 1));
    assert_non_null(arena_alloc(arena, 64, 1));
    assert_null(arena_alloc(arena, 1, 1));
    assert_null(arena_strdup(arena, "text"));
}

TEST_ON(refuses_sizes_whose_product_overflows, arena, arena)
{
    assert_ok(arena_init(arena, 4096, NULL));
    assert_null(arena_alloc(arena, SIZE_MAX / 2, 3));
    assert_null(arena_alloc(arena, SIZE_MAX, SIZE_MAX));
    assert_null(arena_alloc(arena, SIZE_MAX, 1));
}

TEST_ON(hands_out_nothing_once_it_is_sealed, arena, arena)
{
    char *text;

    assert_ok(arena_init(arena, 1 << 20, NULL));
    text = arena_strdup(arena, "kept");
    arena_seal(arena);
    assert_null(arena_alloc(arena, 1, 1));
    assert_string_equal(text, "kept");
}

TEST(finishing_twice_does_no_harm)
{
    struct arena arena CLOSED_BY(arena_fini);

    assert_ok(arena_init(&arena, 4096, NULL));
    arena_fini(&arena);
}

TEST_ON(says_why_memory_could_not_be_reserved, arena, arena)
{
    assert_int_equal(arena_init(arena, (size_t)1 << 62, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "4611686018427387904 bytes"));
    assert_non_null(strstr(error.text, strerror(ENOMEM)));
    assert_null(arena_alloc(arena, 1, 1));
}

TEST(an_error_carries_code_and_text)
{
    assert_int_equal(error_set(&error, ERROR_INPUT, "found %d", 7), ERROR_INPUT);
    assert_int_equal(error.code, ERROR_INPUT);
    assert_string_equal(error.text, "found 7");
    assert_int_equal(error_set_errno(&error, ENOENT, "open %s", "x"), ERROR_SYSTEM);
    assert_string_equal(error.text, "open x: No such file or directory");
    assert_int_equal(error_prefix(&error, "rig %s", "r"), ERROR_SYSTEM);
    assert_string_equal(error.text, "rig r: open x: No such file or directory");
}

TEST(an_error_that_nobody_asked_for_is_only_a_code)
{
    assert_int_equal(error_set(NULL, ERROR_MEMORY, "x"), ERROR_MEMORY);
    assert_int_equal(error_set_errno(NULL, ENOENT, "x"), ERROR_SYSTEM);
}

TEST(an_error_repeats_no_control_characters)
{
    error_set(&error, ERROR_INPUT, "found \"%s\"", "a\x1b[2J\n\x7f\xc3\xa4");
    assert_string_equal(error.text, "found \"a?[2J??\xc3\xa4\"");
    error_prefix(&error, "%s", "x\ty");
    assert_string_equal(error.text, "x?y: found \"a?[2J??\xc3\xa4\"");
    error_set_errno(&error, ENOENT, "open %s", "\r");
    assert_string_equal(error.text, "open ?: No such file or directory");
}

TEST(a_long_error_text_is_cut_and_stays_a_string)
{
    char text[3000];

    memset(text, 'y', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    error_set(&error, ERROR_INPUT, "%s", text);
    assert_int_equal(strlen(error.text), sizeof error.text - 1);
    for (int i = 0; i < 20; i++) {
        error_prefix(&error, "%s", text);
        assert_true(strlen(error.text) < sizeof error.text);
    }
    error_set_errno(&error, ENOENT, "%s", text);
    assert_int_equal(strlen(error.text), sizeof error.text - 1);
}

/* Vectors of the FNV authors' reference list (64-bit FNV-1a). */
TEST(the_hash_is_fnv_1a)
{
    assert_true(hash_bytes(HASH_START, "", 0) == UINT64_C(0xcbf29ce484222325));
    assert_true(hash_bytes(HASH_START, "a", 1) == UINT64_C(0xaf63dc4c8601ec8c));
    assert_true(hash_bytes(HASH_START, "foobar", 6) == UINT64_C(0x85944171f73967e8));
    assert_true(hash_bytes(hash_bytes(HASH_START, "foo", 3), "bar", 3) ==
                UINT64_C(0x85944171f73967e8));
}
