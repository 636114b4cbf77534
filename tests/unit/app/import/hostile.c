/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Ten megabytes of the worst that each reader can be given: it is read or refused with its place,
 * in processor time that grows with the size of the file, not with its square. Each case is tried
 * at a quarter of the size as well: a linear reader takes 4 times as long for the whole, n log n
 * some 4.4 times, a quadratic one 16 times. Processor time, not wall time, and the lower of several
 * tries, so that a busy machine does not matter.
 */
#include "app/import/import.h"
#include "app/import/readers.h"
#include "tests/test.h"

#include <time.h>

enum { SIZE = 10 << 20, SHARE = 4, TRIES = 3 };

#define RATIO_MOST 10.0

/* Below this nothing is measured: it is the time of what does not depend on the size. */
#define SECONDS_LEAST 0.4

enum reader { READ_ROBOT, READ_SRDF, READ_STL, READ_OBJ, READ_COLLADA };

/* ---- files ---- */

struct text {
    char *at, *end;
    size_t number; /* of repetitions so far */
};

/* Appends when there is room for it and for what ends the file. */
static bool put(struct text *text, const char *format, ...)
{
    va_list arguments;
    int used;

    va_start(arguments, format);
    used = vsnprintf(text->at, (size_t)(text->end - text->at), format, arguments);
    va_end(arguments);
    if (used < 0 || used >= text->end - text->at - 4096) {
        *text->at = '\0';
        return false;
    }
    text->at += used;
    text->number++;
    return true;
}

#define INERTIAL                                                                                   \
    "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"        \
    "</inertial>"
#define ARM                                                                                        \
    "<link name='base'>" INERTIAL "</link><link name='a'>" INERTIAL "</link><joint name='j' "      \
    "type='revolute'><parent link='base'/><child link='a'/><limit lower='-1' upper='1' "           \
    "effort='9' velocity='3'/></joint>"
#define BODY "<body><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/><joint name='j'/>"

/* How a file begins, what is repeated until it is full (with its number, up to three times), and
 * how it ends; what it says when it is refused, NULL when it is read, "" when its size decides. */
struct hostile {
    const char *name;
    enum reader reader;
    const char *begin, *repeat, *end, *words;
};

