/* SPDX-License-Identifier: Apache-2.0 */
/* Bodies of a rig's scene: what becomes of good ones, and where bad ones are wrong. */

#include "tests/unit/rig/rig_bench.h"

/* The toy rig with these bodies, which begin in line 12, and one surface and pair the more. */
static void write_rig(const char *bodies, const char *surface, const char *pair)
{
    static char text[sizeof toy_rig + 2048], with[2048];

    strcpy(text, toy_rig);
    snprintf(with, sizeof with, "  bodies:\n%s  materials:\n", bodies);
    assert_true(replace(text, sizeof text, "  materials:\n", with));
    snprintf(with, sizeof with, "  surfaces:\n%s", surface);
    assert_true(replace(text, sizeof text, "  surfaces:\n", with));
    snprintf(with, sizeof with, "  pairs:\n%s", pair);
    assert_true(replace(text, sizeof text, "  pairs:\n", with));
    write_rig_file(text);
}

/* One body with these keys is refused: message is what follows the name of the file. */
static void refused(const char *keys, const char *message)
{
    char body[512];

    snprintf(body, sizeof body, "    - {%s}\n", keys);
    write_rig(body, "", "");
    assert_rig_refused(keys, message);
}

/* ---- good bodies ---- */

TEST(weighs_boxes_and_tensors)
{
    const struct rig *rig;
    const struct robot_inertia *inertia;

    write_rig("    - {name: box, mass_kg: 1.5, box_m: [0.1, 0.2, 0.3], com_m: [0, 0, 0.01]}\n"
              "    - {name: stone, mass_kg: 3, inertia_kg_m2: [1, 0.1, 0.2, 1.5, 0.3, 2]}\n",
              "", "");
    rig = load_rig(rig_path);
    assert_int_equal(rig->nfree, 2);
    assert_string_equal(rig->free[0].name, "box");
    inertia = &rig->free[0].inertia;
    assert_true(inertia->mass == 1.5 && inertia->com[2] == 0.01);
    assert_true(fabs(inertia->I[0] - 1.5 * (0.04 + 0.09) / 12.0) < 1e-15);
    assert_true(fabs(inertia->I[3] - 1.5 * (0.01 + 0.09) / 12.0) < 1e-15);
    assert_true(fabs(inertia->I[5] - 1.5 * (0.01 + 0.04) / 12.0) < 1e-15);
    assert_true(inertia->I[1] == 0.0 && inertia->I[2] == 0.0 && inertia->I[4] == 0.0);
    assert_true(rig->free[1].inertia.I[4] == 0.3 && rig->free[1].inertia.I[5] == 2.0);
}

TEST(puts_bodies_where_they_start)
{
    const struct plant_free_body *body;

    write_rig(
        "    - {name: box, mass_kg: 1, box_m: [1, 1, 1], xyz_m: [1, 2, 3],\n"
        "       rpy_rad: [0, 0, 1.5707963267948966], velocity_m_s: [4, 5, 6], rate_rad_s: [7, "
        "8, 9]}\n",
        "", "");
    body = load_rig(rig_path)->free;
    assert_true(body->position[0] == 1 && body->position[1] == 2 && body->position[2] == 3);
    assert_true(fabs(body->quaternion[0] - sqrt(0.5)) < 1e-15);
    assert_true(fabs(body->quaternion[3] - sqrt(0.5)) < 1e-15);
    assert_true(body->quaternion[1] == 0.0 && body->quaternion[2] == 0.0);
    assert_true(body->v[0] == 4 && body->v[2] == 6 && body->w[0] == 7 && body->w[2] == 9);
}

/* Contact motions are counted in the order in which surfaces first name their bodies. */
TEST(surfaces_ride_on_free_bodies)
{
    const struct rig *rig;

    write_rig("    - {name: unused, mass_kg: 1, box_m: [1, 1, 1]}\n"
              "    - {name: box, mass_kg: 1, box_m: [1, 1, 1]}\n",
              "    - {name: lid, body: box, shape: sphere, radius_m: 0.1, material: rubber}\n"
              "    - {name: side, body: box, shape: sphere, radius_m: 0.1, material: rubber}\n",
              "    - between: [ground, lid]\n    - between: [lid, wedge]\n");
    rig = load_rig(rig_path);
    assert_int_equal(rig->contact.nbody, 3);
    assert_int_equal(rig->contact_body[0], rig->robot->nbody + 1);
    assert_string_equal(rig_contact_name(rig, 0), "box");
    assert_string_equal(rig_contact_name(rig, 1), "lower");
    assert_string_equal(rig_contact_name(rig, 2), "tail");
    assert_int_equal(rig->contact.surface[0].body, 0);
    assert_int_equal(rig->contact.surface[1].body, 0);
    assert_int_equal(rig->contact.npair, 4);
}

