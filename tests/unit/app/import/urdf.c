/* SPDX-License-Identifier: Apache-2.0 */
/* URDF, SRDF and MJCF to a robot: each pitfall of such files by a file of its own, made here. */
#include "app/import/readers.h"

#include "tests/physics/near.h"
#include "base/array.h"
#include "base/vec3.h"
#include "tests/unit/app/import/text.h"

/* ---- what is merged ---- */

/* A rod of 2 kg along x, turned by a right angle about z and put 1 m ahead, on one of 1 kg: by hand
 * the common center is at 2/3 m, and Izz = 0.1 + 0.3 + 1 (2/3)^2 + 2 (1/3)^2. */
TEST_WITH(fixed_links_merge_with_turned_inertias, open_default, close_arena)
{
    const struct robot_inertia *sum;

    import_good(ROBOT(LINK("base") LINK(
        "a") "<link name='rod'><inertial><mass value='2'/><inertia ixx='0.01' iyy='0.2' izz='0.3' "
             "ixy='0' "
             "ixz='0' iyz='0'/></inertial></link>\n" JOINT("j", "revolute", "base", "a", LIMIT)
                          JOINT("f", "fixed", "a", "rod",
                                "<origin xyz='1 0 0' rpy='0 0 1.5707963267948966'/>")));
    assert_int_equal(made.robot->nbody, 2);
    sum = &made.robot->body[1].inertia;
    assert_near(sum->mass, 3.0, 0.0);
    assert_near(sum->com[0], 2.0 / 3.0, 1e-15);
    assert_near(sum->I[0], 0.1 + 0.2, 1e-15); /* the rod's iyy lies along x now */
    assert_near(sum->I[3], 0.1 + 0.01 + 4.0 / 9.0 + 2.0 / 9.0, 1e-15);
    assert_near(sum->I[5], 0.1 + 0.3 + 4.0 / 9.0 + 2.0 / 9.0, 1e-15);
    assert_near(sum->I[1], 0.0, 1e-15);
    assert_true(noted(IMPORT_MERGED, 4, "link \"rod\" (2 kg) is part of body \"a\""));
    assert_true(robot_find_frame(made.robot, "rod") >= 0);
}

TEST_WITH(joint_origins_pass_through_fixed_links, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") HOLLOW("flange") LINK("a") JOINT(
        "f", "fixed", "base", "flange", "<origin xyz='0 0 1' rpy='0 0 1.5707963267948966'/>")
                          JOINT("j", "revolute", "flange", "a",
                                "<origin xyz='1 0 0'/><axis xyz='0 0 2'/>" LIMIT)));
    assert_int_equal(made.robot->njoint, 1);
    assert_near(made.robot->joint[0].origin[0], 0.0, 1e-15);
    assert_near(made.robot->joint[0].origin[1], 1.0, 1e-15);
    assert_near(made.robot->joint[0].origin[2], 1.0, 1e-15);
    assert_near(made.robot->joint[0].rotation[1], -1.0, 1e-15);
    assert_near(made.robot->joint[0].axis[2], 1.0, 0.0);
}

TEST_WITH(joint_behind_which_nothing_weighs_is_fixed, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("a") HOLLOW("wheel") HOLLOW("cap") JOINT(
        "j", "revolute", "base", "a", LIMIT) JOINT("spin", "continuous", "a", "wheel", "")
                          JOINT("f", "fixed", "wheel", "cap", "")));
    assert_int_equal(made.robot->njoint, 1);
    assert_true(noted(IMPORT_CHANGED, 7, "nothing that it moves has mass"));
}

TEST_WITH(body_between_joints_may_have_no_mass, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") HOLLOW("cross") LINK("a")
                          JOINT("x", "revolute", "base", "cross", LIMIT)
                              JOINT("y", "revolute", "cross", "a", "<axis xyz='0 1 0'/>" LIMIT)));
    assert_int_equal(made.robot->njoint, 2);
    assert_true(noted(IMPORT_ASSUMED, 3, "has no mass"));
}

/* ---- joints ---- */

TEST_WITH(equal_limits_fix_a_joint_where_they_are, open_default, close_arena)
{
    import_good(
        ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "base", "a", LIMIT) JOINT(
            "k", "revolute", "a", "b",
            "<axis xyz='0 0 1'/><origin xyz='1 0 0'/><limit lower='0.5' upper='0.5' effort='1' "
            "velocity='1'/>")));
    assert_int_equal(made.robot->njoint, 1);
    assert_near(made.place[2].R[0], cos(0.5), 1e-15);
    assert_true(noted(IMPORT_CHANGED, 6, "fixed at 0.5 rad"));
}

TEST_WITH(continuous_joint_has_turns_and_no_stops, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("a") JOINT("j", "continuous", "base", "a", "")));
    assert_near(made.robot->joint[0].upper, 100.0 * M_PI, 1e-12);
    assert_near(made.robot->joint[0].stop.stiffness, 0.0, 0.0);
}

/* As some files of robots have it that turn freely: -1 throughout, or the limits the wrong way. */
TEST_WITH(limits_that_mean_none_are_none, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("a") LINK("b") JOINT(
        "j", "revolute", "base", "a", "<limit lower='-1' upper='-1' effort='-1' velocity='-1'/>")
                          JOINT("k", "revolute", "a", "b",
                                "<limit lower='3' upper='-3' effort='5' velocity='2'/>")));
    for (int j = 0; j < 2; j++) {
        assert_near(made.robot->joint[j].upper, 100.0 * M_PI, 1e-12);
        assert_near(made.robot->joint[j].stop.stiffness, 0.0, 0.0);
    }
    assert_true(noted(IMPORT_CHANGED, 5, "limits -1 to -1 of joint \"j\" mean none"));
    assert_true(noted(IMPORT_ASSUMED, 5, "effort 0 is none"));
    import_bad(ROBOT(LINK("base") LINK("a")
                         JOINT("j", "revolute", "base", "a",
                               "<limit lower='-1' upper='1' effort='1' velocity='-2'/>")),
               "x.urdf:4: ", "velocity -2");
}

