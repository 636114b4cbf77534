/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tests that register themselves, on top of cmocka. A test program is one source with
 *
 *     TEST(adds_two_numbers) { assert_int_equal(add(1, 2), 3); }
 *
 * for each test. tests/test.c has `main`, which runs the tests in the order of the source.
 * `test_PROGRAM PATTERN` runs the tests whose name matches; * stands for any text. This header
 * includes the common headers of C, too.
 *
 * TEST_ON adds a test of a bench. TEST_WITH names a set-up and a tear-down of one test (NULL:
 * none), TEST_GROUP those of the whole program, at most once. Both are functions made with FIXTURE,
 * which return 0 on success.
 */
#ifndef TESTS_TEST_H
#define TESTS_TEST_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif
#include <cmocka.h>

/* Adds a test; the tests run in the order of their lines */
void test_register(int line, struct CMUnitTest test);
void test_register_group(CMFixtureFunction set_up, CMFixtureFunction tear_down);
#ifdef __cplusplus
}
#endif

/* Asserts that a function which returns an enum error (base/error.h) succeeded */
#define assert_ok(result) assert_int_equal(result, ERROR_NONE)
/* The same, and prints the function's message, an array of char, when it failed */
#define assert_no_error(result, message)                                                           \
    if ((result) != ERROR_NONE) {                                                                  \
        fail_msg("%s", message);                                                                   \
    }

/* Closes a variable, which the test has opened, at the end of its block. */
#define CLOSED_BY(close) __attribute__((cleanup(close)))

#define TEST(name) TEST_WITH(name, NULL, NULL)
#define TEST_WITH(name, set_up, tear_down)                                                         \
    static void name(void **test_state);                                                           \
    static void __attribute__((constructor)) register_##name(void)                                 \
    {                                                                                              \
        test_register(__LINE__, (struct CMUnitTest){#name, name, set_up, tear_down, NULL});        \
    }                                                                                              \
    static void name(void **test_state __attribute__((unused)))
/* BENCH(open, type, close) makes a bench; TEST_ON(name, open, bench) adds a test with the parameter
 * `bench`, a pointer to a zeroed bench that `open` has prepared. `close` runs after the test, also
 * after one that has failed. */
#define BENCH(open, type, close) BENCH_OPENED(open, type, open(&bench), close)
/* The same, for a bench that each test opens in its own way. */
#define CLOSED_BENCH(kind, type, close) BENCH_OPENED(kind, type, (void)0, close)
#define BENCH_OPENED(open, type, opening, close)                                                   \
    typedef type open##_bench;                                                                     \
    static inline int open##_set_up(void **test_state)                                             \
    {                                                                                              \
        static type bench;                                                                         \
                                                                                                   \
        memset(&bench, 0, sizeof bench);                                                           \
        *test_state = &bench;                                                                      \
        opening;                                                                                   \
        return 0;                                                                                  \
    }                                                                                              \
    static inline int open##_tear_down(void **test_state)                                          \
    {                                                                                              \
        close(*test_state);                                                                        \
        return 0;                                                                                  \
    }
#define TEST_ON(name, open, bench)                                                                 \
    static void name##_on(open##_bench *bench);                                                    \
    TEST_WITH(name, open##_set_up, open##_tear_down)                                               \
    {                                                                                              \
        name##_on(*test_state);                                                                    \
    }                                                                                              \
    static void name##_on(open##_bench *bench __attribute__((unused)))
#define FIXTURE(name) static inline int name(void **test_state __attribute__((unused)))
#define TEST_GROUP(set_up, tear_down)                                                              \
    static void __attribute__((constructor)) register_group(void)                                  \
    {                                                                                              \
        test_register_group(set_up, tear_down);                                                    \
    }

#endif
