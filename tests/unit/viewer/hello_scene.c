/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The scene as docs/page.md describes it, of a rig made up by hand: a trunk and a leg, a free ball,
 * each kind of surface and of visual. A client draws from nothing else.
 */
#include "viewer/private.h"
#include "tests/test.h"

enum { TRUNK, LEG, BALL };

#define UPRIGHT                                                                                    \
    {                                                                                              \
        1, 0, 0, 0, 1, 0, 0, 0, 1                                                                  \
    }
#define TURNED /* by 180 degrees about x */                                                        \
    {                                                                                              \
        1, 0, 0, 0, -1, 0, 0, 0, -1                                                                \
    }

static struct robot_body body[] = {
    {.name = "trunk",
     .parent = -1,
     .inertia = {.mass = 2.0, .com = {0.5, 0.25, 0.125}, .I = {1, 2, 3, 4, 5, 6}}},
    {.name = "leg", .parent = TRUNK, .inertia = {.mass = 1.5, .I = {7, 0, 0, 8, 0, 9}}},
};
static struct robot_joint joint[] = {{.name = "hip",
                                      .type = JOINT_PRISMATIC,
                                      .axis = {0, 0, 1},
                                      .lower = -1.0,
                                      .upper = INFINITY,
                                      .torque_limit = 30.0}};
static struct robot_capsule capsule[] = {
    {.name = "shin", .body = LEG, .rotation = UPRIGHT, .radius = 0.1, .length = 0.5},
    {.name = "chest", .body = TRUNK, .rotation = UPRIGHT, .radius = 0.2, .length = 0.3}};
static struct robot_visual visual[] = {
    {.name = "plate",
     .body = TRUNK,
     .shape = VISUAL_BOX,
     .rotation = UPRIGHT,
     .half = {0.5, 0.25, 2.0},
     .colored = true,
     .color = {1.0, 0.5, 0.25, 0.75}},
    {.name = "can",
     .body = LEG,
     .shape = VISUAL_CYLINDER,
     .rotation = UPRIGHT,
     .radius = 0.25,
     .length = 1.5},
    {.name = "face", .body = TRUNK, .shape = VISUAL_MESH, .rotation = UPRIGHT, .file = "a.stl"},
    {.name = "back", .body = TRUNK, .shape = VISUAL_MESH, .rotation = UPRIGHT, .file = "b.stl"},
    {.name = "face2", .body = LEG, .shape = VISUAL_MESH, .rotation = UPRIGHT, .file = "a.stl"},
    {.name = "lost",
     .body = LEG,
     .shape = VISUAL_MESH,
     .rotation = UPRIGHT,
     .missing = "no such file"},
};
static struct contact_surface surface[] = {
    {.name = "ground",
     .body = -1,
     .shape = CONTACT_HALF_SPACE,
     .position = {0, 0, -1},
     .rotation = UPRIGHT},
    {.name = "foot",
     .body = 0,
     .shape = CONTACT_BOX,
     .rotation = TURNED,
     .half_extent_m = {0.5, 0.25, 0.125}},
    {.name = "shin",
     .body = 0,
     .shape = CONTACT_CAPSULE,
     .rotation = UPRIGHT,
     .radius_m = 0.1,
     .length_m = 0.5},
    {.name = "rock", .body = -1, .shape = CONTACT_MESH, .rotation = UPRIGHT},
    {.name = "ball", .body = 1, .shape = CONTACT_SPHERE, .rotation = UPRIGHT, .radius_m = 0.75},
};
static struct robot robot = {.gravity = {0, 0, -9.75},
                             .floating = true,
                             .total_mass = 3.5,
                             .nbody = 2,
                             .body = body,
                             .njoint = 1,
                             .joint = joint,
                             .ncapsule = 2,
                             .capsule = capsule,
                             .nvisual = 6,
                             .visual = visual};
static struct plant_free_body ball = {.name = "ball",
                                      .inertia = {.mass = 0.5, .I = {1, 0, 0, 1, 0, 1}}};
static const int touching[] = {LEG, BALL};
static struct rig rig = {.robot = &robot,
                         .contact_body = touching,
                         .free = &ball,
                         .nfree = 1,
                         .contact = {.nbody = 2, .surface = surface, .nsurface = 5}};
static struct viewer viewer = {.rig = &rig};
static json_t *scene;

FIXTURE(describe)
{
    scene = hello_scene(&viewer);
    return scene ? 0 : -1;
}

FIXTURE(forget)
{
    json_decref(scene);
    return 0;
}

/* A part of the scene is what the text says, numbers by value. */
static void assert_part(const char *key, const char *expected)
{
    json_error_t error;
    json_t *wanted = json_loads(expected, JSON_DECODE_INT_AS_REAL, &error);
    json_t *part = json_object_get(scene, key), *found;
    char *text = json_dumps(part, JSON_ENCODE_ANY);

    if (!wanted) {
        fail_msg("%s at %s", error.text, error.source);
    }
    found = json_loads(text, JSON_DECODE_INT_AS_REAL, &error); /* whole numbers are as good */
    if (!json_equal(found, wanted)) {
        fail_msg("%s: %s\nexpected: %s", key, text, expected);
    }
    json_decref(found);
    json_decref(wanted);
    free(text);
}