/* MJCF's springs are passive; without an actuator, where others have one, they are all there is. */
TEST_WITH(springs_are_passive, open_default, close_arena)
{
    const char *const two =
        "<joint name='j' stiffness='30' springref='20' ref='5' damping='2' range='-40 40'/>"
        "<body name='b'><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>"
        "<joint name='k' stiffness='4' damping='0.5' range='-40 40'/></body>";
    char text[2048];

    for (int actuated = 0; actuated < 2; actuated++) {
        snprintf(text, sizeof text, MJCF("", "%s", "%s"), two,
                 actuated ? "<actuator><motor joint='k' ctrlrange='-1 1'/></actuator>" : "");
        import_good(text);
        assert_near(made.robot->joint[0].passive.stiffness, 30.0, 0.0);
        assert_near(made.robot->joint[0].passive.rest, 15.0 * M_PI / 180.0, 1e-15);
        assert_near(made.robot->joint[0].passive.damping, actuated ? 2.0 : 0.0, 0.0);
        assert_int_equal(robot_joint_is_driven(&made.robot->joint[0]), !actuated);
        assert_near(made.robot->joint[1].passive.stiffness, 4.0, 0.0);
        assert_near(made.robot->joint[1].passive.damping, 0.0, 0.0);
        assert_true(robot_joint_is_driven(&made.robot->joint[1]));
    }
    import_bad(MJCF("", "<joint name='j' stiffness='-1'/>", ""), "x.urdf:4: ", "stiffness -1");
}

/* MuJoCo takes a range whose ends are the same, or the wrong way, for none. */
TEST_WITH(mjcf_range_without_width_is_none, open_default, close_arena)
{
    import_good(MJCF("", "<joint name='j' range='0 0'/>", ""));
    assert_near(made.robot->joint[0].upper, 100.0 * M_PI, 1e-12);
    import_good(MJCF("", "<joint name='j' range='-10 20'/>", ""));
    assert_near(made.robot->joint[0].upper, 20.0 * M_PI / 180.0, 1e-15);
}

TEST_WITH(joints_beyond_a_bench_are_refused_with_the_first, open_default, close_arena)
{
    static char text[1 << 16];
    size_t used = 0;

    used += (size_t)snprintf(text, sizeof text, "<robot name='r'>\n" LINK("l0"));
    for (int j = 1; j <= 129; j++) {
        used += (size_t)snprintf(text + used, sizeof text - used,
                                 "<link name='l%d'><inertial><mass value='1'/>" INERTIA
                                 "</inertial></link>\n<joint name='j%d' type='revolute'><parent "
                                 "link='l%d'/><child link='l%d'/>" LIMIT "</joint>\n",
                                 j, j, j - 1, j);
    }
    snprintf(text + used, sizeof text - used, "</robot>");
    import_bad(text, "x.urdf:260: ", "found joint \"j129\", which is one more than the 128");
    assert_non_null(strstr(error.text, "--lock"));
    options.lock = (const char *const[]){"j7"};
    options.nlock = 1;
    import_good(text);
    assert_int_equal(made.robot->njoint, 128);
}

TEST_WITH(sliding_joint_is_fixed_unless_it_may_slide, open_default, close_arena)
{
    const char *text = ROBOT(LINK("base") LINK("a") LINK("b") JOINT(
        "j", "revolute", "base", "a", LIMIT) JOINT("s", "prismatic", "a", "b", LIMIT));

    import_good(text);
    assert_int_equal(made.robot->njoint, 1);
    assert_true(noted(IMPORT_CHANGED, 6, "--prismatic drive gives it one"));
    options.free_slides = true;
    import_good(text);
    assert_int_equal(made.robot->njoint, 2);
    assert_int_equal(made.robot->joint[1].type, JOINT_PRISMATIC);
    assert_false(made.robot->joint[1].sea.present);
}

TEST_WITH(joint_that_follows_is_refused_locked_or_free, open_default, close_arena)
{
    const char *text =
        ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "base", "a", LIMIT) JOINT(
            "m", "revolute", "base", "b", LIMIT "<mimic joint='j' multiplier='2' offset='0.25'/>"));

    import_bad(text, "x.urdf:6: ", "--mimic lock");
    options.mimic = IMPORT_MIMIC_LOCK;
    import_good(text);
    assert_int_equal(made.robot->njoint, 1);
    assert_true(noted(IMPORT_CHANGED, 6, "fixed at 0.25 rad"));
    options.mimic = IMPORT_MIMIC_FREE;
    import_good(text);
    assert_int_equal(made.robot->njoint, 2);
    import_bad(ROBOT(LINK("base") LINK("a")
                         JOINT("m", "revolute", "base", "a", LIMIT "<mimic joint='none'/>")),
               "x.urdf:4: ", "\"none\"");
}

TEST_WITH(joint_follows_one_that_is_fixed_exactly, open_default, close_arena)
{
    static const char *const lock[] = {"j"};

    options.lock = lock;
    options.nlock = 1;
    import_good(ROBOT(
        LINK("base") LINK("a") LINK("b") LINK("c") JOINT("k", "revolute", "base", "c", LIMIT)
            JOINT("j", "revolute", "base", "a",
                  "<limit lower='0.5' upper='1.5' effort='1' velocity='1'/>")
                JOINT("m", "revolute", "base", "b", LIMIT "<mimic joint='j' multiplier='2'/>")));
    assert_int_equal(made.robot->njoint, 1);
    assert_true(noted(IMPORT_CHANGED, 8, "fixed at 1.1 rad"));
}

TEST_WITH(limits_that_exclude_zero_move_the_rest, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("a") JOINT(
        "j", "revolute", "base", "a", "<limit lower='-3' upper='-1' effort='9' velocity='3'/>")));
    assert_near(made.rest[0], -1.1, 1e-15);
    assert_near(made.robot->pose[0].joint[0], -1.1, 1e-15);
    assert_true(noted(IMPORT_CHANGED, 4, "exclude 0"));
}

/* Files without limits, and files with values that some tools write for no limit */
TEST_WITH(joints_without_limits_turn_for_ever, open_default, close_arena)
{
    static const struct {
        const char *type, *limit, *words;
        enum import_fate fate;
    } cases[] = {
        {"revolute", "", "turns without limits", IMPORT_CHANGED},
        {"revolute", "<limit effort='3' velocity='2'/>", "turns without limits", IMPORT_CHANGED},
        {"revolute", "<limit lower='-1e16' upper='1e16' effort='-1'/>", "mean none",
         IMPORT_CHANGED},
        {"revolute", "<limit lower='-1e6' upper='1e6' effort='5'/>", "mean none", IMPORT_CHANGED},
        {"continuous", "<limit lower='-1e16' upper='1e16'/>", "joint \"j\", whose type has none",
         IMPORT_DROPPED},
        {"continuous", "<limit lower='-1' upper='1'/>",
         "limits -1 to 1 of joint \"j\", whose type has none", IMPORT_DROPPED},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        char text[1024];

        snprintf(text, sizeof text,
                 ROBOT(LINK("base") LINK("a") JOINT("j", "%s", "base", "a", "%s")), cases[i].type,
                 cases[i].limit);
        import_good(text);
        assert_int_equal(model.joint[0].type, IMPORT_CONTINUOUS);
        assert_true(made.robot->joint[0].upper > 300.0);
        assert_near(made.robot->joint[0].stop.stiffness, 0.0, 0.0);
        assert_true(noted(cases[i].fate, 4, cases[i].words));
    }
    options.free_slides = true;
    import_good(ROBOT(LINK("base") LINK("a") JOINT("j", "prismatic", "base", "a", "")));
    assert_near(made.robot->joint[0].lower, -100.0, 0.0);
    assert_true(noted(IMPORT_CHANGED, 4, "slides without limits"));
}

