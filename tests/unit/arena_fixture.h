/* SPDX-License-Identifier: Apache-2.0 */
/* The arena of a test program: opened before each test that asks for it, closed after it. */
#ifndef TESTS_UNIT_ARENA_FIXTURE_H
#define TESTS_UNIT_ARENA_FIXTURE_H

#include "base/arena.h"

static struct arena arena;

/* For cmocka_unit_test_setup_teardown, or for a set-up of the test's own. */
static inline int open_arena(void **state)
{
    (void)state;
    return arena_init(&arena, (size_t)64 << 20, NULL) == ERROR_NONE ? 0 : -1;
}

static inline int close_arena(void **state)
{
    (void)state;
    arena_fini(&arena);
    return 0;
}

#endif