/* A static body is a place in the world: 0.1 m along x of one that is turned by 90 degrees about z
 * is 0.1 m along the world's y. */
TEST(surfaces_of_static_bodies_belong_to_the_world)
{
    const struct contact_surface *top;
    const struct rig *rig;

    write_rig(
        "    - {name: table, static: true, xyz_m: [1, 2, 3],\n"
        "       rpy_rad: [0, 0, 1.5707963267948966]}\n",
        "    - {name: top, body: table, shape: sphere, radius_m: 0.1, xyz_m: [0.1, 0, -0.5],\n"
        "       material: rubber}\n",
        "    - between: [top, ball]\n");
    rig = load_rig(rig_path);
    assert_int_equal(rig->nfree, 0);
    assert_int_equal(rig->contact.nbody, 2);
    top = &rig->contact.surface[0];
    assert_int_equal(top->body, -1);
    assert_true(fabs(top->position[0] - 1.0) < 1e-15);
    assert_true(fabs(top->position[1] - 2.1) < 1e-15);
    assert_true(fabs(top->position[2] - 2.5) < 1e-15);
    assert_true(fabs(top->rotation[3] - 1.0) < 1e-15 && fabs(top->rotation[1] + 1.0) < 1e-15);
}

/* Two bodies of the robot against each other, with two surfaces on one of them. */
TEST(a_robot_can_touch_itself)
{
    const struct rig *rig;

    write_rig("    []\n",
              "    - {name: knob, body: tail, shape: sphere, radius_m: 0.1, material: rubber}\n",
              "    - between: [knob, wedge]\n");
    rig = load_rig(rig_path);
    assert_int_equal(rig->contact.pair[0].a, 0);
    assert_int_equal(rig->contact.pair[0].b, 4);
    assert_int_equal(rig->contact.surface[0].body, rig->contact.surface[3].body);
}

TEST(without_an_engine_bodies_stay_and_nothing_touches)
{
    static char text[sizeof toy_rig + 64];
    const struct rig *rig;

    strcpy(text, toy_rig);
    assert_true(replace(text, sizeof text, "  engine: simbody\n",
                        "  engine: none\n  bodies: [{name: a, mass_kg: 1, box_m: [1, 1, 1]}]\n"));
    write_rig_file(text);
    rig = load_rig(rig_path);
    assert_int_equal(rig->nfree, 1);
    assert_int_equal(rig->contact.nbody + rig->contact.nsurface + rig->contact.npair, 0);
}

TEST(the_rig_of_the_paper_s_grasp_is_its_scene)
{
    const struct rig *rig = NULL;
    struct error error = {0};

    assert_no_error(rig_load(HIL_SOURCE_DIR "/config/rigs/grasp-paper.yaml", &arena, &rig, &error),
                    error.text);
    assert_int_equal(rig->nfree, 1);
    assert_true(rig->free[0].inertia.mass == 1.5);
    assert_true(fabs(rig->free[0].inertia.I[0] - 1.5 * 0.15 * 0.15 / 6.0) < 1e-15);
    assert_int_equal(rig->contact.nbody, 5); /* two feet, two wrists, the box */
    assert_int_equal(rig->contact.npair, 5);
    assert_string_equal(rig_contact_name(rig, 4), "box");
    assert_true(rig->substep_ns == 100000);
}

/* Friction that creeps, as fast as it always did: what is compared with the paper must not move
 * with the default of other rigs. */
TEST(rigs_of_the_paper_s_experiments_keep_its_friction)
{
    static const struct {
        const char *name;
        double transition_velocity_m_s;
    } rigs[] = {
        {"grasp-paper", 0.02},  {"grasp-locked", 0.02}, {"grasp-coarse", 0.02},
        {"grasp-light", 0.002}, {"grasp-soft", 0.002},
    };

    for (size_t i = 0; i < sizeof rigs / sizeof rigs[0]; i++) {
        const struct rig *rig = NULL;
        struct error error = {0};
        char path[512];

        snprintf(path, sizeof path, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, rigs[i].name);
        assert_no_error(rig_load(path, &arena, &rig, &error), error.text);
        assert_int_equal(rig->contact.friction, CONTACT_FRICTION_REGULARIZED);
        assert_true(rig->contact.transition_velocity_m_s == rigs[i].transition_velocity_m_s);
        assert_int_equal(rig->contact.mesh_law, CONTACT_ELASTIC_FOUNDATION);
    }
}