TEST_WITH(impossible_joints_are_refused, open_default, close_arena)
{
    static const struct {
        const char *text, *place, *words;
    } cases[] = {
        {ROBOT(LINK("base") LINK("a")
                   JOINT("j", "prismatic", "base", "a", "<limit lower='2' upper='1'/>")),
         "x.urdf:4: ", "above its upper limit"},
        {ROBOT(LINK("base") LINK("a") JOINT("j", "planar", "base", "a", "")),
         "x.urdf:4: ", "two prismatic joints"},
        {ROBOT(LINK("base") LINK("a") JOINT("j", "floating", "base", "a", "")),
         "x.urdf:4: ", "nothing but the base floats"},
        {ROBOT(LINK("base") LINK("a") JOINT("j", "screw", "base", "a", "")),
         "x.urdf:4: ", "found type \"screw\""},
        {ROBOT(LINK("base") LINK("a")
                   JOINT("j", "revolute", "base", "a", LIMIT "\n<axis xyz='0 0 0'/>")),
         "x.urdf:5: ", "expected a direction"},
        {ROBOT(LINK("base") LINK("a") JOINT("j", "revolute", "base", "nobody", LIMIT)),
         "x.urdf:4: ", "found link \"nobody\""},
        {ROBOT(LINK("base") LINK("a") "<joint name='j' type='fixed'><parent link='base'/></joint>"),
         "x.urdf:4: ", "without <child>"},
        {ROBOT(LINK("base") LINK("a") JOINT("j", "revolute", "base", "a",
                                            "<limit lower='-1' upper='1' effort='-3'/>")),
         "x.urdf:4: ", "effort -3"},
        {ROBOT(LINK("base") LINK("a")
                   JOINT("j", "revolute", "base", "a", LIMIT "<origin xyz='0 0 3e9'/>")),
         "x.urdf:4: ", "found 3e+09 m in the origin of joint \"j\", expected -1000 to 1000"},
        {ROBOT(LINK("base") "<link name='a'>\n<inertial><origin xyz='0 2e4 0'/><mass value='1'/>"
                            "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
                            "</link>\n" JOINT("j", "revolute", "base", "a", LIMIT)),
         "x.urdf:4: ", "found 20000 m in the center of mass of link \"a\""},
        {ROBOT(LINK("base") "<link name='a'>\n<inertial><mass value='1'/>"
                            "<inertia ixx='4e9' iyy='4e9' izz='4e9' ixy='0' ixz='0' iyz='0'/>"
                            "</inertial></link>\n" JOINT("j", "revolute", "base", "a", LIMIT)),
         "x.urdf:4: ", "found an inertia of 4e+09 kg m2 of link \"a\""},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        import_bad(cases[i].text, cases[i].place, cases[i].words);
    }
}

/* ---- trees ---- */

TEST_WITH(what_is_no_tree_is_refused, open_default, close_arena)
{
    import_bad(ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "base", "a", LIMIT)
                         JOINT("k", "revolute", "base", "b", LIMIT)
                             JOINT("l", "fixed", "a", "b", "")),
               "x.urdf:7: ", "loops are not imported");
    import_bad(ROBOT(LINK("a") LINK("b") JOINT("j", "revolute", "a", "b", LIMIT)
                         JOINT("k", "revolute", "b", "a", LIMIT)),
               "x.urdf:4: ", "form a loop");
    import_bad(ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "a", "b", LIMIT)
                         JOINT("k", "revolute", "b", "a", LIMIT)),
               "x.urdf:5: ", "a loop of joints");
    import_bad(ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "base", "a", LIMIT)),
               "x.urdf:4: ", "expected one tree");
    import_bad("<robot name='r'/>", "x.urdf:1: ", "0 links");
}

TEST_WITH(names_stand_once, open_default, close_arena)
{
    import_bad(ROBOT(LINK("base") LINK("a") LINK("a")),
               "x.urdf:4: ", "again, expected it once (line 3)");
    import_bad(ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "base", "a", LIMIT)
                         JOINT("j", "revolute", "base", "b", LIMIT)),
               "x.urdf:6: ", "again, expected it once (line 5)");
}

TEST_WITH(names_that_robot_files_refuse_are_changed, open_default, close_arena)
{
    import_good(
        ROBOT(LINK("base") LINK("left/arm 1") JOINT("j", "revolute", "base", "left/arm 1", LIMIT)));
    assert_string_equal(made.robot->body[1].name, "left_arm_1");
    assert_true(noted(IMPORT_CHANGED, 3, "is named \"left_arm_1\""));
    import_bad(ROBOT(LINK("base") LINK("a") JOINT("spare", "revolute", "base", "a", LIMIT)),
               "x.urdf:4: ", "spare");
}

TEST_WITH(bases_are_guessed_and_said, open_default, close_arena)
{
    const char *arm = ROBOT(LINK("base") LINK("a") JOINT("j", "revolute", "base", "a", LIMIT));
    const char *legs = ROBOT(
        LINK("base") LINK("a") LINK("b") LINK("c") LINK("d")
            JOINT("j", "revolute", "base", "a", LIMIT) JOINT("k", "revolute", "a", "b", LIMIT)
                JOINT("l", "revolute", "base", "c", LIMIT) JOINT("m", "revolute", "c", "d", LIMIT));

    import_good(arm);
    assert_false(made.robot->floating);
    assert_true(noted(IMPORT_ASSUMED, 2, "--base says otherwise"));
    import_good(legs);
    assert_true(made.robot->floating);
    options.base = IMPORT_BASE_FIXED;
    import_good(legs);
    assert_false(made.robot->floating);
}

TEST_WITH(world_that_is_not_in_the_file_stands_still, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("a") JOINT("w", "fixed", "world", "base", "")
                          JOINT("j", "revolute", "base", "a", LIMIT)));
    assert_false(made.robot->floating);
    assert_true(noted(IMPORT_ASSUMED, 4, "link \"world\" of joint \"w\" is not in the file"));
    import_bad(ROBOT(LINK("base") LINK("a") JOINT("j", "revolute", "base", "World", LIMIT)),
               "x.urdf:4: ", "found link \"World\" of joint \"j\", expected one of this file");
}

