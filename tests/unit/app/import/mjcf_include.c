/* SPDX-License-Identifier: Apache-2.0 */
/* MJCF in several files: where they are looked for, what comes of them, and what is refused. */
#include "app/import/readers.h"

#include <sys/stat.h>
#include <unistd.h>

#include "tests/unit/arena_fixture.h"
#include "tests/unit/app/put_file.h"

#define INERTIAL "<inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>"

static char folder[] = "/tmp/hil-import-include-XXXXXX";
static struct import_packages packages;
static struct import_model model;
static struct import_notes notes;
static struct error error;

FIXTURE(open_folder)
{
    char path[64];

    strcpy(folder + sizeof folder - 7, "XXXXXX");
    packages = (struct import_packages){0};
    if (open_arena(test_state) || !mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/model", folder);
    if (mkdir(path, 0700)) {
        return -1;
    }
    strcat(path, "/parts");
    return mkdir(path, 0700);
}

FIXTURE(remove_folder)
{
    char command[96];

    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return close_arena(test_state) || system(command);
}

static void put(const char *name, const char *text)
{
    char path[128];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    put_file(path, text);
}

/* Reads model/main.xml. */
static enum error_code read_main(void)
{
    struct xml_file file;
    char path[128];
    enum error_code code;

    snprintf(path, sizeof path, "%s/model/main.xml", folder);
    notes = (struct import_notes){.arena = &arena};
    assert_ok(xml_file_open(&file, path, &arena, &error));
    code = mjcf_read(&file, &packages, &arena, &model, &notes, &error);
    xml_file_close(&file);
    return code;
}

static void read_good(void)
{
    assert_no_error(read_main(), error.text);
}

static void read_bad(const char *place, const char *words)
{
    if (read_main() != ERROR_INPUT || !strstr(error.text, place) || !strstr(error.text, words)) {
        fail_msg("expected \"%s... %s\", found \"%s\"", place, words, error.text);
    }
}

TEST_WITH(includes_come_in_where_they_stand, open_folder, remove_folder)
{
    put("model/main.xml",
        "<mujoco><include file='parts/common.xml'/>\n<worldbody><body name='a'>" INERTIAL
        "<joint name='j'/>\n<include file='parts/leg.xml'/></body>"
        "</worldbody></mujoco>");
    put("model/parts/common.xml",
        "<mujocoinclude><compiler angle='radian'/>\n<default><joint range='-1 2'/></default>\n"
        "<include file='more.xml'/></mujocoinclude>");

    /* Beside the file that names it; the other name counts from the main file */
    put("model/parts/more.xml", "<mujoco><default><joint damping='3'/></default></mujoco>");
    put("model/parts/leg.xml", "<mujoco>\n<body name='leg'>" INERTIAL "<joint name='k'/>"
                               "<include file='parts/foot.xml'/></body></mujoco>");
    put("model/parts/foot.xml",
        "<mujoco>\n\n<body name='foot'>" INERTIAL "<joint name='l'/></body></mujoco>");
    read_good();
    assert_int_equal(model.njoint, 3);
    for (int j = 0; j < 3; j++) {
        assert_true(model.joint[j].upper == 2.0 && model.joint[j].damping == 3.0);
    }
    assert_string_equal(model.joint[2].parent, "leg");

    /* Each with its file and line */
    assert_non_null(strstr(model.joint[0].file, "/model/main.xml"));
    assert_non_null(strstr(model.joint[2].file, "/parts/foot.xml"));
    assert_int_equal(model.joint[2].line, 3);
}

TEST_WITH(what_is_wrong_in_an_included_file_is_told_with_its_place, open_folder, remove_folder)
{
    put("model/main.xml", "<mujoco><worldbody>\n<include file='parts/leg.xml'/></worldbody>"
                          "</mujoco>");
    put("model/parts/leg.xml", "<mujoco>\n\n\n<body name='leg'><joint axis='0 0 0'/></body>"
                               "</mujoco>");
    read_bad("/parts/leg.xml:4: ", "expected a direction");
    put("model/parts/leg.xml", "<mujoco>\n<body");
    read_bad("/parts/leg.xml:2: ", "no well-formed XML");
    assert_int_equal(unlink(strcat(strcpy((char[96]){0}, folder), "/model/parts/leg.xml")), 0);
    read_bad("/main.xml:2: ", "found no file \"parts/leg.xml\" to include");
    put("model/main.xml", "<mujoco><worldbody>\n<include/></worldbody></mujoco>");
    read_bad("/main.xml:2: ", "attribute \"file\"");
}

TEST_WITH(circles_and_repetitions_are_refused, open_folder, remove_folder)
{
    char name[64], text[128];

    put("model/main.xml", "<mujoco>\n<include file='parts/a.xml'/></mujoco>");
    put("model/parts/a.xml", "<mujoco>\n\n<include file='../main.xml'/></mujoco>");
    read_bad("/parts/a.xml:3: ", "was read before");
    put("model/parts/a.xml", "<mujoco>\n\n\n<include file='./../parts/a.xml'/></mujoco>");
    read_bad("/parts/a.xml:4: ", "was read before");

    /* A chain of files, each of which includes the next */
    for (int i = 0; i < 40; i++) {
        snprintf(name, sizeof name, "model/parts/c%d.xml", i);
        snprintf(text, sizeof text, "<mujoco><include file='c%d.xml'/></mujoco>", i + 1);
        put(name, text);
    }
    put("model/parts/c40.xml", "<mujoco/>");
    put("model/main.xml", "<mujoco>\n<include file='parts/c0.xml'/></mujoco>");
    read_bad("/parts/c15.xml:1: ", "more than 16 deep");
}

TEST_WITH(files_outside_the_folder_are_read_for_those_who_trust, open_folder, remove_folder)
{
    static const char *const outside[] = {"../secret.xml", "parts/../../secret.xml", "/etc/passwd",
                                          "link.xml", "../none.xml"};
    char link[96], text[128];

    put("secret.xml", "<mujoco><worldbody><body name='s'>" INERTIAL "<joint/></body></worldbody>"
                      "</mujoco>");
    snprintf(link, sizeof link, "%s/model/link.xml", folder);
    assert_int_equal(symlink("../secret.xml", link), 0);
    for (size_t i = 0; i < sizeof outside / sizeof *outside; i++) {
        snprintf(text, sizeof text, "<mujoco>\n<include file='%s'/></mujoco>", outside[i]);
        put("model/main.xml", text);
        read_bad("/main.xml:2: ", "--trust");
    }
    put("model/main.xml", "<mujoco>\n<include file='../secret.xml'/></mujoco>");
    packages.trust = true;
    read_good();
    assert_string_equal(model.link[1].name, "s");
}
