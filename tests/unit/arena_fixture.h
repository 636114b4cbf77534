/* SPDX-License-Identifier: Apache-2.0 */
/* The arena of a test program: opened before each test that asks for it, closed after it. */
#ifndef TESTS_UNIT_ARENA_FIXTURE_H
#define TESTS_UNIT_ARENA_FIXTURE_H

#include "base/arena.h"
#include "tests/test.h"

static struct arena arena;

/* For cmocka_unit_test_setup_teardown, or for a set-up of the test's own. */
FIXTURE(open_arena)
{
    return arena_init(&arena, (size_t)64 << 20, NULL) == ERROR_NONE ? 0 : -1;
}

FIXTURE(close_arena)
{
    arena_fini(&arena);
    return 0;
}

#endif
