/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The choice among a built-in module, one that was made beforehand and the numeric algorithms: what
 * is taken and said, and in which folders modules are looked for.
 */
#include "sim/robot_dynamics.h"
#include "tests/unit/model/coman.h"
#include "tests/unit/model/symbolic/evaluate.h"
#include "tests/test.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char cache[64], folder[96];
static struct random_tree tree;
static struct symbolic_library library;
static struct dynamics d;
static struct error notice, error;

FIXTURE(open_cache)
{
    strcpy(cache, "/tmp/hil-dynamics-XXXXXX");
    if (open_arena(test_state) || !mkdtemp(cache) || setenv("XDG_CACHE_HOME", cache, 1) ||
        pendulum_make(&tree, &error)) {
        return 1;
    }
    return !robot_dynamics_folder(folder, sizeof folder);
}

FIXTURE(close_cache)
{
    char command[96];

    symbolic_close(&library);
    close_arena(test_state);
    snprintf(command, sizeof command, "rm -r '%s'", cache);
    return system(command);
}

/* Takes the fastest dynamics of a robot; text must be said of them. */
static void assert_taken(const struct robot *robot, const char *name, const char *text)
{
    if (robot_dynamics_fastest(robot, &arena, &d, &library, &notice, &error)) {
        fail_msg("%s", error.text);
    }
    if (strcmp(d.ops->name, name) || !strstr(notice.text, text)) {
        fail_msg("%s: %s", d.ops->name, notice.text);
    }
}

static struct robot *copy(const struct robot *robot)
{
    struct robot *copied;

    assert_int_equal(robot_copy(robot, &arena, &copied, &error), ERROR_NONE);
    return copied;
}

/* The same robot with a kilogram more. */
static const struct robot *heavier(const struct robot *robot)
{
    struct robot *heavy = copy(robot);

    heavy->body[heavy->nbody - 1].inertia.mass += 1.0;
    assert_int_equal(robot_finish(heavy, &error), ERROR_NONE);
    return heavy;
}

TEST_WITH(a_built_in_module_comes_first, open_cache, close_cache)
{
    const struct robot *coman = load_coman(NULL);

    assert_taken(coman, "generated", "built-in generated dynamics (");
    assert_null(library.handle);
    assert_taken(heavier(coman), "generated", "built-in generated dynamics with masses as inputs");
    assert_null(library.handle);
}

TEST_WITH(without_a_module_they_are_numeric, open_cache, close_cache)
{
    assert_taken(&tree.robot, "generic", "there is no module of");
    assert_null(library.handle);
    assert_int_equal(access(folder, F_OK), -1);
}

TEST_WITH(a_module_made_beforehand_serves_other_masses_too, open_cache, close_cache)
{
    struct symbolic_options quick = robot_dynamics_module;
    double q = 0.3, v = 0.5, tau = 0.1, light, heavy;

    if (system("cc --version >/dev/null 2>&1") != 0) {
        print_message("SKIP: no C compiler (cc)\n");
        skip();
    }
    quick.fast_compile = true;
    assert_int_equal(mkdir(folder, 0755), 0);
    if (symbolic_build(&tree.robot, &quick, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    symbolic_close(&library);
    assert_taken(&tree.robot, "generated", "made beforehand");
    d.ops->forward(&d, &q, &v, &tau, NULL, &light);
    symbolic_close(&library);
    assert_taken(heavier(&tree.robot), "generated", "made beforehand");
    d.ops->forward(&d, &q, &v, &tau, NULL, &heavy);
    assert_true(light != heavy);
    symbolic_close(&library);

    /* Not where others may write */
    assert_int_equal(chmod(folder, 0777), 0);
    assert_taken(&tree.robot, "generic", "others may write there");
}

TEST_WITH(the_folder_is_the_users, open_cache, close_cache)
{
    char found[96], expected[96];

    snprintf(expected, sizeof expected, "%s/coman-hil", cache);
    assert_true(robot_dynamics_folder(found, sizeof found));
    assert_string_equal(found, expected);
    assert_false(robot_dynamics_folder(found, 8));
    unsetenv("XDG_CACHE_HOME");
    setenv("HOME", cache, 1);
    assert_true(robot_dynamics_folder(found, sizeof found));
    snprintf(expected, sizeof expected, "%s/.cache/coman-hil", cache);
    assert_string_equal(found, geteuid() == 0 ? "/var/cache/coman-hil" : expected);
    unsetenv("HOME");
    assert_int_equal(robot_dynamics_folder(found, sizeof found), geteuid() == 0);
}

TEST_WITH(a_rig_that_wants_numbers_gets_them_and_another_the_command, open_cache, close_cache)
{
    struct rig rig = {
        .file = "rigs/mine.yaml", .robot = &tree.robot, .dynamics = RIG_DYNAMICS_GENERIC};

    assert_int_equal(robot_dynamics_create(&rig, &arena, &d, &library, &notice, &error),
                     ERROR_NONE);
    assert_string_equal(notice.text, "numeric dynamics, as the rig says");
    rig.dynamics = RIG_DYNAMICS_FASTEST;
    assert_int_equal(robot_dynamics_create(&rig, &arena, &d, &library, &notice, &error),
                     ERROR_NONE);
    assert_string_equal(d.ops->name, "generic");
    assert_non_null(strstr(notice.text, "; coman-hil generate --module rigs/mine.yaml makes one"));
}
