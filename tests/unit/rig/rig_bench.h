/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of rigs share: an arena and the toy rig's tree for each test, rigs that load and
 * rigs that are refused. */
#ifndef TESTS_UNIT_RIG_RIG_BENCH_H
#define TESTS_UNIT_RIG_RIG_BENCH_H

#include "rig/rig.h"

#include "tests/unit/arena_fixture.h"
#include "tests/unit/rig/rig_files.h"

FIXTURE(open_rig_tree)
{
    return open_arena(test_state) || make_tree() ? -1 : 0;
}

FIXTURE(close_rig_tree)
{
    remove_tree();
    return close_arena(test_state);
}

static inline void write_rig_file(const char *text)
{
    assert_int_equal(write_file("config/rigs/toy.yaml", text, strlen(text)), 0);
}

static inline const struct rig *load_rig(const char *path)
{
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_no_error(rig_load(path, &arena, &rig, &error), error.text);
    return rig;
}

/* Reads the toy rig with lines of the test's at its end. */
static inline enum error_code read_toy_rig_with(const char *lines, const struct rig **rig,
                                                struct error *error)
{
    static char text[sizeof toy_rig + 2048];

    snprintf(text, sizeof text, "%s%s\n", toy_rig, lines);
    write_rig_file(text);
    return rig_load(rig_path, &arena, rig, error);
}

static inline const struct rig *load_toy_rig_with(const char *lines)
{
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_no_error(read_toy_rig_with(lines, &rig, &error), error.text);
    return rig;
}

/* The rig file as it was written is refused: message is what follows the name of the file, about
 * what the test has put into it. */
static inline void assert_rig_refused(const char *about, const char *message)
{
    const struct rig *rig = NULL;
    struct error error = {0};
    char expected[512];

    snprintf(expected, sizeof expected, "%s:%s", rig_path, message);
    if (rig_load(rig_path, &arena, &rig, &error) != ERROR_INPUT ||
        strcmp(error.text, expected) != 0) {
        fail_msg("for \"%s\"\nexpected: %s\ngot:      %s", about, expected, error.text);
    }
}

/* The toy rig with its buses replaced, of which each joint needs to be driven. */
static inline void write_buses_and_lockstep(const char *buses, const char *lockstep)
{
    char text[sizeof toy_rig + 2048];
    const char *from = strstr(toy_rig, "buses:\n"), *to = strstr(toy_rig, "lockstep:");

    snprintf(text, sizeof text, "%.*sbuses:\n%slockstep: {%s}\n%s", (int)(from - toy_rig), toy_rig,
             buses, lockstep, strchr(to, '\n') + 1);
    write_rig_file(text);
}

static inline void write_buses(const char *buses)
{
    write_buses_and_lockstep(buses, "");
}

static inline const struct rig *load_buses(const char *buses)
{
    write_buses(buses);
    return load_rig(rig_path);
}

static inline void assert_buses_refused(const char *buses, const char *message)
{
    write_buses(buses);
    assert_rig_refused(buses, message);
}

#endif
