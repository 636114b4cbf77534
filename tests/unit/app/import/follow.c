/* SPDX-License-Identifier: Apache-2.0 */
/* Joints that follow others, of URDF and MJCF: their couplings, drives, poses, and what cannot be.
 */
#include "app/import/drive.h"
#include "app/import/joint_inertia.h"

#include "tests/physics/near.h"
#include "tests/unit/app/import/text.h"

FIXTURE(open_coupled)
{
    int failed = open_default(test_state);

    options.mimic = IMPORT_MIMIC_COUPLE;
    return failed;
}

#define ROD(name)                                                                                  \
    "<link name='" name "'><inertial><origin xyz='0.2 0 0'/><mass value='1'/>" INERTIA             \
    "</inertial></link>\n"

/* A joint in line 5 and one that follows it, in line 6. */
#define PAIR(follower, mimic)                                                                      \
    ROBOT(LINK("base") ROD("a") ROD("b") JOINT("j", "revolute", "base", "a", LIMIT)                \
              JOINT("m", follower, "base", "b", LIMIT "<mimic joint='j' " mimic "/>"))

TEST_WITH(follower_is_coupled_and_has_no_drive, open_coupled, close_arena)
{
    const struct robot_coupling *c;

    import_good(PAIR("revolute", "multiplier='2' offset='0.25'"));
    assert_int_equal(made.robot->njoint, 2);
    assert_int_equal(made.robot->ncoupling, 1);
    c = &made.robot->coupling[0];
    assert_int_equal(c->follower, 1);
    assert_int_equal(c->leader, 0);
    assert_near(c->multiplier, 2.0, 0.0);
    assert_near(c->offset, 0.25, 0.0);
    assert_true(made.robot->joint[0].sea.present);
    assert_false(robot_joint_is_driven(&made.robot->joint[1]));
    assert_near(made.robot->joint[1].torque_limit, 5.0, 1e-12);

    /* 1000 rad/s of its own 0.1 kg m2, more than 1 mrad of the leader's under 10 N m */
    assert_near(c->stiffness, 1e6 * 0.1, 1e-4);
    assert_near(c->damping, 2.0 * 1000.0 * 0.1, 1e-6);
    assert_near(made.rest[1], 0.25, 0.0);
    assert_true(
        noted(IMPORT_ASSUMED, 6,
              "joint \"m\" follows \"j\", 2 times its position + 0.25, through a coupling of "
              "1e+05 N m/rad and 200 N m s/rad"));
}

TEST_WITH(light_follower_is_coupled_as_stiffly_as_its_leader_is_strong, open_coupled, close_arena)
{
    import_good(ROBOT(LINK("base") ROD(
        "a") "<link name='b'><inertial><mass value='0.001'/><inertia ixx='1e-6' "
             "iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='0'/></inertial></link>\n" JOINT(
                 "j", "revolute", "base", "a", LIMIT)
                          JOINT("m", "revolute", "base", "b",
                                LIMIT "<mimic joint='j' multiplier='-2'/>")));
    assert_near(made.robot->coupling[0].stiffness, 10.0 / (1e-3 * 4.0), 1e-9);
    assert_near(made.robot->coupling[0].damping, 2.0 * sqrt(2500.0 * 1e-6), 1e-9);
}

/* a = 2 b - 0.1, b = -3 c + 0.2: a = -6 c + 0.3, whatever the order in the file. */
TEST_WITH(chain_is_led_by_its_first_joint, open_coupled, close_arena)
{
    import_good(ROBOT(
        LINK("base") LINK("x") LINK("y") LINK("z") JOINT(
            "a", "continuous", "base", "x", "<mimic joint='b' multiplier='2' offset='-0.1'/>")
            JOINT("b", "continuous", "base", "y", "<mimic joint='c' multiplier='-3' offset='0.2'/>")
                JOINT("c", "revolute", "base", "z", LIMIT)));
    assert_int_equal(made.robot->ncoupling, 2);
    assert_int_equal(made.robot->coupling[0].leader, 2);
    assert_near(made.robot->coupling[0].multiplier, -6.0, 1e-15);
    assert_near(made.robot->coupling[0].offset, 0.3, 1e-15);
    assert_int_equal(made.robot->coupling[1].leader, 2);
    assert_near(made.rest[0], 0.3, 1e-15);
    assert_near(made.rest[1], 0.2, 1e-15);
}

