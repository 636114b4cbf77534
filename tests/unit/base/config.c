/* SPDX-License-Identifier: Apache-2.0 */
/* Where a name of a rig, a robot, a scenario or a drive leads, and which there are. */
#include "base/config.h"
#include "tests/test.h"

#include <sys/stat.h>
#include <unistd.h>

static struct error error;

static struct config_trees trees;
static char local[128], installed[128], built[128];

static void touch(const char *folder, const char *name)
{
    char path[PATH_MAX];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, "we");
    assert_non_null(file);
    fclose(file);
}

/* A configuration tree with a folder of rigs, whose path goes to rigs. */
static bool make_tree(int number, char rigs[128])
{
    static const char *const folders[] = {"rigs", "robots", "scenarios", "drives"};
    char path[128] = "/tmp/hil-config-XXXXXX", folder[160];

    if (!mkdtemp(path)) {
        return false;
    }
    strcpy(trees.folder[number], path);
    for (int i = 0; i < 4; i++) {
        snprintf(folder, sizeof folder, "%s/%s", path, folders[i]);
        if (mkdir(folder, 0755)) {
            return false;
        }
    }
    snprintf(rigs, 128, "%.100s/rigs", path);
    return true;
}

FIXTURE(start)
{
    return !make_tree(0, local) || !make_tree(1, installed) || !make_tree(2, built);
}

FIXTURE(stop)
{
    char command[512];

    snprintf(command, sizeof command, "rm -rf '%.100s' '%.100s' '%.100s'", trees.folder[0],
             trees.folder[1], trees.folder[2]);
    return system(command);
}

static void assert_leads(const char *name, const char *folder, const char *file)
{
    char path[PATH_MAX], expected[PATH_MAX];

    assert_ok(config_locate_in(CONFIG_RIG, name, &trees, path, &error));
    snprintf(expected, sizeof expected, "%s%s%s", folder, folder[0] ? "/" : "", file);
    assert_string_equal(path, expected);
}

TEST_WITH(a_name_is_looked_for_in_etc_first, start, stop)
{
    touch(built, "coman.yaml");
    assert_leads("coman", built, "coman.yaml");
    touch(installed, "coman.yaml");
    assert_leads("coman", installed, "coman.yaml");
    touch(local, "coman.yaml");
    assert_leads("coman", local, "coman.yaml");
}

TEST_WITH(a_path_stays_what_it_is_even_when_there_is_nothing, start, stop)
{
    assert_leads("config/rigs/none", "", "config/rigs/none");
    assert_leads("none.yaml", "", "none.yaml");
    assert_leads("./coman", "", "./coman");
}

TEST_WITH(an_unknown_name_is_refused_with_the_places, start, stop)
{
    char path[PATH_MAX];

    assert_int_equal(config_locate_in(CONFIG_RIG, "nobody", &trees, path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "nobody.yaml"));
    assert_non_null(strstr(error.text, local));
    assert_non_null(strstr(error.text, installed));
    assert_int_equal(config_locate_in(CONFIG_RIG, "", &trees, path, &error), ERROR_INPUT);
}

TEST_WITH(a_misspelled_name_is_refused_with_the_nearest, start, stop)
{
    char path[PATH_MAX];

    touch(local, "coman.yaml");
    touch(built, "walkman.yaml");
    assert_int_equal(config_locate_in(CONFIG_RIG, "walkmna", &trees, path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found no rig \"walkmna\", expected \"walkman\""));
    assert_int_equal(config_locate_in(CONFIG_RIG, "comann", &trees, path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "expected \"coman\""));

    /* a robot is no rig */
    assert_int_equal(config_locate_in(CONFIG_ROBOT, "coman", &trees, path, &error), ERROR_INPUT);
    assert_null(strstr(error.text, "expected \"coman\""));
}