/* Points at which a foot is touched. */
TEST_WITH(sphere_without_radius_is_a_point, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") "<link name='a'><inertial><mass value='1'/>" INERTIA
                                   "</inertial><collision><geometry><sphere radius='0'/>"
                                   "</geometry></collision></link>\n" JOINT("j", "revolute", "base",
                                                                            "a", LIMIT)));
    assert_int_equal(model.ngeometry, 1);
    assert_near(model.geometry[0].radius, 1e-3, 0.0);
    assert_true(noted(IMPORT_CHANGED, 3, "collision sphere of link \"a\", a point"));
    import_bad(ROBOT("<link name='a'><collision><geometry><sphere radius='-1'/>"
                     "</geometry></collision></link>"),
               "x.urdf:2: ", "found radius -1 m, expected 0 to 1000");
}

TEST_WITH(floating_joint_makes_its_child_the_base, open_default, close_arena)
{
    import_good(ROBOT(HOLLOW("world") LINK("pelvis") LINK("a")
                          JOINT("free", "floating", "world", "pelvis", "<origin xyz='0 0 1'/>")
                              JOINT("j", "revolute", "pelvis", "a", LIMIT)));
    assert_true(made.robot->floating);
    assert_string_equal(made.robot->body[0].name, "pelvis");
    assert_int_equal(made.body[0], -1);
    import_bad(ROBOT(HOLLOW("world") LINK("pelvis") LINK("a") LINK("b")
                         JOINT("free", "floating", "world", "pelvis", "")
                             JOINT("j", "revolute", "world", "a", LIMIT)
                                 JOINT("k", "revolute", "pelvis", "b", LIMIT)),
               "x.urdf:7: ", "one robot floats");
    import_good(ROBOT(HOLLOW("world") LINK("pelvis") LINK("a") LINK("floor") JOINT(
        "free", "floating", "world", "pelvis", "") JOINT("ground", "fixed", "world", "floor", "")
                          JOINT("j", "revolute", "pelvis", "a", LIMIT)));
    assert_int_equal(made.body[3], -1);
    assert_near(made.robot->total_mass, 2.0, 0.0);
    assert_true(noted(IMPORT_DROPPED, 7, "link \"floor\""));
}

/* The part with most joints is the robot. Free bodies beside it are objects; so are parts on joints
 * in the world beside a robot that floats */
TEST_WITH(parts_with_fewer_joints_than_the_robot_are_objects, open_default, close_arena)
{
    static const char *const object[] = {
        "<body name='box' pos='1 0 0'><freejoint/><geom size='1'/></body>",
        "<body name='box'><freejoint/><geom size='1'/><body name='lid'><joint name='k' "
        "range='0 1'/><geom size='1'/></body></body>",
        "<body name='box'><joint name='k'/><geom size='1'/></body>"};
    static const char *const arm =
        "<body name='%s'>%s<geom size='1'/><body name='b'><joint name='i' range='0 1'/>"
        "<geom size='1'/><body name='c'><joint name='j' range='0 1'/><geom size='1'/>"
        "</body></body></body>";
    char robot[512], text[1200];

    for (int i = 0; i < 12; i++) {
        const bool floats = i & 1 || i >= 8, first = i & 2;

        snprintf(robot, sizeof robot, arm, "a", floats ? "<freejoint/>" : "");
        snprintf(text, sizeof text, "<mujoco><worldbody>%s%s</worldbody></mujoco>\n",
                 first ? robot : object[i / 4], first ? object[i / 4] : robot);
        import_good(text);
        assert_int_equal(made.robot->floating, floats);
        assert_int_equal(made.robot->njoint, 2);
        assert_true(noted(IMPORT_DROPPED, 1, "link \"box\", with all that hangs on it: it is an"));
    }
}

/* ---- inertias ---- */

#define THIN                                                                                       \
    "<link name='a'>\n<inertial><mass value='1'/><inertia ixx='0.1' iyy='0.2' izz='0.5' ixy='0' "  \
    "ixz='0' iyz='0'/></inertial></link>\n"

TEST_WITH(inertia_that_no_body_has_is_refused_or_repaired, open_default, close_arena)
{
    const char *text = ROBOT(LINK("base") THIN JOINT("j", "revolute", "base", "a", LIMIT));

    import_bad(text, "x.urdf:4: ", "--repair-inertia");
    options.repair_inertia = true;
    import_good(text);
    assert_near(made.robot->body[1].inertia.I[0], 0.2, 1e-15);
    assert_near(made.robot->body[1].inertia.I[3], 0.3, 1e-15);
    assert_near(made.robot->body[1].inertia.I[5], 0.5, 1e-15);
    assert_true(noted(IMPORT_CHANGED, 4, "has now the moments"));
}

/* Turned by 0.3 rad about z and repaired, it is the repaired one turned. */
TEST_WITH(repair_keeps_the_axes, open_default, close_arena)
{
    const double *I;
    double c = cos(0.3), s = sin(0.3);

    options.repair_inertia = true;
    import_good(ROBOT(
        LINK("base") "<link name='a'><inertial><origin rpy='0 0 0.3'/><mass value='1'/><inertia "
                     "ixx='0.1' "
                     "iyy='0.2' izz='0.5' ixy='0' ixz='0' iyz='0'/></inertial></link>\n" JOINT(
                         "j", "revolute", "base", "a", LIMIT)));
    I = made.robot->body[1].inertia.I;
    assert_near(I[0], 0.2 * c * c + 0.3 * s * s, 1e-14);
    assert_near(I[1], (0.2 - 0.3) * s * c, 1e-14);
    assert_near(I[3], 0.2 * s * s + 0.3 * c * c, 1e-14);
}

/* ---- hostile files ---- */

TEST_WITH(document_types_and_entities_are_refused, open_default, close_arena)
{
    import_bad("<?xml version='1.0'?>\n<!DOCTYPE robot [<!ENTITY a 'x'>]>\n<robot name='&a;'/>",
               "x.urdf:2: ", "DOCTYPE");
    import_bad("<!DOCTYPE robot SYSTEM 'http://127.0.0.1/x.dtd'>\n<robot name='r'/>",
               "x.urdf:1: ", "DOCTYPE");
    import_bad("<robot name='&a;'/>", "x.urdf:1: ", "no well-formed XML");
    import_bad("<robot name='r'>\n<link", "x.urdf:2: ", "no well-formed XML");
    import_bad("", "x.urdf:1: ", "no well-formed XML");
}

TEST_WITH(xacro_is_sent_back, open_default, close_arena)
{
    import_bad("<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'>\n<xacro:include "
               "filename='a'/></robot>",
               "x.urdf:2: ", "run `xacro FILE >robot.urdf`");
    import_bad(ROBOT("<link name='a'><inertial><mass value='${m}'/>" INERTIA "</inertial></link>"),
               "x.urdf:2: ", "run `xacro FILE >robot.urdf`");
}