TEST_WITH(circles_are_refused, open_coupled, close_arena)
{
    for (options.mimic = IMPORT_MIMIC_REFUSE; options.mimic <= IMPORT_MIMIC_COUPLE;
         options.mimic++) {
        import_bad(ROBOT(LINK("base") LINK("a")
                             JOINT("m", "revolute", "base", "a", LIMIT "<mimic joint='m'/>")),
                   "x.urdf:4: ", "ends in a circle");
        import_bad(ROBOT(LINK("base") LINK("a") LINK("b")
                             JOINT("m", "revolute", "base", "a", LIMIT "<mimic joint='n'/>")
                                 JOINT("n", "revolute", "base", "b", LIMIT "<mimic joint='m'/>")),
                   "x.urdf:5: ", "ends in a circle");
    }
}

TEST_WITH(numbers_that_no_coupling_has_are_refused, open_coupled, close_arena)
{
    import_good(PAIR("revolute", "multiplier='0' offset='0.5'"));
    assert_int_equal(made.robot->njoint, 1);
    assert_int_equal(made.robot->ncoupling, 0);
    assert_true(noted(IMPORT_CHANGED, 6, "fixed at 0.5 rad: it follows another 0 times"));
    import_bad(PAIR("revolute", "multiplier='1e-9'"), "x.urdf:6: ", "multiplier 1e-09");
    import_bad(PAIR("revolute", "multiplier='-1e4'"), "x.urdf:6: ", "multiplier -10000");
    import_bad(PAIR("continuous", "offset='1e300'"), "x.urdf:6: ", "offset 1e+300");
    import_bad(PAIR("revolute", "multiplier='nan'"), "x.urdf:6: ", "multiplier");
    import_bad(PAIR("revolute", "multiplier='inf'"), "x.urdf:6: ", "multiplier");
    import_bad(PAIR("revolute", "multiplier='1 2'"), "x.urdf:6: ", "multiplier");
    import_bad(PAIR("revolute", "multiplier='1' offset='20'"),
               "x.urdf:6: ", "limits -1 to 2 that exclude where \"j\" leads it");
    import_bad(PAIR("continuous", "offset='900'"),
               "x.urdf:6: ", "that exclude where \"j\" leads it");
}

/* The leader rests, and stands in poses, where the follower can be too. */
TEST_WITH(leader_rests_where_its_follower_can_follow, open_coupled, close_arena)
{
    import_good(PAIR("revolute", "multiplier='2' offset='-1.4'"));
    assert_true(made.rest[0] >= 0.2);
    assert_near(made.rest[1], 2.0 * made.rest[0] - 1.4, 1e-15);
    assert_true(made.rest[1] >= -1.0);
    assert_near(made.robot->pose[0].joint[0], made.rest[0], 0.0);
    assert_near(made.robot->pose[0].joint[1], made.rest[1], 1e-15);
    assert_near(made.robot->joint[0].lower, -1.0, 0.0); /* its own range is what it was */
}

TEST_WITH(follower_of_a_fixed_joint_is_fixed, open_coupled, close_arena)
{
    static const char *const lock[] = {"j"};

    options.lock = lock;
    options.nlock = 1;
    import_good(ROBOT(
        LINK("base") LINK("a") LINK("b") LINK("c") JOINT("k", "revolute", "base", "c", LIMIT)
            JOINT("j", "revolute", "base", "a", LIMIT)
                JOINT("m", "revolute", "base", "b", LIMIT "<mimic joint='j' offset='0.4'/>")));
    assert_int_equal(made.robot->njoint, 1);
    assert_int_equal(made.robot->ncoupling, 0);
    assert_true(noted(IMPORT_CHANGED, 8, "fixed at 0.4 rad: it follows a joint that is fixed"));
}

