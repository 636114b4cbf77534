/* SPDX-License-Identifier: Apache-2.0 */
/* `main` of a test program whose tests register themselves. */
#include "tests/test.h"

enum { TESTS_MAX = 256 };

static struct CMUnitTest tests[TESTS_MAX];
static int lines[TESTS_MAX];
static size_t count;
static CMFixtureFunction group_set_up, group_tear_down;

void test_register(int line, struct CMUnitTest test)
{
    size_t place = count++;

    if (count > TESTS_MAX) {
        fprintf(stderr, "more than %d tests in one program\n", TESTS_MAX);
        abort();
    }
    for (; place > 0 && lines[place - 1] > line; place--) {
        lines[place] = lines[place - 1];
        tests[place] = tests[place - 1];
    }
    lines[place] = line;
    tests[place] = test;
}

void test_register_group(CMFixtureFunction set_up, CMFixtureFunction tear_down)
{
    group_set_up = set_up;
    group_tear_down = tear_down;
}

int main(int argc, char **argv)
{
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return _cmocka_run_group_tests(argv[0], tests, count, group_set_up, group_tear_down);
}
