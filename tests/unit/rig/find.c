/* SPDX-License-Identifier: Apache-2.0 */
/* Where a rig's name leads. */
#include "rig/find.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static char local[64], installed[64];

static void touch(const char *folder, const char *name)
{
    char path[PATH_MAX];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, "we");
    assert_non_null(file);
    fclose(file);
}

static int start(void **state)
{
    (void)state;
    strcpy(local, "/tmp/hil-rigs-XXXXXX");
    strcpy(installed, "/tmp/hil-rigs-XXXXXX");
    return !mkdtemp(local) || !mkdtemp(installed);
}

static int stop(void **state)
{
    char command[256];

    (void)state;
    snprintf(command, sizeof command, "rm -rf '%s' '%s'", local, installed);
    return system(command);
}

static void assert_leads(const char *name, const char *folder, const char *file)
{
    char path[PATH_MAX], expected[PATH_MAX];
    struct error error;

    assert_int_equal(rig_locate_in(name, local, installed, path, &error), ERROR_NONE);
    snprintf(expected, sizeof expected, "%s%s%s", folder, folder[0] ? "/" : "", file);
    assert_string_equal(path, expected);
}

static void a_name_is_looked_for_in_etc_first(void **state)
{
    (void)state;
    touch(installed, "coman.yaml");
    assert_leads("coman", installed, "coman.yaml");
    touch(local, "coman.yaml");
    assert_leads("coman", local, "coman.yaml");
}

static void a_path_stays_what_it_is_even_when_there_is_nothing(void **state)
{
    (void)state;
    assert_leads("config/rigs/none", "", "config/rigs/none");
    assert_leads("none.yaml", "", "none.yaml");
    assert_leads("./coman", "", "./coman");
}

static void an_unknown_name_is_refused_with_the_places(void **state)
{
    char path[PATH_MAX];
    struct error error;

    (void)state;
    assert_int_equal(rig_locate_in("nobody", local, installed, path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "nobody.yaml"));
    assert_non_null(strstr(error.text, local));
    assert_non_null(strstr(error.text, installed));
    assert_int_equal(rig_locate_in("", local, "", path, &error), ERROR_INPUT);
}

static void a_path_that_is_too_long_is_refused(void **state)
{
    static char name[2 * PATH_MAX];
    char path[PATH_MAX];

    (void)state;
    memset(name, 'x', sizeof name - 1);
    assert_int_equal(rig_locate_in(name, local, installed, path, NULL), ERROR_INPUT);
    name[PATH_MAX - 1] = '\0';
    assert_int_equal(rig_locate_in(name, local, installed, path, NULL), ERROR_INPUT);
}

static void the_program_looks_beside_itself(void **state)
{
    char path[PATH_MAX];
    struct error error;

    (void)state;
    assert_int_equal(rig_locate("hil-no-such-rig", path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "/etc/coman-hil/rigs or /"));
    assert_non_null(strstr(error.text, "/share/coman-hil/rigs"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_name_is_looked_for_in_etc_first, start, stop),
        cmocka_unit_test_setup_teardown(a_path_stays_what_it_is_even_when_there_is_nothing, start,
                                        stop),
        cmocka_unit_test_setup_teardown(an_unknown_name_is_refused_with_the_places, start, stop),
        cmocka_unit_test_setup_teardown(a_path_that_is_too_long_is_refused, start, stop),
        cmocka_unit_test(the_program_looks_beside_itself),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