/* What slides has no drive, but may follow what has one. */
TEST_WITH(slide_follows_a_joint_that_turns, open_coupled, close_arena)
{
    import_good(PAIR("prismatic", "multiplier='0.01'"));
    assert_int_equal(made.robot->njoint, 2);
    assert_int_equal(made.robot->joint[1].type, JOINT_PRISMATIC);
    assert_int_equal(made.robot->ncoupling, 1);
    assert_near(made.robot->joint[1].torque_limit, 1000.0, 1e-9);
    assert_near(made.robot->coupling[0].stiffness, 10.0 / (1e-3 * 1e-4), 1e-3);
    assert_true(noted(IMPORT_ASSUMED, 6, "1e+08 N/m"));

    /* Two that slide: neither has a drive */
    import_good(ROBOT(LINK("base") LINK("a") LINK("b") LINK("c") JOINT(
        "k", "revolute", "base", "c", LIMIT) JOINT("j", "prismatic", "base", "a", LIMIT)
                          JOINT("m", "prismatic", "base", "b", LIMIT "<mimic joint='j'/>")));
    assert_int_equal(made.robot->njoint, 1);
    options.free_slides = true;
    import_good(ROBOT(LINK("base") LINK("a") LINK("b") LINK("c") JOINT(
        "k", "revolute", "base", "c", LIMIT) JOINT("j", "prismatic", "base", "a", LIMIT)
                          JOINT("m", "prismatic", "base", "b", LIMIT "<mimic joint='j'/>")));
    assert_int_equal(made.robot->njoint, 3);
    assert_int_equal(made.robot->ncoupling, 1);
    assert_near(made.robot->coupling[0].stiffness, 1e6, 1e-6);
}

/* A slide of 0.5 m has a pinion of 0.5 / 12 m; one that follows it is led by the pinion too */
TEST_WITH(slide_is_driven_by_a_pinion, open_coupled, close_arena)
{
    const double radius = 0.5 / 12.0;
    const struct robot_joint *pinion;

    options.drive_slides = true;
    import_good(ROBOT(LINK("base") ROD("a") ROD("b") JOINT(
        "s", "prismatic", "base", "a",
        "<limit lower='-0.1' upper='0.5' effort='24' "
        "velocity='0.4'/><dynamics damping='3' "
        "friction='0.6'/>") JOINT("t", "prismatic", "base", "b",
                                  "<limit lower='-1' upper='1' effort='24' velocity='0.4'/>"
                                  "<dynamics damping='2'/><mimic joint='s' multiplier='-0.5'/>")));
    assert_int_equal(made.robot->njoint, 3);
    assert_int_equal(made.robot->ncoupling, 2);
    pinion = &made.robot->joint[made.robot->coupling[0].leader];
    assert_string_equal(pinion->name, "s-pinion");
    assert_true(pinion->sea.present && pinion->type == JOINT_REVOLUTE);
    assert_near(pinion->lower, -0.1 / radius, 1e-12);
    assert_near(pinion->upper, 12.0, 1e-12);
    assert_near(pinion->torque_limit, 24.0 * radius, 1e-12);
    assert_near(pinion->sea.Dm, 3.0 * radius * radius, 1e-12);
    for (int i = 0; i < 2; i++) {
        const struct robot_coupling *c = &made.robot->coupling[i];
        const struct robot_joint *joint = &made.robot->joint[c->follower];

        assert_string_equal(joint->name, i ? "t" : "s");
        assert_int_equal(c->leader, made.robot->coupling[0].leader);
        assert_near(c->multiplier, i ? -0.5 * radius : radius, 1e-12);
        assert_near(joint->passive.damping, i ? 2.0 : 0.0, 0.0);
    }
    assert_true(noted(IMPORT_ASSUMED, 5, "joint \"s\" slides by a pinion"));
}

TEST_WITH(couplings_are_as_many_as_a_robot_has, open_coupled, close_arena)
{
    char text[16384];
    size_t used = (size_t)snprintf(text, sizeof text, "<robot name='r'>\n%s%s%s", LINK("base"),
                                   LINK("a"), JOINT("j", "revolute", "base", "a", LIMIT));

    for (int i = 0; i <= ROBOT_COUPLINGS_MAX; i++) {
        used += (size_t)snprintf(text + used, sizeof text - used,
                                 "<link name='l%d'><inertial><mass value='1'/>" INERTIA
                                 "</inertial></link><joint name='m%d' type='continuous'><parent "
                                 "link='base'/><child link='l%d'/><mimic joint='j'/></joint>\n",
                                 i, i, i);
        assert_true(used < sizeof text - 16);
        strcpy(text + used, "</robot>");
        if (i < ROBOT_COUPLINGS_MAX) {
            import_good(text);
            assert_int_equal(made.robot->ncoupling, i + 1);
        }
    }
    import_bad(text, "x.urdf:37: ", "one more than the 32 that may");
}

/* ---- drives ---- */

#define WEAK "<limit lower='-1' upper='1' effort='1000' velocity='3'/>"