TEST_WITH(numbers_are_read_strictly, open_default, close_arena)
{
    static const char *const wrong[] = {"nan", "inf", "0x10", "", "1 2", "1,5", "1e999", "one"};
    char text[512];

    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        snprintf(text, sizeof text,
                 "<robot name='r'>\n<link name='a'><inertial>\n<mass value='%s'/>" INERTIA
                 "</inertial></link></robot>",
                 wrong[i]);
        import_bad(text, "x.urdf:3: ", "expected");
    }
    import_bad(ROBOT("<link name='a'><inertial>\n<mass value='-1'/>" INERTIA "</inertial></link>"),
               "x.urdf:3: ", "mass -1 kg");
    import_bad(ROBOT("<link name='a'><inertial><mass value='1'/></inertial></link>"),
               "x.urdf:2: ", "without <inertia>");
}

/* ---- sensors and poses ---- */

TEST_WITH(force_sensor_bears_what_is_below_it, open_default, close_arena)
{
    const struct robot_ft_sensor *ft;

    import_good(
        ROBOT(LINK("base") LINK("arm") LINK("hand") JOINT("j", "revolute", "base", "arm", LIMIT)
                  JOINT("wrist", "fixed", "arm", "hand",
                        "<origin xyz='0.5 0 0'/>") "<sensor name='s' type='force_torque'><parent "
                                                   "joint='wrist'/></sensor>\n"
                                                   "<sensor name='t' type='force_torque'><parent "
                                                   "joint='j'/></sensor>\n"
                                                   "<gazebo reference='hand'><sensor name='i' "
                                                   "type='imu'/><mu1>1</mu1></gazebo>"
                                                   "<gazebo reference='hand'>\n<sensor name='c' "
                                                   "type='camera'/></gazebo>"));
    assert_int_equal(made.robot->nft, 2);
    ft = &made.robot->ft[0];
    assert_string_equal(ft->name, "s");
    assert_near(ft->distal.mass, 1.0, 0.0);
    assert_near(ft->distal.com[0], 0.0, 1e-15);
    assert_near(made.robot->frame[ft->frame].position[0], 0.5, 1e-15);
    assert_near(made.robot->ft[1].distal.mass, 2.0, 0.0);
    assert_true(made.robot->imu_frame >= 0);
    assert_true(noted(IMPORT_DROPPED, 9, "mu1"));
    assert_true(noted(IMPORT_DROPPED, 10, "type \"camera\""));
}

/* Gazebo's frame: child (the default), parent, or the sensor's own pose */
TEST_WITH(force_sensors_are_turned_as_the_file_says, open_default, close_arena)
{
    static const struct {
        const char *words;
        double up[3]; /* where z of the sensor points in the body */
        bool opposite;
    } cases[] = {
        {"", {0, -1, 0}, false},
        {"<frame>child</frame><measure_direction>child_to_parent</measure_direction>",
         {0, -1, 0},
         false},
        {"<frame>parent</frame>", {0, 0, 1}, false},
        {"<frame> sensor </frame><measure_direction>parent_to_child</measure_direction>",
         {1, 0, 0},
         true},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[2048];

        snprintf(text, sizeof text,
                 ROBOT(LINK("base") LINK("arm") LINK("hand")
                           JOINT("j", "revolute", "base", "arm", LIMIT)
                               JOINT("wrist", "fixed", "arm", "hand",
                                     "<origin xyz='0 0 0' rpy='1.5707963267948966 "
                                     "0 0'/>") "<gazebo reference='wrist'><sensor "
                                               "name='s' type='force_torque'>"
                                               "<pose>0 0 0 0 1.5707963267948966 "
                                               "0</pose><force_torque>%s"
                                               "</force_torque></sensor></gazebo>"),
                 cases[i].words);
        import_good(text);
        for (int m = 0; m < 3; m++) {
            assert_near(made.robot->frame[made.robot->ft[0].frame].rotation[3 * m + 2],
                        cases[i].up[m], 1e-12);
        }
        assert_int_equal(noted(IMPORT_CHANGED, 7, "signs are opposite"), cases[i].opposite);
    }
}

TEST_WITH(poses_come_from_the_second_file, open_default, close_arena)
{
    static const char srdf[] =
        "<robot name='r'>\n<virtual_joint name='v' type='floating' parent_frame='w' "
        "child_link='base'/>\n<group_state name='standing' group='g'>\n<joint name='j' "
        "value='0.7'/>\n<joint name='other' value='1'/></group_state></robot>";
    const char *text = ROBOT(LINK("base") LINK("a") JOINT("j", "revolute", "base", "a", LIMIT));
    struct xml_file file;

    import_good(text);
    assert_ok(xml_text_open(&file, "x.srdf", srdf, strlen(srdf), &error));
    assert_ok(srdf_read(&file, &arena, &model, &notes, &error));
    xml_file_close(&file);
    assert_true(noted(IMPORT_DROPPED, 5, "no such joint"));
    assert_ok(import_simplify_tree(&model, &options, &arena, &notes, &made, &error));
    assert_true(made.robot->floating);
    assert_int_equal(made.robot->npose, 2);
    assert_string_equal(made.robot->pose[1].name, "standing");
    assert_near(made.robot->pose[1].joint[0], 0.7, 0.0);
}

/* ---- MJCF ---- */

/* What stands in 17 frames. */
#define FRAMES_4(inside) "<frame><frame><frame><frame>" inside "</frame></frame></frame></frame>"
#define FRAMES(inside) "<frame>" FRAMES_4(FRAMES_4(FRAMES_4(FRAMES_4(inside)))) "</frame>"

