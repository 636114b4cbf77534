/* SPDX-License-Identifier: Apache-2.0 */
/* Meshes of foreign robots: formats, scales, joined corners, hostile bytes. */
#include "app/import/mesh_private.h"
#include "contact/mesh/mesh.h"

#include <sys/stat.h>
#include <unistd.h>

#include "tests/physics/near.h"
#include "tests/unit/arena_fixture.h"
#include "tests/unit/app/put_file.h"

static const double one[3] = {1, 1, 1};

/* A tetrahedron of edge 1 at the origin: volume 1/6. */
static const double corner[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const int tetrahedron[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

static struct import_mesh mesh;
static struct error error;

static void put_word(unsigned char *to, uint32_t word)
{
    for (int i = 0; i < 4; i++) {
        to[i] = (unsigned char)(word >> 8 * i);
    }
}

static void put_float(unsigned char *to, double value)
{
    float single = (float)value;
    uint32_t word;

    memcpy(&word, &single, sizeof word);
    put_word(to, word);
}

static size_t make_binary_stl(unsigned char bytes[512])
{
    unsigned char *at = bytes + 84;

    memset(bytes, 0, 512);
    memcpy(bytes, "solid it is not", 15);
    put_word(bytes + 80, 4);
    for (int f = 0; f < 4; f++, at += 50) {
        for (int c = 0; c < 3; c++) {
            for (int m = 0; m < 3; m++) {
                put_float(at + 12 * (c + 1) + 4 * m, corner[tetrahedron[f][c]][m]);
            }
        }
    }
    return 84 + 4 * 50;
}

static double mesh_signed_volume(void)
{
    const struct mesh surface = {.nvertex = mesh.nvertex,
                                 .nface = mesh.nface,
                                 .vertex = (const double(*)[3])mesh.vertex,
                                 .face = (const int(*)[3])mesh.face};
    struct mesh_finding finding;

    assert_ok(mesh_check(&surface, &finding, NULL));
    assert_int_equal(finding.fault, MESH_SOUND);
    return mesh_volume(&surface);
}

TEST_WITH(binary_stl_joins_its_corners, open_arena, close_arena)
{
    unsigned char bytes[512];
    size_t size = make_binary_stl(bytes);

    assert_ok(
        import_parse_mesh("x.STL", false, (const char *)bytes, size, one, &arena, &mesh, &error));
    assert_int_equal(mesh.nvertex, 4);
    assert_int_equal(mesh.nface, 4);
    assert_near(mesh_signed_volume(), 1.0 / 6.0, 1e-15);
}

TEST_WITH(scales_measure_and_mirror, open_arena, close_arena)
{
    static const double millimeters[3] = {0.001, 0.001, 0.001}, mirrored[3] = {1, -2, 1};
    unsigned char bytes[512];
    size_t size = make_binary_stl(bytes);

    assert_ok(import_parse_mesh("x.stl", false, (const char *)bytes, size, millimeters, &arena,
                                &mesh, &error));
    assert_near(mesh_signed_volume(), 1e-9 / 6.0, 1e-20);
    assert_ok(import_parse_mesh("x.stl", false, (const char *)bytes, size, mirrored, &arena, &mesh,
                                &error));
    assert_near(mesh_signed_volume(), 2.0 / 6.0, 1e-15);
}

TEST_WITH(text_stl_and_obj_are_the_same, open_arena, close_arena)
{
    char text[4096] = "solid x\n";
    static const char obj[] =
        "# a comment\nmtllib x.mtl\no it\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
        "vn 0 0 1\nf 1//1 3//1 2//1\nf 1/1/1 2/1/1 4/1/1\nf -4 -1 -2\nf 2 3 4\n";

    for (int f = 0; f < 4; f++) {
        strcat(text, "facet normal 0 0 0\r\n outer loop\r\n");
        for (int c = 0; c < 3; c++) {
            const double *v = corner[tetrahedron[f][c]];

            snprintf(text + strlen(text), sizeof text - strlen(text), "  vertex %g %g %g\r\n", v[0],
                     v[1], v[2]);
        }
        strcat(text, " endloop\r\nendfacet\r\n");
    }
    strcat(text, "endsolid x\n");
    assert_ok(import_parse_mesh("x.stl", false, text, strlen(text), one, &arena, &mesh, &error));
    assert_near(mesh_signed_volume(), 1.0 / 6.0, 1e-15);
    assert_ok(import_parse_mesh("x.obj", false, obj, strlen(obj), one, &arena, &mesh, &error));
    assert_int_equal(mesh.nface, 4);
    assert_near(mesh_signed_volume(), 1.0 / 6.0, 1e-15);
}

/* ---- colors ---- */

static void expect_color(int tint, double red, double green, double blue)
{
    assert_in_range(tint, 0, mesh.ncolor - 1);
    assert_near(mesh.color[tint][0], red, 1e-9);
    assert_near(mesh.color[tint][1], green, 1e-9);
    assert_near(mesh.color[tint][2], blue, 1e-9);
    assert_near(mesh.color[tint][3], 1.0, 0.0);
}

/* Writes a file of that name into a folder. */
static void write_text(const char *folder, const char *name, const char *text)
{
    char path[128];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    put_file(path, text);
}

/* Faces before the first usemtl, and of a material that is not there, have no color. */
TEST_WITH(an_obj_has_the_colors_of_its_materials, open_arena, close_arena)
{
    static const char obj[] = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\n"
                              "usemtl red\nf 1 2 4\nusemtl sky\nf 1 4 3\nusemtl none\nf 2 3 4\n";
    char folder[] = "/tmp/import-mesh-XXXXXX", path[64];

    assert_non_null(mkdtemp(folder));
    write_text(folder, "b.obj", obj);
    write_text(folder, "m.mtl",
               "# two\nKd 9 9 9\nnewmtl red\nKa 0 0 0\nKd 0.8 0.1 0\nmap_Kd skin.png\n\n"
               "newmtl sky\n  Kd 0.2 0.4 2\nnewmtl dull\nKd x\n");
    snprintf(path, sizeof path, "%s/b.obj", folder);
    assert_ok(import_read_mesh(path, one, &arena, &mesh, &error));
    assert_int_equal(mesh.nface, 4);
    assert_int_equal(mesh.tint[0], -1);
    expect_color(mesh.tint[1], 0.8, 0.1, 0.0);
    expect_color(mesh.tint[2], 0.2, 0.4, 1.0);
    assert_int_equal(mesh.tint[3], -1);
    assert_non_null(strstr(mesh.remark, "skin.png"));

    /* Without a path no file is read, and from a path only what is beside it */
    assert_ok(import_parse_mesh("b.obj", false, obj, strlen(obj), one, &arena, &mesh, &error));
    assert_int_equal(mesh.ncolor, 0);
    write_text(folder, "b.obj", "mtllib ../m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_ok(import_read_mesh(path, one, &arena, &mesh, &error));
    assert_non_null(strstr(mesh.remark, "expected a file beside it"));
    write_text(folder, "b.obj", "mtllib n.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_ok(import_read_mesh(path, one, &arena, &mesh, &error));
    assert_non_null(strstr(mesh.remark, "cannot be read"));
    snprintf(path, sizeof path, "rm -r '%s'", folder);
    assert_int_equal(system(path), 0);
}

/* More colors than there is room for become the nearest ones. */
TEST_WITH(colors_are_bounded, open_arena, close_arena)
{
    mesh = (struct import_mesh){0};
    for (int i = 0; i <= 200; i++) {
        const double color[4] = {i * 5e-3, 0.0, 0.0, 1.0};
        int tint = mesh_find_tint(&mesh, color);

        assert_in_range(tint, 0, IMPORT_COLORS_MAX - 1);
        assert_true(i >= IMPORT_COLORS_MAX || tint == i);
    }
    assert_int_equal(mesh.ncolor, IMPORT_COLORS_MAX);
    assert_int_equal(mesh_find_tint(&mesh, (double[4]){1, 0, 0, 1}), IMPORT_COLORS_MAX - 1);
}

/* What is written for one tint is read back as its faces, and no others. */
TEST_WITH(faces_of_a_tint_are_written_as_stl, open_arena, close_arena)
{
    unsigned char bytes[512];
    size_t size = make_binary_stl(bytes);
    char path[] = "/tmp/import-tint-XXXXXX.stl";
    int fd = mkstemps(path, 4);

    assert_true(fd >= 0);
    close(fd);
    assert_ok(
        import_parse_mesh("x.stl", false, (const char *)bytes, size, one, &arena, &mesh, &error));
    mesh.tint[2] = 0;
    assert_int_equal(import_count_tint(&mesh, 0), 1);
    assert_int_equal(import_count_tint(&mesh, -1), 3);
    assert_ok(import_write_tint(&mesh, -1, path, &error));
    mesh.tint[2] = -1;
    assert_ok(import_read_mesh(path, one, &arena, &mesh, &error));
    assert_int_equal(mesh.nface, 3);
    assert_int_equal(mesh.nvertex, 4);
    unlink(path);
}

/* ---- COLLADA ---- */

/* The tetrahedron as positions after a leading number, with texture coordinates beside. */
#define DAE_BEGIN                                                                                  \
    "<?xml version='1.0'?>\n<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema'"         \
    " version='1.4.1'><asset><unit name='cm' meter='0.01'/><up_axis>Y_UP</up_axis></asset>\n"      \
    "<library_geometries><geometry id='g'><mesh><source id='s'><float_array id='a' count='17'>"    \
    "9 0 0 0 7 1 0 0 7 0 1 0\n7 0 0 1 7</float_array><technique_common><accessor source='#a'"      \
    " count='4' stride='4' offset='1'/></technique_common></source>"                               \
    "<vertices id='v'><input semantic='POSITION' source='#s'/></vertices>\n"
#define DAE_INPUTS                                                                                 \
    "<input semantic='TEXCOORD' source='#s' offset='0'/><input semantic='VERTEX' source='#v'"      \
    " offset='1'/>"
#define DAE_TRIANGLES                                                                              \
    "<triangles count='4'>" DAE_INPUTS "<p>0 0 0 2 0 1 0 0 0 1 0 3 0 0 0 3 0 2 0 1 0 2 0 3"        \
    "</p></triangles>"
#define DAE_MIDDLE                                                                                 \
    "</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id='x'>\n"
#define DAE_END                                                                                    \
    "</visual_scene></library_visual_scenes><scene><instance_visual_scene url='#x'/></scene>"      \
    "</COLLADA>\n"
#define DAE_SHOW "<instance_geometry url='#g'/>"

static enum error_code parse_dae(const char *text)
{
    return import_parse_mesh("x.dae", false, text, strlen(text), one, &arena, &mesh, &error);
}

static void expect_dae(const char *text, size_t faces, double volume)
{
    assert_no_error(parse_dae(text), error.text);
    assert_int_equal(mesh.nface, faces);
    assert_near(mesh_signed_volume(), volume, 1e-15 + 1e-12 * volume);
}

TEST_WITH(collada_scenes_are_put_together, open_arena, close_arena)
{
    /* Centimeters; a node that scales and mirrors, within one that turns and moves */
    expect_dae(DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE "<node>" DAE_SHOW "</node>" DAE_END, 4,
               1e-6 / 6.0);
    expect_dae(DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE
               "<node><translate>100 0 0</translate><rotate>0 0 1 90</rotate><node>"
               "<scale>2 -3 1</scale>" DAE_SHOW "</node></node>" DAE_END,
               4, 1e-6);
    /* (0, -3, 0) turns to (3, 0, 0): between x = 1 and 1.03 m, y between 0 and 0.02 */
    for (size_t v = 0; v < mesh.nvertex; v++) {
        assert_true(mesh.vertex[v][0] > 1.0 - 1e-12 && mesh.vertex[v][0] < 1.03 + 1e-12);
        assert_true(mesh.vertex[v][1] > -1e-12 && mesh.vertex[v][1] < 0.02 + 1e-12);
    }
    /* The same by a matrix, twice, once through a library of nodes */
    expect_dae(
        DAE_BEGIN DAE_TRIANGLES
        "</mesh></geometry></library_geometries><library_nodes><node id='n'>" DAE_SHOW
        "</node></library_nodes><library_visual_scenes><visual_scene id='x'>"
        "<node><matrix>0 3 0 100 2 0 0 0 0 0 1 0 0 0 0 1</matrix><instance_node url='#n'/>"
        "</node><node><translate>-500 0 0</translate><instance_node url='#n'/></node>" DAE_END,
        8, 1e-6 + 1e-6 / 6.0);
}

#define DAE_EFFECT(id, shader)                                                                     \
    "<effect id='" id "'><profile_COMMON><technique>" shader                                       \
    "</technique></profile_COMMON></effect>"
#define DAE_COLOR(text) "<diffuse><color>" text "</color></diffuse>"
#define DAE_FACE(symbol, corners)                                                                  \
    "<triangles material='" symbol "' count='1'>" DAE_INPUTS "<p>" corners "</p></triangles>"

/* By symbol, binding, material, effect and shader; each link that leads nowhere is no color. */
TEST_WITH(collada_faces_have_the_colors_that_are_bound, open_arena, close_arena)
{
    static const char *const part[] = {
        DAE_BEGIN,
        DAE_FACE("a", "0 0 0 2 0 1"),
        DAE_FACE("b", "0 0 0 1 0 3"),
        DAE_FACE("c", "0 0 0 3 0 2"),
        DAE_FACE("d", "0 1 0 2 0 3"),
        "</mesh></geometry></library_geometries><library_effects>",
        DAE_EFFECT("red", "<phong>" DAE_COLOR("1 0 0 0.5") "</phong>"),
        DAE_EFFECT("lit", "<constant><emission><color>0 0.5 1 1</color></emission></constant>"),
        DAE_EFFECT("skin", "<lambert><diffuse><texture texture='t'/></diffuse></lambert>"),
        "</library_effects><library_materials>",
        "<material id='A'><instance_effect url='#red'/></material>",
        "<material id='B'><instance_effect url='#lit'/></material>",
        "<material id='C'><instance_effect url='#skin'/></material>",
        "<material id='D'><instance_effect url='#none'/></material></library_materials>",
        "<library_visual_scenes><visual_scene id='x'><node><instance_geometry url='#g'>",
        "<bind_material><technique_common><instance_material symbol='b' target='#B'/>",
        "<instance_material symbol='a' target='#A'/><instance_material symbol='c' target='#C'/>",
        "<instance_material symbol='d' target='#D'/></technique_common></bind_material>",
        "</instance_geometry></node><node><translate>5 0 0</translate>" DAE_SHOW "</node>",
        DAE_END,
    };
    char text[4096] = "";

    for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
        strcat(text, part[i]);
    }
    assert_no_error(parse_dae(text), error.text);
    assert_int_equal(mesh.nface, 8);
    expect_color(mesh.tint[0], 1.0, 0.0, 0.0);
    expect_color(mesh.tint[1], 0.0, 0.5, 1.0);
    for (int face = 2; face < 8; face++) {
        assert_int_equal(mesh.tint[face], -1);
    }
    assert_non_null(strstr(mesh.remark, "texture"));
}

TEST_WITH(collada_faces_of_every_kind_are_read, open_arena, close_arena)
{
    expect_dae(DAE_BEGIN
               "<polylist count='4'>" DAE_INPUTS
               "<vcount>3 3 3 3</vcount><p>0 0 0 2 0 1 0 0 0 1 0 3 0 0 0 3 0 2 0 1 0 2 0 3"
               "</p></polylist>" DAE_MIDDLE "<node>" DAE_SHOW "</node>" DAE_END,
               4, 1e-6 / 6.0);
    expect_dae(DAE_BEGIN "<polygons count='4'>" DAE_INPUTS
                         "<p>0 0 0 2 0 1</p><p>0 0 0 1 0 3</p><p>0 0 0 3 0 2</p><p>0 1 0 2 0 3</p>"
                         "</polygons>" DAE_MIDDLE "<node>" DAE_SHOW "</node>" DAE_END,
               4, 1e-6 / 6.0);
    /* A strip winds every second face the other way: 0 2 1, 1 2 3, 1 3 0, 0 3 2 */
    expect_dae(DAE_BEGIN "<tristrips count='1'>" DAE_INPUTS
                         "<p>0 0 0 2 0 1 0 3 0 0 0 2</p></tristrips>" DAE_MIDDLE "<node>" DAE_SHOW
                         "</node>" DAE_END,
               4, 1e-6 / 6.0);
    expect_dae(DAE_BEGIN "<trifans count='2'>" DAE_INPUTS "<p>0 0 0 2 0 1 0 3 0 2</p>"
                         "<p>0 1 0 2 0 3</p></trifans>" DAE_MIDDLE "<node>" DAE_SHOW
                         "</node>" DAE_END,
               4, 1e-6 / 6.0);
}

TEST_WITH(wrong_collada_is_refused, open_arena, close_arena)
{
    static const struct {
        const char *text, *words;
    } cases[] = {
        {"<COLLADA", "x.dae:1: "},
        {"<!DOCTYPE x [<!ENTITY a 'b'>]><COLLADA/>", "document type"},
        {"<robot/>", "expected <COLLADA>"},
        {"<COLLADA/>", "without a scene"},
        {"<COLLADA><asset><unit meter='0'/></asset></COLLADA>", "of another size"},
        {"<COLLADA><library_visual_scenes><visual_scene/></library_visual_scenes></COLLADA>",
         "no face"},
        {DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE "<node><instance_geometry url='#h'/></node>" DAE_END,
         "x.dae:6: found url \"#h\""},
        {DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE "<node><matrix>1 2 3</matrix></node>" DAE_END,
         "expected 16 finite numbers"},
        {DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE "<node><lookat>1</lookat></node>" DAE_END, "<lookat>"},
        {DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE "<node><instance_controller/></node>" DAE_END,
         "a skin"},
        {DAE_BEGIN DAE_TRIANGLES DAE_MIDDLE "<node id='n'>" DAE_SHOW
                                            "<instance_node url='#n'/></node>" DAE_END,
         "too deep"},
        {DAE_BEGIN "<triangles>" DAE_INPUTS "<p>0 0 0 2 0 4</p></triangles>" DAE_MIDDLE
                   "<node>" DAE_SHOW "</node>" DAE_END,
         "found \"4\" in <p>"},
        {DAE_BEGIN "<triangles>" DAE_INPUTS "<p>0 0 0 2 0</p></triangles>" DAE_MIDDLE
                   "<node>" DAE_SHOW "</node>" DAE_END,
         "ends within a corner"},
        {DAE_BEGIN "<triangles>" DAE_INPUTS "<p>0 0 0 2</p></triangles>" DAE_MIDDLE
                   "<node>" DAE_SHOW "</node>" DAE_END,
         "ends within a face"},
        {DAE_BEGIN "<polylist>" DAE_INPUTS
                   "<vcount>3 4</vcount><p>0 0 0 2 0 1 0 1</p></polylist>" DAE_MIDDLE
                   "<node>" DAE_SHOW "</node>" DAE_END,
         "ends within a face"},
        {DAE_BEGIN "<polylist>" DAE_INPUTS "<p>0 0 0 2 0 1</p></polylist>" DAE_MIDDLE
                   "<node>" DAE_SHOW "</node>" DAE_END,
         "without <vcount>"},
        {DAE_BEGIN "<triangles><p>0 1 2</p></triangles>" DAE_MIDDLE "<node>" DAE_SHOW
                   "</node>" DAE_END,
         "semantic VERTEX"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        if (parse_dae(cases[i].text) != ERROR_INPUT || !strstr(error.text, cases[i].words)) {
            fail_msg("case %zu: %s", i, error.text);
        }
    }
}

/* A node that is in the next one twice, and so on: 2^40 of them. */
TEST_WITH(collada_scenes_that_explode_are_refused, open_arena, close_arena)
{
    static char text[16384];
    int used = snprintf(text, sizeof text, "<COLLADA><library_nodes><node id='n0'/>");

    for (int i = 1; i <= 40; i++) {
        used +=
            snprintf(text + used, sizeof text - (size_t)used,
                     "<node id='n%d'><instance_node url='#n%d'/><instance_node url='#n%d'/></node>",
                     i, i - 1, i - 1);
    }
    snprintf(text + used, sizeof text - (size_t)used,
             "</library_nodes><library_visual_scenes><visual_scene><instance_node url='#n40'/>"
             "</visual_scene></library_visual_scenes></COLLADA>");
    assert_int_equal(parse_dae(text), ERROR_INPUT);
    assert_non_null(strstr(error.text, "too often"));
}

TEST_WITH(wrong_meshes_are_refused, open_arena, close_arena)
{
    static const struct {
        const char *name, *text, *words;
    } cases[] = {
        {"x.stl", "facet\nvertex 0 0 nan\n", "x.stl:2: "},
        {"x.stl", "facet\nvertex 0 0\n", "x.stl:2: "},
        {"x.stl", "facet\nvertex 0 0 0\nendfacet\n", "x.stl:3: "},
        {"x.stl", "facet\nvertex 0 0 0\n", "within a facet"},
        {"x.stl", "", "no face"},
        {"x.obj", "v 0 0 0\nf 1 1 2\n", "x.obj:2:7: "},
        {"x.obj", "v 0 0 0\nf 1 1\n", "2 corners"},
        {"x.obj", "v 0 0 1e9\n", "x.obj:1: "},
        {"x.obj", "v 0 0 0\nf 0 0 0\n", "found '0', expected a corner"},
        {"x.fbx", "", "assimp export"},
        {"x", "", "expected stl, obj or dae"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        if (import_parse_mesh(cases[i].name, false, cases[i].text, strlen(cases[i].text), one,
                              &arena, &mesh, &error) != ERROR_INPUT ||
            !strstr(error.text, cases[i].words)) {
            fail_msg("case %zu: %s", i, error.text);
        }
    }
}

/* A count of faces that the file does not have makes it no binary STL. */
TEST_WITH(binary_stl_with_a_false_count_is_refused, open_arena, close_arena)
{
    unsigned char bytes[512];
    size_t size = make_binary_stl(bytes);

    put_word(bytes + 80, 0xffffffff);
    assert_int_equal(
        import_parse_mesh("x.stl", false, (const char *)bytes, size, one, &arena, &mesh, &error),
        ERROR_INPUT);
}

/* ---- where files are found ---- */

static bool trust;

static const char *find(const char *file, const char *name, const char *folder)
{
    const struct import_model model = {.file = file};
    const struct import_geometry shape = {.file = file, .mesh = name, .line = 7};
    const struct import_packages packages = {&folder, folder != NULL, trust};
    static char path[PATH_MAX];

    return import_find_mesh(&model, &shape, &packages, path, &error) == IMPORT_PATH_FOUND ? path
                                                                                          : NULL;
}

/* Names that leave the folder urdf of the file: by "..", from the root, by a symbolic link; whether
 * there is a file or not. */
static void check_outside(const char *root, const char *file, const char *mesh_file)
{
    const char *const outside[] = {"../meshes/m.stl", mesh_file,     "a/../../meshes/m.stl",
                                   "link.stl",        "/etc/passwd", "file:///etc/passwd",
                                   "../none.stl",     "folder/m.stl"};
    char own[128], link[128], folder[128];

    snprintf(own, sizeof own, "%s/pkg/urdf/own.stl", root);
    snprintf(link, sizeof link, "%s/pkg/urdf/link.stl", root);
    snprintf(folder, sizeof folder, "%s/pkg/urdf/folder", root);
    assert_int_equal(symlink(mesh_file, link), 0);
    assert_int_equal(symlink("../meshes", folder), 0);
    fclose(fopen(own, "w"));
    for (size_t i = 0; i < sizeof outside / sizeof *outside; i++) {
        assert_null(find(file, outside[i], NULL));
        assert_non_null(strstr(error.text, "r.urdf:7: found mesh"));
        assert_non_null(strstr(error.text, "--trust"));
        assert_null(strstr(error.text, "of type"));
    }
    trust = true;
    assert_non_null(find(file, outside[0], NULL));
    assert_non_null(find(file, mesh_file, NULL));
    assert_non_null(find(file, "link.stl", NULL));
    assert_null(find(file, "../none.stl", NULL));
    assert_non_null(strstr(error.text, "found no file"));
    trust = false;

    /* What stays in the folder on every way is no question of trust */
    assert_string_equal(find(file, "own.stl", NULL), own);
    assert_non_null(find(file, "./own.stl", NULL));
    assert_string_equal(find(file, own, NULL), own);
    assert_null(find(file, "none.stl", NULL));
    assert_non_null(strstr(error.text, "found no file"));
}

TEST_WITH(packages_are_found_where_they_may_be, open_arena, close_arena)
{
    char root[] = "/tmp/hil-import-mesh-XXXXXX", file[128], mesh_file[128], other[128];
    static const char *const made[] = {"/pkg", "/pkg/urdf", "/pkg/meshes", "/else"};
    char path[128];
    FILE *out;

    assert_non_null(mkdtemp(root));
    for (size_t i = 0; i < sizeof made / sizeof *made; i++) {
        snprintf(path, sizeof path, "%s%s", root, made[i]);
        assert_int_equal(mkdir(path, 0700), 0);
    }
    snprintf(file, sizeof file, "%s/pkg/urdf/r.urdf", root);
    snprintf(mesh_file, sizeof mesh_file, "%s/pkg/meshes/m.stl", root);
    snprintf(other, sizeof other, "%s/else", root);
    assert_non_null(out = fopen(file, "w"));
    fclose(out);
    assert_non_null(out = fopen(mesh_file, "w"));
    fclose(out);

    /* Above the file, by the package's name and without it; beside it; nowhere else */
    assert_string_equal(find(file, "package://pkg/meshes/m.stl", NULL), mesh_file);
    assert_string_equal(find(file, "package://renamed/meshes/m.stl", NULL), mesh_file);
    assert_null(find(file, "package://pkg/meshes/none.stl", other));
    assert_non_null(strstr(error.text, "r.urdf:7: "));
    assert_non_null(strstr(error.text, "--package-path"));
    assert_null(find(file, "package://pkg/meshes/../meshes/m.stl", NULL));
    assert_non_null(strstr(error.text, "expected no \"..\""));
    assert_null(find(file, "http://127.0.0.1/m.stl", NULL));
    check_outside(root, file, mesh_file);
    snprintf(path, sizeof path, "rm -r '%s'", root);
    assert_int_equal(system(path), 0);
}

TEST_WITH(files_are_read_and_what_is_no_file_is_refused, open_arena, close_arena)
{
    char folder[] = "/tmp/import-mesh-XXXXXX", path[64];
    unsigned char bytes[512];
    size_t size = make_binary_stl(bytes);
    FILE *file;

    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/body.stl", folder);
    file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
    assert_ok(import_read_mesh(path, one, &arena, &mesh, &error));
    assert_int_equal(unlink(path), 0);

    /* A pipe would wait for a writer for ever, a folder cannot be read */
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(import_read_mesh(path, one, &arena, &mesh, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "no regular file"));
    assert_int_equal(unlink(path), 0);
    assert_int_equal(import_read_mesh(folder, one, &arena, &mesh, &error), ERROR_INPUT);
    assert_int_not_equal(import_read_mesh(path, one, &arena, &mesh, &error), ERROR_NONE);
    assert_int_equal(rmdir(folder), 0);
}

/* ---- convex hulls ---- */

static double hull_measure(double center[3], double I[6])
{
    struct import_mesh hull;

    assert_no_error(import_make_hull(&mesh, &arena, &hull, &error), error.text);
    return import_measure_mesh(&hull, IMPORT_SOLID_EXACT, center, I);
}

/* A grid of points in a cube: most are inside it, many on its sides and edges */
TEST_WITH(hull_of_points_in_a_cube_is_the_cube, open_arena, close_arena)
{
    enum { SIDE = 9 };
    double(*vertex)[3] = arena_alloc(&arena, SIDE * SIDE * SIDE, sizeof *vertex), center[3], I[6];

    mesh = (struct import_mesh){.nvertex = SIDE * SIDE * SIDE, .vertex = vertex};
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
        vertex[i][0] = 0.1 + 0.3 * (i % SIDE) / (SIDE - 1);
        vertex[i][1] = 0.3 * (i / SIDE % SIDE) / (SIDE - 1);
        vertex[i][2] = 0.3 * (i / SIDE / SIDE) / (SIDE - 1);
    }
    assert_near(hull_measure(center, I), 0.027, 1e-12);
    assert_near(center[0], 0.25, 1e-12);
    assert_near(I[0], 0.027 * 0.09 / 6, 1e-14);
    assert_near(I[1], 0.0, 1e-14);
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
        vertex[i][2] = 0.2;
    }
    assert_int_equal(import_make_hull(&mesh, &arena, &mesh, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "flat"));
}

/* All vertices are on a sphere, so all are corners of the hull. It is close for 4,000 vertices and
 * refused for 40,000 */
TEST_WITH(hull_of_a_sphere_encloses_it_or_is_refused, open_arena, close_arena)
{
    static const size_t count[] = {4000, 40000};
    double center[3], I[6];

    for (int k = 0; k < 2; k++) {
        double(*vertex)[3] = arena_alloc(&arena, count[k], sizeof *vertex);
        struct import_mesh hull;

        mesh = (struct import_mesh){.nvertex = count[k], .vertex = vertex};
        for (size_t i = 0; i < count[k]; i++) {
            const double z = 2 * ((double)i + 0.5) / (double)count[k] - 1;

            vertex[i][0] = sqrt(1 - z * z) * cos(2.399963 * (double)i);
            vertex[i][1] = sqrt(1 - z * z) * sin(2.399963 * (double)i);
            vertex[i][2] = z;
        }
        if (k == 0) {
            assert_near(hull_measure(center, I), 4.0 / 3.0 * M_PI, 1.5e-2);
            assert_near(I[0], 8.0 / 15.0 * M_PI, 1e-2);
        } else {
            assert_int_equal(import_make_hull(&mesh, &arena, &hull, &error), ERROR_INPUT);
            assert_non_null(strstr(error.text, "simplify the mesh"));
        }
    }
}