/* Two rods on one axis, one following the other, are as one rod of both: the leader's drive and the
 * gains of its loop are those of the one. */
TEST_WITH(leader_carries_what_two_joints_weigh, open_coupled, close_arena)
{
    struct import_gains gains[2][2] = {{{0}}};
    double strength[2];

    for (int i = 0; i < 2; i++) {
        import_good(i ? ROBOT(LINK("base") ROD("a") ROD("b")
                                  JOINT("j", "revolute", "base", "a", "<axis xyz='0 1 0'/>" WEAK)
                                      JOINT("m", "revolute", "base", "b",
                                            "<axis xyz='0 1 0'/>" WEAK "<mimic joint='j'/>"))
                      : ROBOT(LINK("base") ROD("a") ROD("b")
                                  JOINT("j", "revolute", "base", "a", "<axis xyz='0 1 0'/>" WEAK)
                                      JOINT("m", "fixed", "a", "b", "")));
        strength[i] = made.robot->joint[0].torque_limit;
        assert_ok(import_find_gains(made.robot, made.rest, false, &arena, gains[i], &error));
    }
    assert_near(strength[0], 3.0 * 2.0 * 9.81 * 0.2, 1e-9);
    assert_near(strength[1], strength[0], 1e-9);
    assert_true(gains[0][0].kp_v_per_rad > 0.0 && gains[0][0].kd_v_s_per_rad > 0.0);
    assert_near(gains[1][0].kp_v_per_rad, gains[0][0].kp_v_per_rad,
                1e-9 * gains[0][0].kp_v_per_rad);
    assert_near(gains[1][0].kd_v_s_per_rad, gains[0][0].kd_v_s_per_rad,
                1e-9 * gains[0][0].kd_v_s_per_rad);
    assert_near(gains[1][1].kp_v_per_rad, 0.0, 0.0);
}

/* The inertia of what follows counts by the square of the multiplier, held or not. */
TEST_WITH(trial_shows_what_follows, open_coupled, close_arena)
{
    struct import_trial trial;
    double rotor;

    import_good(
        ROBOT(LINK("base") LINK("a") LINK("b") JOINT("j", "revolute", "base", "a", LIMIT)
                  JOINT("m", "revolute", "base", "b", LIMIT "<mimic joint='j' multiplier='-3'/>")));
    assert_ok(import_trial_make(made.robot, made.rest, &arena, &trial, &error));
    rotor = made.robot->joint[0].sea.J;
    assert_near(import_trial_held_inertia(&trial, 0), 0.1 + 9.0 * 0.1, 1e-12);
    assert_near(import_trial_held_inertia(&trial, 1), 0.1, 1e-12);
    assert_near(import_trial_inertia(&trial, 0), 0.1 + rotor + 9.0 * 0.1, 1e-12);
    assert_near(import_trial_inertia(&trial, 1), 0.1 + (0.1 + rotor) / 9.0, 1e-12);
}

TEST_WITH(drives_of_the_catalogue_are_for_leaders, open_coupled, close_arena)
{
    static const char *all[] = {HIL_SOURCE_DIR "/config/drives/cubemars-ak80-6.yaml"};
    static const char *one[] = {"m=" HIL_SOURCE_DIR "/config/drives/cubemars-ak80-6.yaml"};

    options.drive = all;
    options.ndrive = 1;
    import_good(PAIR("revolute", "multiplier='1'"));
    assert_non_null(made.drive[0]);
    assert_null(made.drive[1]);
    assert_false(made.robot->joint[1].sea.present);
    options.drive = one;
    assert_int_equal(import_text(PAIR("revolute", "multiplier='1'")), ERROR_INPUT);
    assert_non_null(strstr(error.text, "expected a joint that turns before the ="));
}

/* ---- MJCF ---- */

#define TWO(actuator, equality)                                                                    \
    MJCF("",                                                                                       \
         "<joint name='j'/>\n<body name='b'><inertial mass='1' pos='0 1 0' diaginertia='1 1 1'/>"  \
         "<joint name='k' axis='1 0 0'/></body>\n",                                                \
         "<actuator>" actuator "</actuator>\n<equality>" equality "</equality>\n")

