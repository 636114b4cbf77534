/* SPDX-License-Identifier: Apache-2.0 */
/* The robot's capsules in a rig: which surfaces and pairs they make, and what is refused. */

#include "tests/unit/rig/rig_bench.h"

/* Of the arms that can swing about the trunk the right one can reach the other. */
static const char capsules[] =
    "capsules:\n"
    "  - {name: chest, body: trunk, xyz_m: [0, 0, 0.5], radius_m: 0.1, length_m: 0.2}\n"
    "  - {name: thigh, body: upper, xyz_m: [0, 0, -0.1], radius_m: 0.04, length_m: 0.1}\n"
    "  - {name: shin, body: lower, xyz_m: [0, 0, -0.1], radius_m: 0.03, length_m: 0.1}\n"
    "  - {name: tip, body: tail, xyz_m: [-0.3, 0, 0], radius_m: 0.05}\n"
    "poses:\n";

/* The toy rig with these lines in its scene, on native contact, its robot with capsules. */
static void write_rig_and_robot(const char *surfaces, const char *engine)
{
    static char rig[sizeof toy_rig + 2048], robot[sizeof toy_robot + 2048], with[1024];

    strcpy(robot, toy_robot);
    assert_true(replace(robot, sizeof robot, "poses:\n", capsules));
    assert_int_equal(write_file("config/robots/toy.yaml", robot, strlen(robot)), 0);
    strcpy(rig, toy_rig);
    snprintf(with, sizeof with, "  engine: %s\n", engine);
    assert_true(replace(rig, sizeof rig, "  engine: simbody\n", with));
    snprintf(with, sizeof with, "  robot_surfaces: %s\n  pairs:\n", surfaces);
    assert_true(replace(rig, sizeof rig, "  pairs:\n", with));
    write_rig_file(rig);
}

static bool has_pair(const struct rig *rig, const char *a, const char *b)
{
    const struct contact_config *contact = &rig->contact;

    for (size_t i = 0; i < contact->npair; i++) {
        const char *first = contact->surface[contact->pair[i].a].name;
        const char *second = contact->surface[contact->pair[i].b].name;

        if ((!strcmp(first, a) && !strcmp(second, b)) ||
            (!strcmp(first, b) && !strcmp(second, a))) {
            return true;
        }
    }
    return false;
}

/* What the rig says of two surfaces that it leaves out; NULL when it does not. */
static const struct rig_left_pair *left_out(const struct rig *rig, const char *a, const char *b)
{
    for (size_t i = 0; i < rig->nleft; i++) {
        const char *first = rig->contact.surface[rig->left[i].a].name;
        const char *second = rig->contact.surface[rig->left[i].b].name;

        if ((!strcmp(first, a) && !strcmp(second, b)) ||
            (!strcmp(first, b) && !strcmp(second, a))) {
            return &rig->left[i];
        }
    }
    return NULL;
}

TEST(capsules_touch_the_world_and_each_other_but_not_across_a_joint)
{
    const struct rig *rig;
    const struct contact_surface *tip;

    write_rig_and_robot("{material: rubber}", "native");
    rig = load_rig(rig_path);
    assert_int_equal(rig->contact.nsurface, 8);
    tip = &rig->contact.surface[7];
    assert_string_equal(tip->name, "tip");
    assert_int_equal(tip->shape, CONTACT_CAPSULE);
    assert_true(tip->radius_m == 0.05 && tip->length_m == 0.0 && tip->position[0] == -0.3);
    assert_string_equal(rig_contact_name(rig, (size_t)tip->body), "tail");

    /* The file's first, as they are written */
    assert_int_equal(rig->contact.pair[0].a, 0);
    assert_int_equal(rig->contact.pair[0].b, 1);
    assert_true(has_pair(rig, "ground", "chest") && has_pair(rig, "ground", "tip"));
    assert_true(has_pair(rig, "ground", "block") && has_pair(rig, "ground", "wedge"));
    assert_true(has_pair(rig, "tip", "shin") && has_pair(rig, "chest", "shin"));

    /* Joined by a joint, and two surfaces of one body; only two that none joins, whatever carries
     * surfaces in between */
    assert_false(has_pair(rig, "chest", "thigh") || has_pair(rig, "thigh", "shin"));
    assert_false(has_pair(rig, "chest", "tip") || has_pair(rig, "ball", "wedge"));
    assert_true(has_pair(rig, "tip", "thigh"));
    assert_int_equal(left_out(rig, "shin", "thigh")->why, RIG_LEFT_JOINED);
    assert_string_equal(left_out(rig, "shin", "thigh")->what, "knee");
    assert_null(left_out(rig, "ball", "wedge"));
    assert_null(left_out(rig, "tip", "thigh"));
}

