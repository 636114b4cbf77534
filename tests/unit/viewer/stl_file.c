/* SPDX-License-Identifier: Apache-2.0 */
/* Files of visuals: what is a binary STL is passed on as it is, all else is refused in words. */
#include "viewer/private.h"
#include "tests/test.h"

#include <sys/stat.h>
#include <unistd.h>

enum { VISUALS = 3 };

static char folder[] = "/tmp/hil-visual-XXXXXX", path[64];
static struct robot_visual visual[VISUALS] = {{.name = "a", .file = path}, {.name = "b"}};
static struct robot robot = {.visual = visual, .nvisual = VISUALS};
static const struct rig rig = {.robot = &robot};
static struct viewer_file file[VISUALS];
static struct viewer *viewer;
static struct error error;

FIXTURE(open_viewer)
{
    strcpy(folder + sizeof folder - 7, "XXXXXX");
    memset(file, 0, sizeof file);
    viewer = calloc(1, sizeof *viewer);
    if (!viewer || !mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/a.stl", folder);
    viewer->rig = &rig;
    viewer->visual = file;
    return 0;
}

FIXTURE(close_viewer)
{
    for (int i = 0; i < VISUALS; i++) {
        free((void *)(uintptr_t)file[i].data);
    }
    free(viewer);
    (void)unlink(path);
    return rmdir(folder);
}

/* A file that says it has so many faces and has so many bytes. */
static void write_stl(uint32_t faces, size_t size)
{
    unsigned char bytes[512];
    FILE *out = fopen(path, "w");

    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (unsigned char)i;
    }
    for (int i = 0; i < 4; i++) {
        bytes[80 + i] = (unsigned char)(faces >> 8 * i);
    }
    assert_non_null(out);
    assert_int_equal(fwrite(bytes, 1, size, out), size);
    assert_int_equal(fclose(out), 0);
}

TEST_WITH(a_sound_file_is_passed_on_byte_for_byte, open_viewer, close_viewer)
{
    const struct viewer_file *got;

    write_stl(2, 184);
    assert_ok(viewer_check_visual(viewer->rig->robot->visual, &error));
    got = viewer_visual_file(viewer, 0, &error);
    assert_non_null(got);
    assert_int_equal(got->size, 184);
    assert_int_equal(((const unsigned char *)got->data)[183], 183);
    assert_int_equal(viewer->visual_bytes, 184);

    /* Once: the file may go */
    assert_int_equal(unlink(path), 0);
    assert_ptr_equal(viewer_visual_file(viewer, 0, &error), got);
    assert_null(viewer_visual_file(viewer, 1, &error)); /* no mesh */
}

TEST_WITH(what_is_no_stl_is_refused_by_name, open_viewer, close_viewer)
{
    static const struct {
        uint32_t faces;
        size_t size;
    } cases[] = {{2, 183}, {2, 185}, {0, 0}, {0, 83}, {UINT32_MAX, 184}, {0x33333333, 134}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_stl(cases[i].faces, cases[i].size);
        assert_null(viewer_visual_file(viewer, 0, &error));
        assert_non_null(strstr(error.text, "a.stl: found"));
        error.text[0] = '\0';
        assert_int_equal(viewer_check_visual(viewer->rig->robot->visual, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, "a.stl: found"));
        assert_non_null(strstr(error.text, "expected a binary STL file"));
    }
    assert_int_equal(unlink(path), 0);
    assert_null(viewer_visual_file(viewer, 0, &error));
    assert_non_null(strstr(error.text, "a.stl: cannot be read"));

    /* A pipe would wait for a writer for ever */
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_null(viewer_visual_file(viewer, 0, &error));
    assert_non_null(strstr(error.text, "no regular file"));
}

TEST_WITH(all_visuals_together_are_bounded, open_viewer, close_viewer)
{
    write_stl(2, 184);
    viewer->visual_bytes = VIEWER_VISUAL_BYTES - 183;
    assert_null(viewer_visual_file(viewer, 0, &error));
    assert_non_null(strstr(error.text, "at most 128 MB"));
    viewer->visual_bytes--;
    assert_non_null(viewer_visual_file(viewer, 0, &error));
}

TEST_WITH(the_same_file_is_asked_for_once, open_viewer, close_viewer)
{
    visual[2].file = "other.stl";
    assert_int_equal(viewer_visual_source(&robot, 2), 2);
    visual[2].file = path;
    assert_int_equal(viewer_visual_source(&robot, 2), 0);
    visual[2].file = NULL;
}