/* Friction sticks where a rig says nothing. */
TEST(friction_of_other_rigs_sticks)
{
    static const char *const names[] = {"coman", "grasp", "walkman"};

    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const struct rig *rig = NULL;
        struct error error = {0};
        char path[512];

        snprintf(path, sizeof path, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, names[i]);
        assert_no_error(rig_load(path, &arena, &rig, &error), error.text);
        assert_int_equal(rig->contact.friction, CONTACT_FRICTION_STICKING);
    }
}

/* ---- bad ones ---- */

TEST(rejects_names_that_mean_something_else)
{
    refused("name: tail, static: true",
            "12:14: found body \"tail\", which the robot has too, expected a name of its own");
    refused("name: world, static: true",
            "12:14: found body \"world\", the name of the static surroundings, expected a name of "
            "its own");
    refused("name: a/b, static: true",
            "12:14: found body \"a/b\", expected letters, digits and _ - . only");
    refused("name: a, static: true}\n    - {static: true, name: a",
            "13:28: found body \"a\" again, expected a name of its own");
    refused("static: true", "12:7: found a body of the scene without key \"name\", expected it");
}

TEST(rejects_keys_of_the_other_kind)
{
    refused("name: a, static: true, mass_kg: 1",
            "12:7: found key \"mass_kg\" in a static body, expected none there");
    refused("name: a, static: true, rate_rad_s: [0, 0, 1]",
            "12:7: found key \"rate_rad_s\" in a static body, expected none there");
    refused("name: a, box_m: [1, 1, 1]",
            "12:7: found a free body without key \"mass_kg\", expected it");
    refused(
        "name: a, mass_kg: 1",
        "12:7: found neither of the keys \"inertia_kg_m2\" and \"box_m\", expected exactly one");
    refused("name: a, mass_kg: 1, box_m: [1, 1, 1], inertia_kg_m2: [1, 0, 0, 1, 0, 1]",
            "12:7: found both of the keys \"inertia_kg_m2\" and \"box_m\", expected exactly one");
}

TEST(rejects_masses_and_inertias_of_no_body)
{
    refused("name: a, mass_kg: 0, box_m: [1, 1, 1]",
            "12:26: found 0, expected a number above 0, at most 1000000");
    refused("name: a, mass_kg: 1, box_m: [1, 0, 1]",
            "12:40: found 0, expected a number from 1e-06 to 1000");
    refused("name: a, mass_kg: 1, inertia_kg_m2: [1, 0, 0, 1, 0, 3]",
            "12:44: free body a: no body has the principal moments of inertia 1, 1, 3 kg m2: the "
            "largest exceeds the sum of the others");
    refused("name: a, mass_kg: 1, inertia_kg_m2: [1, 2, 0, 1, 0, 1]",
            "12:44: free body a: inertia is not positive: its principal moments are -1, 1, 3 kg "
            "m2");
    refused("name: a, mass_kg: 1, inertia_kg_m2: [0, 0, 0, 0, 0, 0]",
            "12:44: free body a: expected a mass and three principal moments of inertia above "
            "zero");
    refused("name: a, mass_kg: 1e-300, box_m: [1e-6, 1e-6, 1e-6]",
            "12:26: free body a: expected a mass and three principal moments of inertia above "
            "zero");
}

TEST(names_the_nearest_body)
{
    write_rig("    - {name: table, static: true}\n",
              "    - {name: top, body: tablee, shape: sphere, radius_m: 0.1, material: rubber}\n",
              "");
    assert_rig_refused("tablee", "17:25: found unknown body \"tablee\", expected \"table\"");
    write_rig("    - {name: table, static: true}\n",
              "    - {name: top, body: table, shape: sphere, radius_m: 0.1, material: rubber}\n",
              "    - between: [top, ground]\n");
    assert_rig_refused("[top, ground]",
                       "23:16: found two surfaces of one body, expected surfaces of two bodies");
}

TEST_GROUP(open_rig_tree, close_rig_tree)