TEST_WITH(mjcf_that_is_no_plain_tree_is_refused, open_default, close_arena)
{
    static const struct {
        const char *text, *place, *words;
    } cases[] = {
        {MJCF("", "<joint name='j'/>",
              "\n<equality><connect name='rod' body1='a' body2='b' "
              "anchor='0 0 0'/></equality>"),
         "x.urdf:5: ", "<connect> rod between \"a\" and \"b\", which closes a loop"},
        {MJCF("", "<joint name='j'/>", "<equality><weld body1='a'/></equality>"),
         "x.urdf:4: ", "\"a\" and \"the world\""},
        {MJCF("", "<joint name='j'/>", "<equality><connect site1='p' site2='q'/></equality>"),
         "x.urdf:4: ", "\"p\" and \"q\""},
        {MJCF("", "<joint type='ball'/>", ""), "x.urdf:4: ", "three hinges for a ball"},
        {MJCF("<include file='/etc/passwd'/>", "<joint/>", ""), "x.urdf:2: ", "without a folder"},
        {MJCF("", "<replicate><body/></replicate>", ""), "x.urdf:4: ", "found <replicate>"},
        {MJCF("", "<body name='f'>" FRAMES("<joint/>") "</body>", ""), "x.urdf:4: ", "16 deep"},
        {MJCF("<asset><mesh name='m' file='m.obj'/></asset>",
              "<body name='f'><joint/><geom type='box' mesh='m'/></body>", ""),
         "x.urdf:4: ", "MuJoCo fits to the mesh"},
        {MJCF("<asset><mesh name='m' file='m.obj' scale='1 2 1' refquat='1 1 0 0'/></asset>",
              "<joint/><geom type='mesh' mesh='m'/>", ""),
         "x.urdf:2: ", "found refquat of a mesh with scale 1 2 1"},
        {MJCF("<compiler coordinate='global'/>", "<joint/>", ""), "x.urdf:2: ", "coordinate"},
        {MJCF("<compiler eulerseq='xyq'/>", "<joint/>", ""), "x.urdf:2: ", "eulerseq"},
        {MJCF("", "<joint/><body name='a'/>", ""), "x.urdf:4: ", "found body \"a\" again"},
        {MJCF("", "<joint/><geom type='box' size='1 0 1'/>", ""), "x.urdf:4: ", "found size 0"},
        {MJCF("", "<joint/><geom quat='0 0 0 0' size='1'/>", ""), "x.urdf:4: ", "a rotation"},
        {MJCF("", "<joint/><geom type='mesh' mesh='none'/>", ""), "x.urdf:4: ", "mesh \"none\""},
        {MJCF("", "<joint axis='0 0 0'/>", ""), "x.urdf:4: ", "expected a direction"},
        {MJCF("", "<joint/>", "<keyframe><key qpos='1 2'/></keyframe>"),
         "x.urdf:4: ", "expected 1 finite number"},
        {"<mujoco/>", "x.urdf:1: ", "without <worldbody>"},
        {"<mujoco><worldbody/></mujoco>", "x.urdf:1: ", "0 bodies"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        import_bad(cases[i].text, cases[i].place, cases[i].words);
    }
}

TEST_WITH(mjcf_joints_may_follow_each_other, open_default, close_arena)
{
    const char *text = MJCF("", "<joint name='j'/><joint name='k' axis='1 0 0'/>",
                            "<equality><joint joint1='k' joint2='j' polycoef='0.1 2 0 0 0'/>"
                            "</equality>");

    import_bad(text, "x.urdf:4: ", "\"k\" that follows \"j\"");
    options.mimic = IMPORT_MIMIC_LOCK;
    import_good(text);
    assert_int_equal(made.robot->njoint, 1);
    assert_true(noted(IMPORT_CHANGED, 4, "fixed at 0.1 rad"));
}

/* ---- drives ---- */

TEST_WITH(drives_follow_effort_and_velocity, open_default, close_arena)
{
    const struct robot_sea *sea;

    import_good(ROBOT(
        LINK("base") "<link name='a'><inertial><origin xyz='0.2 0 0'/><mass value='1'/>" INERTIA
                     "</inertial></link>\n" JOINT(
                         "j", "revolute", "base", "a",
                         LIMIT) "<transmission name='t'><joint name='j'/><actuator name='m'>"
                                "<mechanicalReduction>50</mechanicalReduction></actuator></"
                                "transmission>"));
    sea = &made.robot->joint[0].sea;
    assert_near(made.robot->joint[0].torque_limit, 10.0, 0.0);
    assert_near(sea->N, 50.0, 0.0);
    assert_near(sea->Kt * 4.5, 24.0, 1e-12); /* no load at 1.5 times 3 rad/s */
    assert_near(sea->Kt * (24.0 - sea->Kw * 3.0) / sea->R, 10.0, 1e-12); /* full strength there */
    assert_near(sea->Ks, 1000.0, 1e-9);
}

TEST_WITH(placeholders_are_no_strength, open_default, close_arena)
{
    import_good(ROBOT(
        LINK("base") "<link name='a'><inertial><origin xyz='0.2 0 0'/><mass value='1'/>" INERTIA
                     "</inertial></link>\n" JOINT("j", "revolute", "base", "a",
                                                  "<limit lower='-1' upper='1' effort='1000' "
                                                  "velocity='1000'/>")));
    assert_near(made.robot->joint[0].torque_limit, 3.0 * 9.81 * 0.2, 1e-9);
    assert_true(noted(IMPORT_ASSUMED, 4, "effort 1000 is a placeholder"));
    assert_true(noted(IMPORT_ASSUMED, 4, "velocity 1000 is a placeholder"));
}

/* ---- what MuJoCo means ---- */

/* A capsule along any direction has its inertia there, by its ends or by zaxis */
TEST_WITH(capsules_lie_along_their_direction, open_default, close_arena)
{
    static const double directions[][3] = {{1, 1, 1}, {1, -1, 1}, {-1, -1, -1},   {0, 0, 1},
                                           {1, 0, 0}, {0, 0, -1}, {0.6, 0.6, 0.5}};
    const double r = 0.03, length = 0.4, density = 1000.0;
    const double rod = density * M_PI * r * r * length,
                 ball = density * 4.0 / 3.0 * M_PI * r * r * r;
    const double along = rod * r * r / 2.0 + ball * 0.4 * r * r;
    const double across = rod * (3.0 * r * r + length * length) / 12.0 +
                          ball * (0.4 * r * r + 0.375 * r * length + 0.25 * length * length);

    for (size_t i = 0; i < 2 * sizeof directions / sizeof *directions; i++) {
        const double *d = directions[i / 2];
        const double size = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        char text[1024], geom[256];

        if (i % 2) {
            snprintf(geom, sizeof geom, "size='0.03 0.2' zaxis='%g %g %g'", d[0], d[1], d[2]);
        } else {
            snprintf(geom, sizeof geom, "size='0.03' fromto='0 0 0 %.17g %.17g %.17g'",
                     length * d[0] / size, length * d[1] / size, length * d[2] / size);
        }
        snprintf(text, sizeof text,
                 MJCF("", "<body name='b'><joint name='j'/><geom type='capsule' %s/></body>", ""),
                 geom);
        import_good(text);
        for (int a = 0; a < 3; a++) {
            for (int b = a; b < 3; b++) {
                const double expected =
                    (a == b ? across : 0.0) + (along - across) * d[a] * d[b] / (size * size);

                assert_near(made.robot->body[1].inertia.I[sym3_index[a][b]], expected,
                            1e-12 * across);
            }
        }
    }
}

/* Boxes and ellipsoids by their ends too: one size is given, the ones across are the same */
TEST_WITH(blocks_are_placed_by_their_ends, open_default, close_arena)
{
    import_good(MJCF("",
                     "<body name='b'><joint name='j'/><geom type='box' size='0.1' "
                     "fromto='0 0 0 0.6 0 0'/></body>",
                     ""));
    assert_near(made.robot->body[1].inertia.mass, 0.6 * 0.2 * 0.2 * 1000.0, 1e-9);
    assert_near(made.robot->body[1].inertia.com[0], 0.3, 1e-12);
    assert_near(made.robot->body[1].inertia.I[0], 24.0 * (0.04 + 0.04) / 12.0, 1e-9);
    import_bad(
        MJCF("", "<body name='b'><geom type='capsule' size='1' fromto='1 1 1 1 1 1'/></body>", ""),
        "x.urdf:4: ", "fromto of length 0");
    import_bad(MJCF("", "<body name='b'><geom type='sphere' size='1' zaxis='0 0 0'/></body>", ""),
               "x.urdf:4: ", "found an orientation of <geom>");
}

/* A fixed tendon with the coefficient -0.5: the joint gets half of the actuator's force */
#define TENDON                                                                                     \
    "</actuator><tendon><fixed name='t'><joint joint='j' coef='-0.5'/></fixed></tendon><actuator>"

TEST_WITH(limits_of_actuators_add_up, open_default, close_arena)
{
    static const struct {
        const char *joint, *actuators;
        double torque;
    } cases[] = {
        {"", "<position joint='j' forcerange='-15 15'/><velocity joint='j' forcerange='-5 4'/>",
         20},
        {"", "<motor joint='j' gear='10' ctrlrange='-4 4'/><motor joint='j' ctrlrange='-2 2'/>",
         42},
        {"actuatorfrcrange='-8 8'", "<motor joint='j' ctrlrange='-12 12'/>", 8},
        {"actuatorfrcrange='-9 9'", "<motor joint='j' ctrlrange='-6 6'/>", 6},
        {"actuatorfrcrange='-7 7'", "<motor joint='j' ctrlrange='-6 6'/><position joint='j'/>", 7},
        {"actuatorfrcrange='-7 7'", "<motor joint='j' ctrlrange='-2 2' ctrllimited='false'/>", 7},
        {"", "<motor tendon='t' gear='2' ctrlrange='-5 3'/>" TENDON, 5},
        {"", "<motor joint='j' ctrlrange='-6 6'/><position tendon='t' forcerange='-4 4'/>" TENDON,
         8},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1024];

        snprintf(text, sizeof text,
                 MJCF("",
                      "<body name='b'><inertial mass='1' pos='0.3 0 0' diaginertia='1 1 1'/>"
                      "<joint name='j' axis='0 1 0' %s/></body>",
                      "<actuator>%s</actuator>"),
                 cases[i].joint, cases[i].actuators);
        import_good(text);
        assert_near(made.robot->joint[0].torque_limit, cases[i].torque, 1e-9);
    }
}