/* coman-hil run coman.yaml where there is no such file */
TEST_WITH(a_name_with_yaml_behind_it_is_told_from_the_name, start, stop)
{
    char path[PATH_MAX];

    touch(built, "coman.yaml");
    assert_int_equal(config_locate_in(CONFIG_RIG, "coman.yaml", &trees, path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "or \"coman\" for the rig of that name"));
}

TEST_WITH(a_folder_of_that_name_is_no_file, start, stop)
{
    char folder[160], before[PATH_MAX];

    touch(installed, "coman.yaml");
    assert_non_null(getcwd(before, sizeof before));
    snprintf(folder, sizeof folder, "%s/coman", local);
    assert_int_equal(mkdir(folder, 0755), 0);
    assert_int_equal(chdir(local), 0);
    assert_leads("coman", installed, "coman.yaml");
    assert_int_equal(chdir(before), 0);
}

TEST_WITH(a_list_has_each_name_once_in_order, start, stop)
{
    static const char *const expected[] = {"arm", "coman", "walkman"};
    struct config_entry *entries;
    struct arena arena CLOSED_BY(arena_fini);
    size_t count;

    touch(built, "walkman.yaml");
    touch(built, "coman.yaml");
    touch(local, "coman.yaml");
    touch(installed, "arm.yaml");
    touch(installed, "README");
    touch(installed, ".yaml");
    touch(installed, "no.name.yaml");
    assert_ok(arena_init(&arena, 1 << 24, NULL));
    assert_ok(config_list_in(CONFIG_RIG, &trees, &arena, &entries, &count, NULL));
    assert_int_equal(count, 3);
    for (size_t i = 0; i < count; i++) {
        assert_string_equal(entries[i].name, expected[i]);
    }
    assert_memory_equal(entries[1].path, local, strlen(local));
}

TEST_WITH(a_path_that_is_too_long_is_refused, start, stop)
{
    static char name[2 * PATH_MAX];
    char path[PATH_MAX];

    memset(name, 'x', sizeof name - 1);
    assert_int_equal(config_locate_in(CONFIG_RIG, name, &trees, path, NULL), ERROR_INPUT);
    name[PATH_MAX - 1] = '\0';
    assert_int_equal(config_locate_in(CONFIG_RIG, name, &trees, path, NULL), ERROR_INPUT);
}

TEST(the_program_looks_in_etc)
{
    char path[PATH_MAX];

    assert_int_equal(config_locate(CONFIG_RIG, "hil-no-such-rig", path, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "/etc/coman-hil/rigs"));
}

/* By where it stands: also a link to it, and a rig of a folder that a tree is a link to. */
TEST_WITH(a_file_of_a_tree_is_installed_and_no_other, start, stop)
{
    char path[PATH_MAX], link[PATH_MAX], through[PATH_MAX];

    touch(built, "mine.yaml");
    snprintf(path, sizeof path, "%s/mine.yaml", built);
    assert_true(config_is_installed_in(&trees, path));
    snprintf(link, sizeof link, "%.100s/link", trees.folder[0]);
    assert_int_equal(symlink(built, link), 0);
    snprintf(through, sizeof through, "%.120s/mine.yaml", link);
    assert_true(config_is_installed_in(&trees, through));
    assert_int_equal(unlink(link), 0);
    snprintf(path, sizeof path, "%s/../../mine.yaml", built);
    assert_false(config_is_installed_in(&trees, path));
    snprintf(path, sizeof path, "%.120s-like", trees.folder[0]);
    assert_int_equal(mkdir(path, 0755), 0);
    strcat(path, "/mine.yaml");
    assert_false(config_is_installed_in(&trees, path));
    *strrchr(path, '/') = '\0';
    assert_int_equal(rmdir(path), 0);
    assert_false(config_is_installed_in(&trees, "/tmp/mine.yaml"));
    assert_false(config_is_installed_in(&trees, "mine.yaml"));
    assert_false(config_is_installed_in(&(struct config_trees){.folder = {""}}, path));
}