TEST_WITH(bodies_are_the_robots_then_the_free_ones, describe, forget)
{
    assert_part("bodies", "[{\"name\": \"trunk\", \"parent\": -1, \"mass_kg\": 2,"
                          " \"com_m\": [0.5, 0.25, 0.125], \"inertia_kg_m2\": [1, 2, 3, 4, 5, 6]},"
                          "{\"name\": \"leg\", \"parent\": 0, \"mass_kg\": 1.5,"
                          " \"com_m\": [0, 0, 0], \"inertia_kg_m2\": [7, 0, 0, 8, 0, 9]},"
                          "{\"name\": \"ball\", \"parent\": -1, \"mass_kg\": 0.5,"
                          " \"com_m\": [0, 0, 0], \"inertia_kg_m2\": [1, 0, 0, 1, 0, 1]}]");
}

/* A limit that there is not is null. */
TEST_WITH(a_joint_moves_the_body_after_it, describe, forget)
{
    assert_part("joints", "[{\"name\": \"hip\", \"body\": 1, \"type\": \"prismatic\","
                          " \"axis\": [0, 0, 1], \"lower\": -1, \"upper\": null,"
                          " \"torque_limit_nm\": 30}]");
}

/* The leg's capsule is a surface, so it is shown once; the trunk's is none. */
TEST_WITH(shapes_are_the_surfaces_and_the_capsules_that_are_none, describe, forget)
{
    assert_part("shapes",
                "[{\"name\": \"ground\", \"body\": -1, \"shape\": \"half_space\","
                " \"position_m\": [0, 0, -1], \"quaternion\": [1, 0, 0, 0], \"radius_m\": 0,"
                " \"length_m\": 0, \"half_extent_m\": [0, 0, 0]},"
                "{\"name\": \"foot\", \"body\": 1, \"shape\": \"box\", \"position_m\": [0, 0, 0],"
                " \"quaternion\": [0, 1, 0, 0], \"radius_m\": 0, \"length_m\": 0,"
                " \"half_extent_m\": [0.5, 0.25, 0.125]},"
                "{\"name\": \"shin\", \"body\": 1, \"shape\": \"capsule\","
                " \"position_m\": [0, 0, 0], \"quaternion\": [1, 0, 0, 0], \"radius_m\": 0.1,"
                " \"length_m\": 0.5, \"half_extent_m\": [0, 0, 0]},"
                "{\"name\": \"rock\", \"body\": -1, \"shape\": \"mesh\","
                " \"position_m\": [0, 0, 0], \"quaternion\": [1, 0, 0, 0], \"radius_m\": 0,"
                " \"length_m\": 0, \"half_extent_m\": [0, 0, 0], \"mesh\": \"/mesh/3\"},"
                "{\"name\": \"ball\", \"body\": 2, \"shape\": \"sphere\","
                " \"position_m\": [0, 0, 0], \"quaternion\": [1, 0, 0, 0], \"radius_m\": 0.75,"
                " \"length_m\": 0, \"half_extent_m\": [0, 0, 0]},"
                "{\"name\": \"chest\", \"body\": 0, \"shape\": \"capsule\","
                " \"position_m\": [0, 0, 0], \"quaternion\": [1, 0, 0, 0], \"radius_m\": 0.2,"
                " \"length_m\": 0.3}]");
}

static void assert_visual(size_t index, const char *key, const char *expected)
{
    char *text =
        json_dumps(json_object_get(json_array_get(json_object_get(scene, "visuals"), index), key),
                   JSON_ENCODE_ANY | JSON_COMPACT);

    assert_string_equal(text ? text : "nothing", expected);
    free(text);
}

/* Two visuals of one file have one address; of a file that cannot be had the reason is told. */
TEST_WITH(visuals_have_their_measures_or_their_file, describe, forget)
{
    assert_visual(0, "shape", "\"box\"");
    assert_visual(0, "half_extent_m", "[0.5,0.25,2.0]");
    assert_visual(0, "color", "[1.0,0.5,0.25,0.75]");
    assert_visual(0, "mesh", "nothing");
    assert_visual(1, "name", "\"can\"");
    assert_visual(1, "body", "1");
    assert_visual(1, "shape", "\"cylinder\"");
    assert_visual(1, "radius_m", "0.25");
    assert_visual(1, "length_m", "1.5");
    assert_visual(1, "color", "null");
    assert_visual(2, "mesh", "\"/visual/2\"");
    assert_visual(3, "mesh", "\"/visual/3\"");
    assert_visual(4, "mesh", "\"/visual/2\"");
    assert_visual(5, "mesh", "nothing");
    assert_visual(5, "missing", "\"no such file\"");
}

TEST_WITH(the_rest_is_about_the_whole_robot, describe, forget)
{
    assert_part("gravity_m_s2", "[0, 0, -9.75]");
    assert_true(json_is_true(json_object_get(scene, "floating")));
    assert_true(json_number_value(json_object_get(scene, "robot_mass_kg")) == 3.5);
    assert_part("contacts",
                "[{\"name\": \"leg\", \"body\": 1}, {\"name\": \"ball\", \"body\": 2}]");
}