static const struct hostile cases[] = {
    /* XML */
    {"attributes", READ_ROBOT, "<robot name='r'>\n<link", " a%zu=''", "/></robot>",
     "attributes of one element"},
    {"attributes of a closing tag that a comment hides", READ_ROBOT,
     "<robot name='r'>\n<!-- \x01 <link", " a%zu=''", "/> --></robot>",
     "attributes of one element"},
    {"attributes with blanks before their values", READ_ROBOT, "<robot name='r'>\n<link",
     "\na%zu\t= \n \"\"", "/></robot>", "attributes of one element"},
    {"namespaces in scope", READ_ROBOT, "<robot name='r'>\n", "<a xmlns:n%zu='u%zu'/>", "</robot>",
     "namespaces"},
    {"prefixed elements", READ_ROBOT, "<robot name='r' xmlns:p='u' xmlns:q='v'>\n", "<p:a q:b=''/>",
     "</robot>", "elements"},
    {"depth", READ_ROBOT, "<robot name='r'>\n", "<a>", "", "no well-formed XML"},
    {"a name", READ_ROBOT, "<robot name='r'>\n<", "aaaaaaaaaaaaaaaa", "/></robot>",
     "no well-formed XML"},
    {"a value", READ_ROBOT, "<robot name='r'>" ARM "\n<link name='", "long%zu", "'/></robot>", ""},
    {"lines", READ_ROBOT, "<robot name='r'>" ARM, "\n", "</robot>", ""},
    {"comments", READ_ROBOT, "<robot name='r'>" ARM, "<!--%zu-->", "</robot>", NULL},
    {"an equals sign before blanks", READ_ROBOT, "<robot name='r'>" ARM "<a b=", " = ",
     "/></robot>", "no well-formed XML"},
    {"entities of characters", READ_ROBOT, "<robot name='r'>" ARM "\n<a b='", "&#65;",
     "'/></robot>", ""},

    /* URDF and SRDF */
    {"elements", READ_ROBOT, "<robot name='r'>" ARM "\n", "<a/>\n", "</robot>", "65536 elements"},
    {"transmissions", READ_ROBOT, "<robot name='r'>" ARM "\n",
     "<transmission><joint name='x%zu'/></transmission>\n", "</robot>", "65536 elements"},
    {"links", READ_ROBOT, "<robot name='r'>\n", "<link name='l%zu'/>\n", "</robot>",
     "65536 elements"},
    {"a long list of numbers", READ_ROBOT,
     "<robot name='r'>\n<link name='l'><inertial><origin xyz='", "1 ",
     "'/></inertial></link></robot>", ""},
    {"poses", READ_SRDF, "<robot name='r'>\n", "<group_state name='p%zu'/>\n", "</robot>",
     "65536 elements"},
    {"positions of a pose", READ_SRDF, "<robot name='r'><group_state name='p'>\n",
     "<joint name='j%zu' value='1'/>\n", "</group_state></robot>", "65536 elements"},

    /* MJCF */
    {"default classes", READ_ROBOT, "<mujoco><default>\n", "<default class='c%zu'/>\n",
     "</default><worldbody>" BODY "</body></worldbody></mujoco>", "65536 elements"},
    {"meshes", READ_ROBOT, "<mujoco><asset>\n", "<mesh name='m%zu' file='f'/>\n",
     "</asset><worldbody>" BODY "</body></worldbody></mujoco>", "65536 elements"},
    {"geoms", READ_ROBOT, "<mujoco><worldbody>" BODY "\n", "<geom size='1'/>\n",
     "</body></worldbody></mujoco>", "65536 elements"},
    {"bodies in bodies", READ_ROBOT, "<mujoco><worldbody>\n", "<body>", "", "no well-formed XML"},
    {"sections", READ_ROBOT, "<mujoco><worldbody>" BODY "</body></worldbody>\n", "<actuator/>\n",
     "</mujoco>", "65536 elements"},
    {"a long pose", READ_ROBOT,
     "<mujoco><worldbody>" BODY "</body></worldbody><keyframe>\n<key qpos='", "1 ",
     "'/></keyframe></mujoco>", ""},

    /* Meshes */
    {"corners", READ_STL, "solid s\nfacet\nouter loop\n", "vertex 0 %zu 1\n", "endloop\n",
     "endfacet"},
    {"facets", READ_STL, "solid s\n",
     "facet\nvertex 0 0 %zu\nvertex 1 0 %zu\nvertex 0 1 %zu\nendfacet\n", "endsolid\n", NULL},
    {"a line", READ_STL, "solid s ", "abc ", "\nendsolid\n", "no face"},
    {"one word", READ_STL, "solid s ", "abcd", "\nendsolid\n", "no face"},
    {"vertices", READ_OBJ, "", "v 0 0 %zu\n", "", "no face"},
    {"vertices of one place", READ_OBJ, "v 1 0 0\nv 0 1 0\nf 1 2 3\n", "v 0 0 0\n", "",
     "expected 1 to 2"},
    {"faces on one edge", READ_OBJ, "v 0 0 0\nv 1 0 0\n", "v 0.000000 1.000000 %zu.000\nf 1 2 -1\n",
     "", NULL},
    {"faces", READ_OBJ, "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "f 1/1/1 2/2/2 3/3/3\n", "", NULL},
    {"a polygon", READ_OBJ, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf", " 1", "\n", "a polygon of at most 256"},
    {"a number", READ_OBJ, "v 1", "00000000", " 0 0\n", "expected a finite decimal number"},
    {"empty lines", READ_OBJ, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "\n", "", NULL},
    {"ids", READ_COLLADA, "<COLLADA>\n", "<a id='i%zu'/>\n", "</COLLADA>", "without a scene"},
    {"one id for all", READ_COLLADA, "<COLLADA><library_visual_scenes><visual_scene>\n",
     "<instance_node url='#i'/><a id='i'/>\n", "</visual_scene></library_visual_scenes></COLLADA>",
     "the id of a <node>"},
    {"a node in many places", READ_COLLADA,
     "<COLLADA><node id='n'><a/><a/><a/><a/><a/><a/><a/><a/><a/><a/><a/><a/><a/></node>"
     "<library_visual_scenes><visual_scene>\n",
     "<instance_node url='#n'/>", "</visual_scene></library_visual_scenes></COLLADA>", ""},
    {"attributes of a mesh", READ_COLLADA, "<COLLADA\n", " a%zu=''", "/>",
     "attributes of one element"},
};

/* The file, on the heap. */
static char *make_file(const struct hostile *h, size_t size, size_t *used)
{
    char *file = malloc(size + 1);
    struct text text = {.at = file, .end = file ? file + size : NULL};

    assert_non_null(file);
    assert_true(put(&text, "%s", h->begin));
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    while (put(&text, h->repeat, text.number, text.number, text.number)) {
    }
#pragma GCC diagnostic pop
    text.end += 4096;
    *used = (size_t)(text.at - file) + strlen(h->end);
    assert_true(*used < size);
    strcpy(text.at, h->end);
    return file;
}

/* A mesh of parts that stand in it twice as many times with each further one would be small; what
 * is long in it is one list, named by many. */
static char *make_instances(size_t size, size_t *used)
{
    static const struct hostile half = {
        .begin = "<COLLADA><library_geometries><geometry id='g'><mesh><a/>",
        .repeat = "<a/>",
        .end = "</mesh></geometry></library_geometries><library_visual_scenes><visual_scene>"};
    char *file = make_file(&half, size / 2, used), *whole = malloc(size + 1);
    struct text text = {.at = whole, .end = whole ? whole + size : NULL};

    assert_non_null(whole);
    memcpy(whole, file, *used);
    text.at += *used;
    free(file);
    while (put(&text, "<instance_geometry url='#g'/>")) {
    }
    strcpy(text.at, "</visual_scene></library_visual_scenes></COLLADA>");
    *used = strlen(whole);
    return whole;
}

/* ---- reading ---- */

static enum error_code read_robot(const char *text, size_t size, struct arena *arena,
                                  struct error *error)
{
    const struct import_options options = {0};
    struct import_model model;
    struct import_notes notes = {0};
    struct import_robot made;
    double supply_v;

    return import_model_text("x.urdf", text, size, &options, arena, &model, &notes, &made,
                             &supply_v, error);
}

static enum error_code read_srdf(const char *text, size_t size, struct arena *arena,
                                 struct error *error)
{
    struct import_model model = {.file = "x.urdf", .name = "r"};
    struct import_notes notes = {.arena = arena};
    struct xml_file file;
    enum error_code code = xml_text_open(&file, "x.srdf", text, size, error);

    if (!code) {
        code = srdf_read(&file, arena, &model, &notes, error);
        xml_file_close(&file);
    }
    return code;
}

static enum error_code read_file(enum reader reader, const char *text, size_t size,
                                 struct error *error)
{
    static const char *const name[] = {
        [READ_STL] = "x.stl", [READ_OBJ] = "x.obj", [READ_COLLADA] = "x.dae"};
    static const double one[3] = {1, 1, 1};
    struct import_mesh mesh;
    struct arena arena = {0};
    enum error_code code;

    assert_ok(arena_init(&arena, (size_t)2 << 30, NULL));
    code = reader == READ_ROBOT ? read_robot(text, size, &arena, error)
           : reader == READ_SRDF
               ? read_srdf(text, size, &arena, error)
               : import_parse_mesh(name[reader], false, text, size, one, &arena, &mesh, error);
    arena_fini(&arena);
    return code;
}

static double cpu_seconds(void)
{
    struct timespec now;

    assert_int_equal(clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now), 0);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* All cases are tried before any fails the test. */
static int failures;

/* The processor time of reading a file; what it says is checked. */
static double time_file(const char *name, enum reader reader, const char *words, const char *file,
                        size_t size)
{
    struct error error = {0};
    double begin = cpu_seconds();
    enum error_code code = read_file(reader, file, size, &error);
    double took = cpu_seconds() - begin;

    bool as_said = !words ? code == ERROR_NONE
                          : (code == ERROR_INPUT && strstr(error.text, words)) ||
                                (!*words && code == ERROR_NONE);

    if (!as_said) {
        print_error("%s: expected %s, found \"%s\"\n", name, words ? words : "nothing wrong",
                    error.text);
        failures++;
    }
    return took;
}

static void check_growth(const char *name, enum reader reader, const char *words, char *file[2],
                         const size_t size[2])
{
    double took[2] = {0, 0}, ratio = 0.0;

    for (int try = 0; try < TRIES; try++) {
        for (int i = 0; i < 2; i++) {
            double now = time_file(name, reader, words, file[i], size[i]);

            took[i] = try == 0 || now < took[i] ? now : took[i];
        }
        ratio = took[1] / (took[0] > SECONDS_LEAST / SHARE ? took[0] : SECONDS_LEAST / SHARE);
        if (ratio < RATIO_MOST) {
            break;
        }
    }
    print_message("# %-48s %5.2f s, %4.1f times that of a quarter\n", name, took[1], ratio);
    if (ratio >= RATIO_MOST) {
        print_error("%s: %.2f s for %zu bytes, %.2f s for %zu\n", name, took[1], size[1], took[0],
                    size[0]);
        failures++;
    }
}

/* As many faces as a binary STL of that size has, all of them at one place but for the last. */
static char *make_binary(size_t size, size_t *used)
{
    char *file = calloc(size + 1, 1);
    uint32_t faces = (uint32_t)((size - 84) / 50);

    assert_non_null(file);
    memcpy(file + 80, &faces, sizeof faces);
    *used = 84 + (size_t)faces * 50;
    memcpy(file + *used - 50 + 12, (const float[9]){0, 0, 0, 1, 0, 0, 0, 1, 0}, 36);
    return file;
}

TEST(work_grows_with_the_size_of_the_file)
{
    static const struct hostile made[] = {
        {.name = "a long geometry in many places", .reader = READ_COLLADA, .words = "too often"},
        {.name = "faces of a binary STL", .reader = READ_STL, .words = NULL},
    };
    const size_t count = sizeof cases / sizeof *cases;

    failures = 0;
    for (size_t i = 0; i < count + 2; i++) {
        const struct hostile *h = i < count ? &cases[i] : &made[i - count];
        size_t size[2];
        char *file[2];

        for (int k = 0; k < 2; k++) {
            const size_t whole = k ? SIZE : SIZE / SHARE;

            file[k] = i < count    ? make_file(h, whole, &size[k])
                      : i == count ? make_instances(whole, &size[k])
                                   : make_binary(whole, &size[k]);
        }
        check_growth(h->name, h->reader, h->words, file, size);
        free(file[0]);
        free(file[1]);
    }
    assert_int_equal(failures, 0);
}

/* Sensors on a chain of fixed joints: each bears all links below it. */
TEST(sensors_on_a_long_chain_are_summed_in_one_walk_each)
{
    static const int links[2] = {1000, 4000};
    size_t size[2];
    char *file[2];

    for (int i = 0; i < 2; i++) {
        struct text text;

        file[i] = malloc(SIZE);
        assert_non_null(file[i]);
        text = (struct text){.at = file[i], .end = file[i] + SIZE};
        put(&text, "<robot name='r'>" ARM);
        for (int l = 0; l < links[i]; l++) {
            char parent[16] = "a";

            if (l > 0) {
                snprintf(parent, sizeof parent, "l%d", l - 1);
            }
            put(&text,
                "<link name='l%d'/><joint name='f%d' type='fixed'><parent link='%s'/><child "
                "link='l%d'/></joint><sensor name='s%d' type='force_torque'><parent "
                "joint='f%d'/></sensor>\n",
                l, l, parent, l, l, l);
        }
        put(&text, "</robot>");
        size[i] = (size_t)(text.at - file[i]);
    }

    /* Names are looked for among all: 16 times the work for 4 times the links is allowed, which
     * the bound on links keeps small; 64 times is not */
    {
        double few = time_file("sensors", READ_ROBOT, NULL, file[0], size[0]);
        double many = time_file("sensors", READ_ROBOT, NULL, file[1], size[1]);

        assert_true(many < 30.0 * (few > 0.02 ? few : 0.02));
    }
    free(file[0]);
    free(file[1]);
}