#define TWO_LINKS                                                                                  \
    "<body name='b'><inertial mass='1' pos='0.3 0 0' diaginertia='1 1 1'/><joint name='j' "        \
    "axis='0 1 0'/><body name='c'><inertial mass='1' pos='0.3 0 0' diaginertia='1 1 1'/>"          \
    "<joint name='k' axis='0 1 0'/></body></body>"

TEST_WITH(joints_without_an_actuator_turn_freely, open_default, close_arena)
{
    import_good(MJCF("", TWO_LINKS, "<actuator><motor joint='k'/></actuator>"));
    assert_false(made.robot->joint[0].sea.present);
    assert_true(made.robot->joint[1].sea.present);
    assert_true(noted(IMPORT_CHANGED, 4, "joint \"j\" has no actuator"));

    /* Without actuators, or with an actuator of an unknown tendon, all joints are driven */
    import_good(MJCF("", TWO_LINKS, ""));
    assert_true(made.robot->joint[0].sea.present && made.robot->joint[1].sea.present);
    import_good(MJCF("", TWO_LINKS, "<actuator><motor joint='k'/><motor tendon='t'/></actuator>"));
    assert_true(made.robot->joint[0].sea.present && made.robot->joint[1].sea.present);

    /* An actuator of a fixed tendon drives only the joints of this tendon */
    import_good(MJCF("", TWO_LINKS,
                     "<tendon><fixed name='t'><joint joint='k' coef='1'/></fixed></tendon>"
                     "<actuator><motor tendon='t'/></actuator>"));
    assert_true(!made.robot->joint[0].sea.present && made.robot->joint[1].sea.present);
    assert_true(noted(IMPORT_CHANGED, 4, "tendon \"t\": each of its joints has a drive"));
}

/* All bodies are scaled, as MuJoCo does; the inertia about the joint's axis follows */
TEST_WITH(total_mass_scales_all_bodies, open_default, close_arena)
{
    import_good(MJCF("<compiler settotalmass='6'/>", TWO_LINKS, ""));
    assert_near(made.robot->total_mass, 6.0, 1e-14);
    assert_near(made.robot->body[2].inertia.mass, 2.0, 1e-15);
    assert_near(made.robot->body[2].inertia.I[3], 2.0, 1e-15);
    assert_near(made.robot->body[2].inertia.com[0], 0.3, 1e-15);
}

/* MuJoCo subtracts refpos from the vertices, rotates them by the inverse of refquat (here a right
 * angle about z), and scales them. Import uses the mesh for a shape that MuJoCo fits to the mesh */
TEST_WITH(meshes_are_moved_by_their_reference, open_default, close_arena)
{
    import_good(MJCF("<asset><mesh name='m' file='m.obj' refpos='1 2 3' refquat='1 0 0 1' "
                     "scale='2 2 2'/></asset>",
                     "<joint/><geom type='mesh' mesh='m' pos='0 0 1'/>\n"
                     "<geom type='box' mesh='m' rgba='' pos='0 0 1'/>",
                     ""));
    for (size_t g = 0; g < 2; g++) {
        const struct import_geometry *shape = &model.geometry[g];

        assert_int_equal(shape->shape, IMPORT_MESH);
        assert_near(shape->place.xyz[0], -4.0, 1e-15);
        assert_near(shape->place.xyz[1], 2.0, 1e-15);
        assert_near(shape->place.xyz[2], -5.0, 1e-15);
        assert_near(shape->place.R[1], 1.0, 1e-15);
    }
    assert_true(noted(IMPORT_SHAPED, 5, "MuJoCo fits to mesh \"m\""));

    /* A link that stands still needs no mass, so the fit is not computed */
    import_good(
        "<mujoco><asset><mesh name='m' file='m.obj'/></asset><worldbody><body name='base'>\n"
        "<geom type='box' mesh='m'/><body name='a'><joint/><geom size='1'/></body></body>"
        "</worldbody></mujoco>");
    assert_true(noted(IMPORT_DROPPED, 2, "its body stands still"));
}