TEST_WITH(equality_couples_joints, open_coupled, close_arena)
{
    const struct robot_coupling *c;

    import_good(TWO("", "<joint joint1='k' joint2='j' polycoef='0.1 2 0 0 0'/>"));
    c = &made.robot->coupling[0];
    assert_int_equal(made.robot->ncoupling, 1);
    assert_string_equal(made.robot->joint[c->follower].name, "k");
    assert_near(c->multiplier, 2.0, 0.0);
    assert_near(c->offset, 0.1, 0.0);

    /* By default one for one; fewer coefficients are those that there are */
    import_good(TWO("", "<joint joint1='k' joint2='j'/>"));
    assert_near(made.robot->coupling[0].multiplier, 1.0, 0.0);
    import_good(TWO("", "<joint joint1='k' joint2='j' polycoef='0.5'/>"));
    assert_near(made.robot->coupling[0].offset, 0.5, 0.0);
    assert_near(made.robot->coupling[0].multiplier, 1.0, 0.0);
}

/* k = 0.1 + 2 j, read the other way where k has the actuator: j = 0.5 k - 0.05. */
TEST_WITH(joint_with_the_actuator_leads, open_coupled, close_arena)
{
    const struct robot_coupling *c;

    import_good(TWO("<motor joint='k' ctrlrange='-20 20'/>",
                    "<joint joint1='k' joint2='j' polycoef='0.1 2 0 0 0'/>"));
    c = &made.robot->coupling[0];
    assert_string_equal(made.robot->joint[c->leader].name, "k");
    assert_near(c->multiplier, 0.5, 1e-15);
    assert_near(c->offset, -0.05, 1e-15);
    assert_near(made.robot->joint[c->leader].torque_limit, 20.0, 1e-12);
    import_good(TWO("<motor joint='j' ctrlrange='-20 20'/>",
                    "<joint joint1='k' joint2='j' polycoef='0.1 2 0 0 0'/>"));
    assert_string_equal(made.robot->joint[made.robot->coupling[0].leader].name, "j");
}

TEST_WITH(equalities_that_are_no_coupling, open_coupled, close_arena)
{
    import_bad(TWO("", "<joint joint1='k' joint2='j' polycoef='0 1 0.5 0 0'/>"),
               "x.urdf:7: ", "by a polynomial, expected a straight line");
    import_bad(TWO("", "<joint joint1='k' joint2='x'/>"),
               "x.urdf:7: ", "found joint2 \"x\" of an equality");
    import_bad(TWO("", "<joint joint2='j'/>"), "x.urdf:7: ", "without joint1");
    import_bad(TWO("", "<joint joint1='k' joint2='j' polycoef='0 nan'/>"),
               "x.urdf:7: ", "polycoef");
    import_bad(TWO("", "<joint joint1='k' joint2='j'/><joint joint1='k' joint2='j'/>"),
               "x.urdf:7: ", "ends in a circle");

    /* Off, or of one joint alone */
    import_good(TWO("", "<joint joint1='k' joint2='j' active='false'/>"));
    assert_int_equal(made.robot->ncoupling, 0);
    assert_int_equal(made.robot->njoint, 2);
    assert_true(noted(IMPORT_DROPPED, 7, "it is not active"));
    import_good(TWO("", "<joint joint1='k' polycoef='0.3 0 0 0 0'/>"));
    assert_int_equal(made.robot->njoint, 1);
    assert_true(noted(IMPORT_CHANGED, 5, "fixed at 0.3 rad"));
}

/* A keyframe that puts a follower elsewhere is not obeyed there, and says so. */
TEST_WITH(poses_follow, open_coupled, close_arena)
{
    import_good(MJCF("",
                     "<joint name='j'/>\n<body name='b'><inertial mass='1' pos='0 0 0' "
                     "diaginertia='1 1 1'/><joint name='k' axis='1 0 0'/></body>\n",
                     "<equality><joint joint1='k' joint2='j' polycoef='0.1 2 0 0 0'/></equality>\n"
                     "<keyframe><key name='up' qpos='0.2 0.5'/><key name='far' qpos='0.3 -1'/>"
                     "</keyframe>"));
    assert_int_equal(made.robot->npose, 3);
    assert_near(made.robot->pose[0].joint[1], 0.1, 0.0);
    assert_near(made.robot->pose[1].joint[1], 0.5, 1e-15);
    assert_near(made.robot->pose[2].joint[1], 0.7, 1e-15);
    assert_true(noted(IMPORT_CHANGED, 7,
                      "pose \"far\": joint \"k\" is at 0.7, where \"j\" leads it, not at -1"));
    assert_false(noted(IMPORT_CHANGED, 7, "pose \"up\""));
}