TEST(capsules_that_overlap_in_one_of_the_poses_have_a_slack)
{
    static char robot[sizeof toy_robot + 2048];
    const struct rig *rig;

    /* Straight down the shin's axis is 0.1 m from the chest: 20 mm less than their radii; bent it
     * is farther off */
    write_rig_and_robot("{material: rubber}", "native");
    strcpy(robot, toy_robot);
    assert_true(replace(robot, sizeof robot, "poses:\n", capsules));
    assert_true(replace(robot, sizeof robot, "xyz_m: [0, 0, 0.5], radius_m: 0.1, length_m: 0.2",
                        "xyz_m: [-0.1, 0, -0.3], radius_m: 0.09"));
    assert_int_equal(write_file("config/robots/toy.yaml", robot, strlen(robot)), 0);
    rig = load_rig(rig_path);
    assert_true(has_pair(rig, "chest", "shin"));
    for (size_t i = 0; i < rig->contact.npair; i++) {
        const struct contact_pair *pair = &rig->contact.pair[i];
        bool it = !strcmp(rig->contact.surface[pair->a].name, "chest") &&
                  !strcmp(rig->contact.surface[pair->b].name, "shin");

        assert_true(fabs(pair->slack_m - (it ? 0.022 : 0)) < 1e-12);
    }
}

TEST(pairs_that_overlap_in_every_pose_are_left_out)
{
    const struct rig *rig;

    /* The block is 0.1 m deep about the tail's origin, in front of which the thigh hangs */
    write_rig_and_robot("{material: rubber}", "native");
    rig = load_rig(rig_path);
    assert_false(has_pair(rig, "block", "thigh"));
    assert_int_equal(left_out(rig, "block", "thigh")->why, RIG_LEFT_ALWAYS);
    assert_true(has_pair(rig, "block", "ball")); /* the file says so */
}

TEST(self_collision_and_single_pairs_can_be_left_out)
{
    const struct rig *rig;

    write_rig_and_robot("{material: rubber, self_collision: false}", "native");
    rig = load_rig(rig_path);
    assert_true(has_pair(rig, "ground", "shin"));
    assert_false(has_pair(rig, "tip", "shin"));
    assert_int_equal(rig->nleft, 0);
    write_rig_and_robot("{material: rubber, exclude: [{between: [shin, tip]}]}", "native");
    rig = load_rig(rig_path);
    assert_false(has_pair(rig, "tip", "shin"));
    assert_int_equal(left_out(rig, "tip", "shin")->why, RIG_LEFT_BY_FILE);
    assert_null(left_out(rig, "tip", "shin")->what);
    write_rig_and_robot("{material: rubber, exclude: [{between: [shin, tip], reason: soft}]}",
                        "native");
    rig = load_rig(rig_path);
    assert_string_equal(left_out(rig, "tip", "shin")->what, "soft");
    assert_true(has_pair(rig, "chest", "shin"));
}

TEST(without_the_key_nothing_changes)
{
    const struct rig *rig;

    write_rig_and_robot("{material: rubber}", "native");
    write_rig_file(toy_rig);
    rig = load_rig(rig_path);
    assert_int_equal(rig->contact.nsurface, 4);
    assert_int_equal(rig->contact.npair, 2);
}

TEST(what_cannot_be_is_refused_with_its_place)
{
    write_rig_and_robot("{material: rubber}", "simbody");
    assert_rig_refused("simbody", "19:19: found robot_surfaces with engine simbody, which has no "
                                  "capsules; expected engine native");
    write_rig_and_robot("{material: stone}", "native");
    assert_rig_refused("stone", "19:30: found unknown material \"stone\", expected rubber");
    write_rig_and_robot("{material: rubber, exclude: [{between: [shin, tap]}]}", "native");
    assert_rig_refused("tap", "19:65: found unknown surface \"tap\", expected \"tip\"");
    write_rig_and_robot("{}", "native");
    assert_rig_refused(
        "{}", "19:19: found the surfaces of the robot without key \"material\", expected it");
}

TEST_GROUP(open_rig_tree, close_rig_tree)