TEST_WITH(constraints_that_are_not_active_close_no_loop, open_default, close_arena)
{
    import_good(MJCF("", TWO_LINKS,
                     "<equality>\n<weld body1='b' active='false'/>"
                     "<connect body1='b' body2='c' active='false'/></equality>"));
    assert_true(noted(IMPORT_DROPPED, 5, "equality <weld>: it is not active"));
    assert_true(noted(IMPORT_DROPPED, 5, "equality <connect>: it is not active"));
    import_bad(MJCF("", TWO_LINKS, "<equality>\n<weld body1='b' active='true'/></equality>"),
               "x.urdf:5: ", "closes a loop");
}

TEST_WITH(slides_without_range_slide_far, open_default, close_arena)
{
    options.free_slides = true;
    import_good(MJCF("",
                     "<body name='b'><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>"
                     "<joint name='j' type='slide' axis='1 0 0'/></body>",
                     ""));
    assert_near(made.robot->joint[0].upper, 100.0, 0.0);
    assert_true(noted(IMPORT_CHANGED, 4, "slides without limits"));
}

/* ---- efforts, sizes and names ---- */

/* A balanced wheel bears nothing, which does not make its effort a placeholder */
TEST_WITH(effort_of_a_balanced_wheel_counts, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("w") JOINT(
        "j", "continuous", "base", "w", "<axis xyz='0 1 0'/><limit effort='5' velocity='20'/>")));
    assert_near(made.robot->joint[0].torque_limit, 5.0, 0.0);
    import_good(ROBOT(LINK("base") LINK("w")
                          JOINT("j", "continuous", "base", "w",
                                "<axis xyz='0 1 0'/><limit effort='1000' velocity='20'/>")));
    assert_true(noted(IMPORT_ASSUMED, 4, "the file's effort 1000 is a placeholder"));
}

/* Wheels without effort move their share of the weight, against their friction and damping */
TEST_WITH(wheels_without_effort_are_strong_enough_to_drive, open_default, close_arena)
{
    static const struct {
        const char *limit;
        double speed;
    } row[] = {{"", 2 * M_PI}, {"<limit effort='0' velocity='20'/>", 20}};

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        char text[1024];

        snprintf(text, sizeof text,
                 ROBOT(LINK("base") LINK("v") LINK("w") JOINT("j", "continuous", "base", "v",
                                                              "<axis xyz='0 1 0'/>")
                           JOINT("k", "continuous", "base", "w",
                                 "<axis xyz='0 1 0'/>%s<dynamics friction='2' damping='0.5'/>")),
                 row[i].limit);
        import_good(text);
        assert_true(made.rolls && made.robot->floating);
        assert_true(made.robot->joint[0].torque_limit >= 0.5 * 3 * 9.81 * 0.1 - 1e-9);
        assert_near(made.robot->joint[1].torque_limit,
                    made.robot->joint[0].torque_limit + 2 + 0.5 * row[i].speed, 1e-9);
    }
}

/* A castor trails, turns low, and has no transmission */
TEST_WITH(castors_of_a_robot_that_rolls_turn_freely, open_default, close_arena)
{
    static const struct {
        const char *place, *more;
        bool free;
    } row[] = {{"-0.02 0 -0.03", "", true},
               {"0 0 -0.03", "", false},
               {"0 0.02 -0.03", "", false},
               {"-0.02 0 0.5", "", false},
               {"-0.02 0 -0.03", "<transmission name='t'><joint name='s'/></transmission>", false}};

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        char text[2048];

        snprintf(text, sizeof text,
                 ROBOT(LINK("base") LINK("v") LINK("w") LINK("swivel") LINK("roll")
                           JOINT("j", "continuous", "base", "v", "<axis xyz='0 1 0'/>")
                               JOINT("k", "continuous", "base", "w", "<axis xyz='0 1 0'/>")
                                   JOINT("s", "continuous", "base", "swivel", "<axis xyz='0 0 1'/>")
                                       JOINT("r", "continuous", "swivel", "roll",
                                             "<axis xyz='0 1 0'/><origin xyz='%s'/>") "%s"),
                 row[i].place, row[i].more);
        import_good(text);
        assert_int_equal(made.robot->njoint, 4);
        for (size_t j = 0; j < 4; j++) {
            const char *name = made.robot->joint[j].name;

            assert_int_equal(made.robot->joint[j].sea.present,
                             !row[i].free || *name == 'j' || *name == 'k');
        }
    }
}

TEST_WITH(shapes_of_size_0_are_dropped, open_default, close_arena)
{
    static const char *const shapes[] = {"<box size='0 0 0'/>", "<box size='1 0 1'/>",
                                         "<cylinder radius='0' length='1'/>",
                                         "<cylinder radius='1' length='0'/>"};

    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        for (int collision = 0; collision < 2; collision++) {
            const char *kind = collision ? "collision" : "visual";
            char text[2048];

            snprintf(
                text, sizeof text,
                ROBOT(LINK("base") "<link name='a'><inertial><mass value='1'/>" INERTIA
                                   "</inertial><%s><geometry>%s</geometry></%s></link>\n" JOINT(
                                       "j", "revolute", "base", "a", LIMIT)),
                kind, shapes[i], kind);
            import_good(text);
            assert_int_equal(model.ngeometry, 0);
            assert_true(noted(IMPORT_DROPPED, 3, "a shape of size 0"));
        }
    }
}

TEST_WITH(names_that_would_become_one_stay_apart, open_default, close_arena)
{
    import_good(ROBOT(LINK("base") LINK("l/a") LINK("l_a") LINK("l:a") JOINT(
        "j", "revolute", "base", "l/a", LIMIT) JOINT("k", "revolute", "l/a", "l_a", LIMIT)
                          JOINT("m", "revolute", "l_a", "l:a", LIMIT)));
    assert_string_equal(made.robot->body[1].name, "l_a-2");
    assert_string_equal(made.robot->body[2].name, "l_a");
    assert_string_equal(made.robot->body[3].name, "l_a-3");
    assert_true(noted(IMPORT_CHANGED, 3, "body \"l/a\" is named \"l_a-2\""));
}

TEST_WITH(robots_without_masses_are_refused_for_that, open_default, close_arena)
{
    import_bad(ROBOT(HOLLOW("base") HOLLOW("a") JOINT("j", "revolute", "base", "a", LIMIT)),
               "x.urdf:2: ", "found no mass in the whole robot");
}
