/* SPDX-License-Identifier: Apache-2.0 */
/* Robot files: what COMAN's says, and what is refused, where and why. */
#include "tests/physics/near.h"
#include "tests/unit/model/coman.h"

#include "model/dynamics.h"
#include "model/spatial.h"

#include <unistd.h>

/* ---- COMAN ---- */

TEST_WITH(coman_has_24_bodies_29_freedoms_and_its_mass, open_arena, close_arena)
{
    const struct robot *robot = load_coman(NULL);

    assert_string_equal(robot->name, "COMAN");
    assert_int_equal(robot->nbody, 24);
    assert_int_equal(robot->njoint, 23);
    assert_int_equal(robot->nq, 30);
    assert_int_equal(robot->nv, 29);
    assert_true(robot->floating);
    assert_near(robot->total_mass, 28.3574009, 1e-7);
    assert_near(robot->gravity[2], -9.81, 0.0);
    assert_string_equal(robot->body[0].name, "Waist");
    for (size_t j = 0; j < robot->njoint; j++) {
        assert_int_equal(robot->joint[j].paper_index, 7 + (int)j);
        assert_int_equal(robot->joint[j].type, JOINT_REVOLUTE);
    }
}

TEST_WITH(coman_has_its_drives_and_disabled_parallel_springs, open_arena, close_arena)
{
    const struct robot *robot = load_coman(NULL);
    size_t springs = 0;

    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_joint *joint = &robot->joint[j];

        assert_true(joint->sea.present);
        assert_near(joint->sea.J, 0.1387, 0.0);
        assert_near(joint->sea.Dm, 0.19958, 0.0);
        assert_near(joint->sea.N, 100.0, 0.0);
        assert_near(joint->sea.Kt, 4.1, 0.0);
        assert_near(joint->sea.Kw, 4.1, 0.0);
        assert_near(joint->sea.R, 0.664, 0.0);
        assert_near(joint->sea.L, 0.00032, 0.0);
        assert_near(joint->torque_limit, 50.0, 0.0);
        if (joint->spring.present) {
            bool knee = strstr(joint->name, "Knee") != NULL;

            springs++;
            assert_false(joint->spring.enabled);
            assert_near(joint->spring.s, knee ? 1.0 : -1.0, 0.0);
            assert_near(joint->spring.k_p, 2000.0, 0.0);
            assert_near(joint->spring.r, 0.05, 0.0);
        }
    }
    assert_int_equal(springs, 6);
    assert_near(robot->joint[robot_find_joint(robot, "RKneeSag")].sea.Ks, 395.46, 0.0);
    assert_near(robot->joint[robot_find_joint(robot, "RElbj")].sea.Ks, 120.0, 0.0);
    assert_near(robot->joint[robot_find_joint(robot, "WaistLat")].sea.Ds, 4.2, 0.0);
    assert_near(robot->joint[robot_find_joint(robot, "WaistLat")].axis[0], cos(20.0 * M_PI / 180.0),
                1e-11);
}

/* A frame's origin in the world. */
static void frame_place(const struct robot_frame *frame, const struct body_motion *motion,
                        double place[3])
{
    mat3_apply(motion[frame->body].R, frame->position, place);
    for (int m = 0; m < 3; m++) {
        place[m] += motion[frame->body].p[m];
    }
}

TEST_WITH(every_pose_of_coman_stands_flat_on_the_ground, open_arena, close_arena)
{
    static const char *const frames[] = {"r_sole", "l_sole", "r_toe", "l_toe"};
    const struct robot *robot = load_coman(NULL);
    struct body_motion motion[24];
    double q[30], v[29] = {0};
    struct dynamics d;

    assert_ok(dynamics_generic(robot, &arena, &d, NULL));
    assert_int_equal(robot->npose, 3);
    assert_true(robot_find_pose(robot, "zero") >= 0);
    assert_true(robot_find_pose(robot, "crouch_home") >= 0);
    assert_true(robot_find_pose(robot, "epfl_walk_init") >= 0);
    for (size_t p = 0; p < robot->npose; p++) {
        const struct robot_pose *pose = &robot->pose[p];

        memcpy(q, pose->base_position, sizeof pose->base_position);
        memcpy(q + 3, pose->base_quaternion, sizeof pose->base_quaternion);
        memcpy(q + 7, pose->joint, robot->njoint * sizeof *q);
        d.ops->kinematics(&d, q, v, motion);
        for (size_t f = 0; f < sizeof frames / sizeof *frames; f++) {
            int at = robot_find_frame(robot, frames[f]);
            double place[3];

            assert_true(at >= 0);
            frame_place(&robot->frame[at], motion, place);
            assert_near(place[2], 0.0, 1e-12);
        }
    }
}

TEST_WITH(coman_has_four_sensors_that_nothing_hangs_on, open_arena, close_arena)
{
    static const char *const names[] = {"r_leg_ft", "l_leg_ft", "r_arm_ft", "l_arm_ft"};
    const struct robot *robot = load_coman("");

    assert_int_equal(robot->nft, 4);
    for (size_t s = 0; s < robot->nft; s++) {
        assert_string_equal(robot->ft[s].name, names[s]);
        assert_string_equal(robot->frame[robot->ft[s].frame].name, names[s]);
        assert_near(robot->ft[s].distal.mass, 0.0, 0.0);
    }
    assert_string_equal(robot->frame[robot->imu_frame].name, "imu_link");
    assert_true(robot->body[0].observed);
    assert_false(robot->body[robot_find_body(robot, "RHipMot")].observed);
}

TEST_WITH(coman_has_capsules_on_its_limbs_and_trunk, open_arena, close_arena)
{
    static const char *const on[] = {"Waist",   "DWYTorso", "RThighLowLeg", "LThighLowLeg",
                                     "RLowLeg", "LLowLeg",  "RShy",         "LShy",
                                     "RElb",    "LElb",     "RFoot",        "LFoot"};
    const struct robot *robot = load_coman(""), *forearms = load_coman("forearms");

    assert_int_equal(robot->ncapsule, 19);
    assert_int_equal(forearms->ncapsule, 19);
    for (size_t i = 0; i < sizeof on / sizeof *on; i++) {
        int body = robot_find_body(robot, on[i]);
        size_t found = 0;

        for (size_t c = 0; c < robot->ncapsule; c++) {
            found += robot->capsule[c].body == body;
        }
        assert_true(found > 0);
        assert_true(robot->body[body].observed);
    }
    assert_string_equal(robot->capsule[2].name, "trunk");
    assert_near(robot->capsule[2].radius, 0.127681, 0.0);
    assert_near(robot->capsule[2].position[2], 0.120451, 0.0);
    for (size_t c = 0; c < robot->ncapsule; c++) {
        if (!strcmp(robot->capsule[c].name, "right_forearm")) {
            assert_near(robot->capsule[c].length, 0.139842, 0.0);
            assert_near(forearms->capsule[c].length, 0.18, 0.0);
        }
    }
}

TEST_WITH(the_forearms_make_it_heavier_and_move_the_wrists, open_arena, close_arena)
{
    const struct robot *plain = load_coman(NULL), *robot = load_coman("forearms");
    int wrist = robot_find_frame(robot, "r_wrist");

    assert_near(robot->total_mass, 31.4538602, 1e-7);
    assert_int_equal(robot->nbody, 24);
    assert_true(robot->hash != plain->hash);
    assert_int_equal(robot->nframe, plain->nframe + 2);
    assert_int_equal(wrist, robot_find_frame(plain, "r_wrist"));
    assert_near(robot->frame[wrist].position[2], -0.19468, 0.0);
    assert_near(plain->frame[wrist].position[2], -0.22, 0.0);
    assert_true(robot_find_frame(robot, "l_hand") >= 0);
    assert_near(robot->ft[2].distal.mass, 2.181298958 - 0.63306933, 1e-12);
}

TEST_WITH(an_unknown_variant_is_refused_with_the_nearest, open_arena, close_arena)
{
    const struct robot *robot;
    struct error error;

    assert_int_equal(robot_load(COMAN, "forearm", &arena, &robot, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "coman.yaml: found unknown variant \"forearm\", expected "
                                       "\"forearms\""));
    assert_int_equal(robot_load(COMAN, "winter", &arena, &robot, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "found unknown variant \"winter\", expected "));
    assert_int_equal(robot_load(COMAN ".missing", NULL, &arena, &robot, &error), ERROR_INPUT);
}

/* ---- malformed files ---- */

/* A sound file; each fault below replaces a part of it. */
static const char sound[] =
    "name: mini\n"
    "gravity_m_s2: [0, 0, -9.81]\n"
    "base: {type: floating, body: trunk}\n"
    "drive: {J_kg_m2: 0.1, Dm_nm_s_rad: 0.2, N: 100, NKt_nm_a: 4, NKw_v_s_rad: 4, R_ohm: 0.6}\n"
    "bodies:\n"
    "  - {name: hand, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [0.1, 0, 0, 0.1, 0, 0.1]}\n"
    "  - {name: trunk, mass_kg: 2, com_m: [0, 0, 0], inertia_kg_m2: [0.1, 0, 0, 0.1, 0, 0.1]}\n"
    "  - {name: arm, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [0.1, 0, 0, 0.1, 0, 0.1]}\n"
    "joints:\n"
    "  - name: shoulder\n"
    "    type: revolute\n"
    "    parent: trunk\n"
    "    child: arm\n"
    "    axis: [0, 1, 0]\n"
    "    origin: {xyz_m: [0, 0, 0.3], rpy_rad: [0, 0, 1.57]}\n"
    "    limits: {lower_rad: -1, upper_rad: 2, torque_nm: 50}\n"
    "    drive: {Ks_nm_rad: 300, Ds_nm_s_rad: 0.2, L_h: 0.0003}\n"
    "    parallel_spring: {enabled: true, k_p_n_m: 9, d_p_n_s_m: 1, r_m: 0.1, sense: -1}\n"
    "  - name: slide\n"
    "    type: prismatic\n"
    "    parent: arm\n"
    "    child: hand\n"
    "    axis: [0, 0, 1]\n"
    "    origin: {xyz_m: [0, 0, 0]}\n"
    "    limits: {lower_m: 0.1, upper_m: 0.5, force_n: 20}\n"
    "frames:\n"
    "  - {name: palm, body: hand, xyz_m: [0, 0, 0.1]}\n"
    "ft_sensors:\n"
    "  - {name: wrist, frame: palm}\n"
    "imu: {frame: palm}\n"
    "poses:\n"
    "  home: {base_xyz_m: [0, 0, 1], joints_rad: {shoulder: 0.5}, joints_m: {slide: 0.2}}\n"
    "variants:\n"
    "  heavy:\n"
    "    bodies:\n"
    "      - {name: arm, mass_kg: 5, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n";

/* Loads the text with the first part replaced by another. */
static enum error_code load_changed(const char *part, const char *other, const char *variant,
                                    const struct robot **robot, struct error *error)
{
    const char *at = strstr(sound, part);
    char path[] = "/tmp/robot-XXXXXX";
    int fd = mkstemp(path);
    FILE *file = fdopen(fd, "w");
    enum error_code code;

    assert_non_null(at);
    assert_non_null(file);
    fprintf(file, "%.*s%s%s", (int)(at - sound), sound, other, at + strlen(part));
    assert_int_equal(fclose(file), 0);
    code = robot_load(path, variant, &arena, robot, error);
    unlink(path);
    return code;
}

/* Angles of a base are those of a frame: Rz(yaw) Ry(pitch) Rx(roll). */
TEST_WITH(the_base_of_a_pose_is_turned_as_a_frame_is, open_arena, close_arena)
{
    const struct robot *robot, *framed;
    struct error error;
    double R[9];

    assert_ok(load_changed("base_xyz_m: [0, 0, 1]",
                           "base_xyz_m: [0, 0, 1], base_rpy_rad: [0.3, -0.5, 0.8]", NULL, &robot,
                           &error));
    assert_ok(load_changed("xyz_m: [0, 0, 0.1]", "xyz_m: [0, 0, 0.1], rpy_rad: [0.3, -0.5, 0.8]",
                           NULL, &framed, &error));
    mat3_from_quaternion(robot->pose[0].base_quaternion, R);
    for (int k = 0; k < 9; k++) {
        assert_near(R[k], framed->frame[0].rotation[k], 1e-15);
    }
    /* by hand: -sin(pitch), cos(pitch) sin(roll), cos(pitch) cos(roll) */
    assert_near(R[6], sin(0.5), 1e-15);
    assert_near(R[7], cos(0.5) * sin(0.3), 1e-15);
    assert_near(R[3], sin(0.8) * cos(0.5), 1e-15);
}

TEST_WITH(a_sound_file_becomes_a_robot, open_arena, close_arena)
{
    const struct robot *robot;
    struct error error;

    assert_no_error(load_changed("", "", "heavy", &robot, &error), error.text);
    assert_int_equal(robot->nbody, 3);
    assert_string_equal(robot->body[1].name, "arm");
    assert_string_equal(robot->body[2].name, "hand");
    assert_int_equal(robot->body[2].parent, 1);
    assert_near(robot->total_mass, 8.0, 0.0);
    assert_near(robot->joint[0].sea.J, 0.1, 0.0);
    assert_near(robot->joint[0].sea.L, 0.0003, 0.0);
    assert_near(robot->joint[0].spring.s, -1.0, 0.0);
    assert_true(robot->joint[0].spring.enabled);
    assert_false(robot->joint[1].sea.present);
    assert_near(robot->joint[0].rotation[1], -sin(1.57), 1e-15);
    assert_near(robot->joint[1].torque_limit, 20.0, 0.0);
    assert_near(robot->pose[0].joint[0], 0.5, 0.0);
    assert_near(robot->pose[0].joint[1], 0.2, 0.0);
}

/* A robot has looks, whose paths are those of the folder, and is the same without. */
TEST_WITH(visuals_are_read_and_change_no_dynamics, open_arena, close_arena)
{
    const struct robot *plain, *robot;
    struct robot *held;
    struct error error;
    double up[4] = {1, 0, 0, 0};

    assert_ok(load_changed("", "", NULL, &plain, &error));
    if (load_changed("ft_sensors:",
                     "visuals:\n"
                     "  - {name: a, body: trunk, shape: mesh, file: m/a.stl, xyz_m: [1, 2, 3],\n"
                     "     color: [0.1, 0.2, 0.3, 1]}\n"
                     "  - {name: b, body: hand, shape: capsule, radius_m: 0.1, length_m: 0}\n"
                     "  - {name: c, body: arm, shape: mesh, missing: \"why: so\"}\n"
                     "ft_sensors:",
                     NULL, &robot, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(robot->nvisual, 3);
    assert_true(robot->hash == plain->hash && robot->massless_hash == plain->massless_hash);
    assert_string_equal(robot->visual[0].file, "/tmp/m/a.stl");
    assert_near(robot->visual[0].color[2], 0.3, 0.0);
    assert_int_equal(robot->visual[1].shape, VISUAL_CAPSULE);
    assert_false(robot->visual[1].colored);
    assert_string_equal(robot->visual[2].missing, "why: so");
    assert_null(robot->visual[2].file);

    /* They stay where they were when the base is clamped half a meter up */
    assert_ok(robot_copy(robot, &arena, &held, &error));
    assert_ok(robot_fix_base(held, (double[3]){0, 0, 0.5}, up, &error));
    assert_near(held->visual[0].position[2], 3.5, 0.0);
    assert_near(robot->visual[0].position[2], 3.0, 0.0);
}

TEST_WITH(wrong_visuals_are_refused, open_arena, close_arena)
{
    static const struct {
        const char *visual, *expected;
    } cases[] = {
        {"shape: box", "found a box without \"half_extents_m\", expected it"},
        {"shape: mesh", "found a mesh without \"file\""},
        {"shape: sphere, radius_m: 1, length_m: 1", "found a sphere with \"length_m\""},
        {"shape: sphere, radius_m: 1, file: a.stl", "found a sphere with \"file\""},
        {"shape: sphere, radius_m: 0", "found 0"},
        {"shape: mesh, file: a.stl, missing: x", "found \"file\" beside \"missing\""},
        {"shape: mesh, file: /etc/passwd", "found absolute path"},
        {"shape: mesh, file: ../../x.stl", "leaves the configuration tree"},
        {"shape: mesh, file: a.stl, color: [1, 1, 1, 2]", "found 2"},
        {"shape: cone, radius_m: 1", "found \"cone\""},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct robot *robot;
        struct error error;
        char text[256];

        snprintf(text, sizeof text,
                 "visuals:\n  - {name: a, body: arm, %s}\nft_sensors:", cases[i].visual);
        assert_int_equal(load_changed("ft_sensors:", text, NULL, &robot, &error), ERROR_INPUT);
        if (!strstr(error.text, cases[i].expected) || !strstr(error.text, ":29:")) {
            fail_msg("%s, expected %s", error.text, cases[i].expected);
        }
    }
}

/* ---- couplings ---- */

#define FINGER(name)                                                                               \
    "  - {name: " name ", mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [0.1, 0, 0, 0.1, 0, "       \
    "0.1]}\n"
#define FINGER_JOINT(name, child)                                                                  \
    "  - {name: " name ", type: revolute, parent: hand, child: " child                             \
    ", axis: [1, 0, 0],\n     origin: {xyz_m: [0, 0, 0]}, limits: {lower_rad: -1, upper_rad: 1, "  \
    "torque_nm: 5}}\n"
#define STIFF "stiffness_nm_rad: 100, damping_nm_s_rad: 1}\n"

/* Loads the sound file with two fingers without drives, these couplings and this pose. */
static enum error_code load_coupled(const char *couplings, const char *pose,
                                    const struct robot **robot, struct error *error)
{
    const char *joints = strstr(sound, "joints:\n"), *frames = strstr(sound, "frames:\n");
    const char *poses = strstr(sound, "  home:"), *variants = strstr(sound, "variants:");
    char path[] = "/tmp/robot-XXXXXX";
    FILE *file = fdopen(mkstemp(path), "w");
    enum error_code code;

    assert_non_null(file);
    fprintf(file, "%.*s" FINGER("thumb") FINGER("index") "%.*s", (int)(joints - sound), sound,
            (int)(frames - joints), joints);
    fprintf(file, FINGER_JOINT("bend", "index") FINGER_JOINT("pinch", "thumb") "couplings:\n%s",
            couplings);
    fprintf(file, "%.*s  home: {base_xyz_m: [0, 0, 1], %s}\n%s", (int)(poses - frames), frames,
            pose, variants);
    assert_int_equal(fclose(file), 0);
    code = robot_load(path, NULL, &arena, robot, error);
    unlink(path);
    return code;
}

/* Followers stand where their leaders lead them, named by the pose or not. */
TEST_WITH(couplings_are_read_and_poses_follow_them, open_arena, close_arena)
{
    static const char couplings[] =
        "  - {follower: slide, leader: shoulder, multiplier: 0.2, offset_m: 0.1,\n"
        "     stiffness_n_m: 5000, damping_n_s_m: 3}\n"
        "  - {follower: pinch, leader: bend, multiplier: -1, " STIFF;
    const struct robot *robot;
    struct error error;

    if (load_coupled(couplings, "joints_rad: {shoulder: 0.5, bend: 0.3}", &robot, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(robot->ncoupling, 2);
    assert_int_equal(robot->coupling[0].follower, robot_find_joint(robot, "slide"));
    assert_int_equal(robot->coupling[0].leader, robot_find_joint(robot, "shoulder"));
    assert_near(robot->coupling[0].multiplier, 0.2, 0.0);
    assert_near(robot->coupling[0].offset, 0.1, 0.0);
    assert_near(robot->coupling[0].stiffness, 5000.0, 0.0);
    assert_near(robot->coupling[0].damping, 3.0, 0.0);
    assert_near(robot->coupling[1].offset, 0.0, 0.0);
    assert_ptr_equal(robot_find_coupling(robot, 3), &robot->coupling[1]);
    assert_null(robot_find_coupling(robot, 2));
    assert_near(robot->pose[0].joint[1], 0.2, 1e-15);
    assert_near(robot->pose[0].joint[3], -0.3, 0.0);

    /* What a pose says of a follower may be rounded, and is made exact */
    assert_ok(load_coupled(couplings,
                           "joints_rad: {shoulder: 0.6, bend: 0.1, pinch: -0.1000004}, "
                           "joints_m: {slide: 0.22}",
                           &robot, &error));
    assert_near(robot->pose[0].joint[3], -0.1, 0.0);
}

TEST_WITH(wrong_couplings_are_refused, open_arena, close_arena)
{
    static const struct {
        const char *couplings, *pose, *place, *expected;
    } cases[] = {
        {"  - {follower: pinhc, leader: bend, multiplier: 1, " STIFF, "",
         ":33:16: ", "found unknown joint \"pinhc\", expected \"pinch\""},
        {"  - {follower: pinch, leader: bent, multiplier: 1, " STIFF, "",
         ":33:31: ", "found unknown joint \"bent\", expected \"bend\""},
        {"  - {follower: pinch, leader: pinch, multiplier: 1, " STIFF, "",
         ":33:31: ", "as its own leader"},
        {"  - {follower: shoulder, leader: bend, multiplier: 1, " STIFF, "",
         ":33:16: ", "found follower \"shoulder\" with a drive of its own"},
        {"  - {follower: pinch, leader: bend, multiplier: 1, " STIFF
         "  - {follower: pinch, leader: shoulder, multiplier: 1, " STIFF,
         "", ":34:16: ",
         "\"pinch\" as a follower again, expected one leader (it follows \"bend\" in "
         "line 33)"},
        {"  - {follower: pinch, leader: shoulder, multiplier: 1, " STIFF
         "  - {follower: bend, leader: pinch, multiplier: 1, " STIFF,
         "", ":34:30: ", "which follows \"shoulder\" itself (line 33)"},
        {"  - {follower: bend, leader: pinch, multiplier: 1, " STIFF
         "  - {follower: pinch, leader: shoulder, multiplier: 1, " STIFF,
         "", ":34:16: ", "which \"bend\" follows (line 33)"},
        {"  - {follower: bend, leader: pinch, multiplier: 1, " STIFF
         "  - {follower: pinch, leader: bend, multiplier: 1, " STIFF,
         "", ":34:31: ", "found leader \"bend\""},
        {"  - {follower: pinch, leader: bend, multiplier: 0, " STIFF, "",
         ":33:49: ", "found multiplier 0"},
        {"  - {follower: pinch, leader: bend, multiplier: 1e9, " STIFF, "",
         ":33:49: ", "found 1e9"},
        {"  - {follower: pinch, leader: bend, multiplier: .nan, " STIFF, "", ":33:49: ", "found"},
        {"  - {follower: pinch, leader: bend, multiplier: 1, stiffness_nm_rad: 0,\n"
         "     damping_nm_s_rad: 1}\n",
         "", ":33:", "found 0"},
        {"  - {follower: pinch, leader: bend, multiplier: 1, stiffness_nm_rad: 9}\n", "",
         ":33:5: ", "of revolute joint \"pinch\", expected the keys stiffness_nm_rad, "},
        {"  - {follower: pinch, leader: bend, multiplier: 1, offset_m: 1, " STIFF, "",
         ":33:5: ", "offset_rad"},
        {"  - {follower: slide, leader: bend, multiplier: 1, " STIFF, "",
         ":33:5: ", "of prismatic joint \"slide\", expected the keys stiffness_n_m, "},
        {"  - {follower: pinch, leader: bend, " STIFF, "", ":33:5: ", "\"multiplier\""},
        {"  - {follower: pinch, leader: bend, multiplier: 1, " STIFF, ", bend: 0.5, pinch: 0.4",
         ":40:", "found joint \"pinch\" at 0.4, expected 0.5, where \"bend\" leads it"},
        {"  - {follower: pinch, leader: bend, multiplier: 3, " STIFF, ", bend: 0.5",
         ":40:9: ", "with joint \"pinch\" at 1.5, where \"bend\" leads it, expected -1 to 1"},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct robot *robot;
        struct error error;
        char pose[128];

        snprintf(pose, sizeof pose, "joints_rad: {shoulder: 0.5%s}, joints_m: {slide: 0.2}",
                 cases[i].pose);
        assert_int_equal(load_coupled(cases[i].couplings, pose, &robot, &error), ERROR_INPUT);
        if (!strstr(error.text, cases[i].expected) || !strstr(error.text, cases[i].place)) {
            fail_msg("%s, expected %s%s", error.text, cases[i].place, cases[i].expected);
        }
    }
}

/* ---- stops, springs and effects ---- */

static void assert_stop(const struct robot_stop *stop, double stiffness, double damping)
{
    assert_near(stop->stiffness, stiffness, 1e-12 * stiffness);
    assert_near(stop->damping, damping, 1e-12 * damping);
}

/* What a file leaves out follows from the torque and force limits, and a joint goes before the
 * robot. */
TEST_WITH(limits_have_stops, open_arena, close_arena)
{
    static const struct {
        const char *part, *other;
        double shoulder[2], slide[2];
    } cases[] = {
        {"", "", {1e5, 100.0}, {4e4, 40.0}},
        {"torque_nm: 50", "torque_nm: 0", {2e3, 2.0}, {4e4, 40.0}},
        {"bodies:\n  -", "stops: {enabled: false}\nbodies:\n  -", {0.0, 0.0}, {0.0, 0.0}},
        {"bodies:\n  -",
         "stops: {stiffness_nm_rad: 7, damping_n_s_m: 3}\nbodies:\n  -",
         {7.0, 0.007},
         {4e4, 3.0}},
        {"force_n: 20}", "force_n: 20}\n    stops: {enabled: false}", {1e5, 100.0}, {0.0, 0.0}},
        {"force_n: 20}",
         "force_n: 20}\n    stops: {stiffness_n_m: 8, damping_n_s_m: 0}",
         {1e5, 100.0},
         {8.0, 0.0}},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct robot *robot;
        struct error error;

        assert_no_error(load_changed(cases[i].part, cases[i].other, NULL, &robot, &error),
                        error.text);
        assert_stop(&robot->joint[0].stop, cases[i].shoulder[0], cases[i].shoulder[1]);
        assert_stop(&robot->joint[1].stop, cases[i].slide[0], cases[i].slide[1]);
    }
}

/* A spring has a stop where the file gives its room. */
TEST_WITH(springs_with_room_have_stops, open_arena, close_arena)
{
    static const struct {
        const char *other;
        double room, stiffness, damping;
    } cases[] = {
        {"L_h: 0.0003", 0.0, 0.0, 0.0},
        {"L_h: 0.0003, deflection_rad: 0.2", 0.2, 6000.0, 6.0},
        {"L_h: 0.0003, deflection_rad: 0.2, stop_Ks_nm_rad: 5e3", 0.2, 5000.0, 5.0},
        {"L_h: 0.0003, deflection_rad: 0.2, stop_Ds_nm_s_rad: 1.5", 0.2, 6000.0, 1.5},
    };

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct robot *robot;
        struct error error;

        assert_no_error(load_changed("L_h: 0.0003", cases[i].other, NULL, &robot, &error),
                        error.text);
        assert_near(robot->joint[0].sea.deflection, cases[i].room, 0.0);
        assert_stop(&robot->joint[0].sea.stop, cases[i].stiffness, cases[i].damping);
    }
}

TEST_WITH(coman_has_stops, open_arena, close_arena)
{
    const struct robot *robot = load_coman(NULL);

    for (size_t j = 0; j < robot->njoint; j++) {
        const struct robot_sea *sea = &robot->joint[j].sea;

        assert_stop(&robot->joint[j].stop, 1e5, 100.0);
        if (sea->Ks < 8400.0) {
            assert_stop(&sea->stop, 8000.0, 4.0);
            assert_true(sea->deflection * sea->Ks > robot->joint[j].torque_limit);
        } else {
            assert_stop(&sea->stop, 0.0, 0.0);
        }
    }
}

/* Off unless given; a joint's numbers go before the robot's. */
TEST_WITH(drives_have_the_effects_that_are_given, open_arena, close_arena)
{
    const struct robot_effects *effects;
    const struct robot *robot;
    struct error error;

    assert_ok(load_changed("L_h: 0.0003", "L_h: 0.0003", NULL, &robot, &error));
    assert_null(robot->joint[0].sea.effects);
    if (load_changed("L_h: 0.0003",
                     "L_h: 0.0003, coulomb_nm: 2, backlash_rad: 0.01, freewheel: true, "
                     "cogging: [{per_turn: 12, nm: 0.5, phase_rad: 1}, {per_turn: 24, nm: 0.1}], "
                     "winding_k_w: 1, housing_k_w: 2, winding_j_k: 3, housing_j_k: 4",
                     NULL, &robot, &error)) {
        fail_msg("%s", error.text);
    }
    effects = robot->joint[0].sea.effects;
    assert_non_null(effects);
    assert_near(effects->coulomb, 2.0, 0.0);
    assert_near(effects->breakaway, 2.0, 0.0);
    assert_near(effects->backlash, 0.01, 0.0);
    assert_true(effects->freewheel);
    assert_int_equal(effects->ncogging, 2);
    assert_near(effects->cogging[0].phase, 1.0, 0.0);
    assert_near(effects->cogging[1].amplitude, 0.1, 0.0);
    assert_near(effects->thermal.housing_j_k, 4.0, 0.0);
    assert_near(effects->thermal.ambient_c, 25.0, 0.0);
    assert_near(effects->thermal.R_per_k, 0.00385, 0.0);
    assert_int_equal(effects->nerror, 0);

    /* 2^-12 s of 2^-10 s: just a quarter of the period */
    assert_ok(load_changed("L_h: 0.0003", "L_h: 0.0003, dead_time_s: 0.000244140625, pwm_hz: 1024",
                           NULL, &robot, &error));
}

/* A variant's drive goes before the robot's own: all of COMAN's drives, and none without it. */
TEST_WITH(a_variant_gives_all_drives_its_effects, open_arena, close_arena)
{
    const struct robot *robot = load_coman("real_drives");

    for (size_t j = 0; j < robot->njoint; j++) {
        assert_non_null(robot->joint[j].sea.effects);
        assert_near(robot->joint[j].sea.J, 0.1387, 0.0);
        assert_near(robot->joint[j].sea.effects->coulomb, 4.0, 0.0);
        assert_int_equal(robot->joint[j].sea.effects->nerror, 1);
    }
    robot = load_coman(NULL);
    for (size_t j = 0; j < robot->njoint; j++) {
        assert_null(robot->joint[j].sea.effects);
    }
}

/* A joint's own spring, else for what turns and is driven the robot's, else none. */
TEST_WITH(passive_springs_are_the_joints_or_the_robots, open_arena, close_arena)
{
    const struct robot *robot;
    struct error error;

    assert_ok(load_changed("force_n: 20}",
                           "force_n: 20}\n    passive: {stiffness_n_m: 30, rest_m: 0.2}", NULL,
                           &robot, &error));
    assert_near(robot->joint[0].passive.stiffness, 0.0, 0.0);
    assert_near(robot->joint[1].passive.stiffness, 30.0, 0.0);
    assert_near(robot->joint[1].passive.rest, 0.2, 0.0);
    assert_ok(load_changed("joints:\n",
                           "passive: {stiffness_nm_rad: 2, damping_nm_s_rad: 0.5}\njoints:\n", NULL,
                           &robot, &error));
    assert_near(robot->joint[0].passive.stiffness, 2.0, 0.0);
    assert_near(robot->joint[0].passive.damping, 0.5, 0.0);
    assert_near(robot->joint[1].passive.stiffness, 0.0, 0.0);
}

/* A variant may put bodies and joints between those of the robot: COMAN's hips, which weigh as much
 * as before and stand in the same place. */
TEST_WITH(a_variant_adds_joints_where_they_belong, open_arena, close_arena)
{
    const struct robot *robot = load_coman(NULL), *bends = load_coman("flexible_hips");
    double first[3] = {0}, second[3] = {0}, inertia[2] = {0.0, 0.0};

    assert_int_equal(bends->njoint, robot->njoint + 2);
    assert_near(bends->total_mass, robot->total_mass, 1e-9);
    for (size_t j = 0; j < robot->njoint; j++) {
        assert_true(robot_find_joint(bends, robot->joint[j].name) >= 0);
    }
    assert_int_equal(robot_find_joint(bends, "RHipSag"), robot_find_joint(bends, "RHipBend") + 1);
    assert_int_equal(robot_find_joint(bends, "LHipSag"), robot_find_joint(bends, "LHipBend") + 1);
    assert_near(bends->joint[robot_find_joint(bends, "LHipBend")].passive.stiffness, 1e4, 0.0);

    /* Waist and mounts are together what the waist was: first moment, and inertia about y */
    for (int side = 0; side < 2; side++) {
        const struct robot_inertia *mount =
            &bends->body[robot_find_joint(bends, side ? "LHipBend" : "RHipBend") + 1].inertia;

        second[1] += mount->mass * (side ? 0.023 : -0.023);
        inertia[1] += mount->I[3];
    }
    for (int i = 0; i < 3; i++) {
        first[i] = robot->body[0].inertia.mass * robot->body[0].inertia.com[i];
        second[i] += bends->body[0].inertia.mass * bends->body[0].inertia.com[i];
        assert_near(first[i], second[i], 1e-10);
    }
    for (int k = 0; k < 2; k++) {
        const struct robot_inertia *waist = k ? &bends->body[0].inertia : &robot->body[0].inertia;

        inertia[k] += waist->I[3] +
                      waist->mass * (waist->com[0] * waist->com[0] + waist->com[2] * waist->com[2]);
    }
    assert_near(inertia[0], inertia[1], 1e-11);
}

TEST_WITH(a_fixed_base_needs_no_place, open_arena, close_arena)
{
    const struct robot *robot;
    struct error error;

    assert_int_equal(load_changed("floating", "fixed", NULL, &robot, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, ":32:9: found pose \"home\" with a base, expected none"));
}

static const struct fault {
    const char *part, *other; /* what is replaced by what */
    const char *where;        /* line:column: */
    const char *what;
} faults[] = {
    {"body: trunk", "body: trunc", "3:", "found unknown body \"trunc\", expected \"trunk\""},
    {"mass_kg: 2", "mass_kg: 0", "7:", "found 0, expected"},
    {"mass_kg: 2", "mass_lb: 2",
     "7:", "found unknown key \"mass_lb\" in a body, expected \"mass_kg\""},
    {"name: arm", "name: hand", "8:5",
     "found body \"hand\" again, expected it once (it stands in line 6)"},
    {"name: arm", "name: \"an arm\"", "8:5", "found body name \"an arm\", expected letters"},
    {"[0.1, 0, 0, 0.1, 0, 0.1]", "[0.1, 0, 0, 0.3, 0, 0.1]",
     "6:", "the largest exceeds the sum of the others"},
    {"[0.1, 0, 0, 0.1, 0, 0.1]", "[0.1, 0.2, 0, 0.1, 0, 0.1]", "6:", "inertia is not positive"},
    {"[0.1, 0, 0, 0.1, 0, 0.1]", "[0.1, 0, 0, 0.1, 0]", "6:", "found a list of 5"},
    {"parent: trunk", "parent: truck", "12:13", "found unknown body \"truck\", expected \"trunk\""},
    {"parent: trunk", "parent: hand", "12:13",
     "found a cycle: body \"arm\" hangs on \"hand\", which hangs on it, expected a tree"},
    {"parent: trunk", "parent: arm", "12:13", "found a cycle"},
    {"child: arm", "child: ram", "13:12", "found unknown body \"ram\", expected \"arm\""},
    {"child: arm", "child: trunk", "13:12", "found the base \"trunk\" as a joint's child"},
    {"child: hand", "child: arm", "22:12",
     "found body \"arm\" moved by a second joint, expected one (\"shoulder\" in line 10 moves it)"},
    {"  - name: slide\n    type: prismatic\n    parent: arm\n    child: hand\n    axis: [0, 0, 1]\n"
     "    origin: {xyz_m: [0, 0, 0]}\n    limits: {lower_m: 0.1, upper_m: 0.5, force_n: 20}\n",
     "", "6:5", "found body \"hand\" that no joint moves"},
    {"  - name: shoulder\n",
     "  - name: early\n    type: revolute\n    parent: arm\n    child: hand\n    axis: [1, 0, 0]\n"
     "    origin: {xyz_m: [0, 0, 0]}\n    limits: {lower_rad: -1, upper_rad: 2, torque_nm: 50}\n"
     "  - name: shoulder\n",
     "12:13",
     "found parent \"arm\" before joint \"shoulder\" that moves it (line 17), expected parents "
     "first"},
    {"name: slide", "name: shoulder", "19:5", "found joint \"shoulder\" again"},
    {"type: revolute", "type: revolut", "11:11", "expected revolute or prismatic"},
    {"axis: [0, 1, 0]", "axis: [0, 0.9, 0]", "14:11",
     "found an axis of length 0.9, expected a unit vector"},
    {"axis: [0, 1, 0]", "axis: [0, 0, 0]", "14:11", "found an axis of length 0"},
    {"upper_rad: 2", "upper_rad: -2", "16:13",
     "found lower limit -1 not below upper limit -2 of joint \"shoulder\""},
    {"lower_rad: -1, ", "", "16:13",
     "found limits of revolute joint \"shoulder\", expected the keys lower_rad, upper_rad, "
     "torque_nm"},
    {"lower_m: 0.1", "lower_rad: 0.1", "25:13",
     "found limits of prismatic joint \"slide\", expected the keys lower_m, upper_m, force_n"},
    {"force_n: 20}", "force_n: 20}\n    stops: {stiffness_nm_rad: 1}", "26:12",
     "found stops of prismatic joint \"slide\", expected the keys stiffness_n_m, damping_n_s_m"},
    {"    drive: {Ks", "    stops: {damping_n_s_m: 1}\n    drive: {Ks", "17:12",
     "found stops of revolute joint \"shoulder\", expected the keys stiffness_nm_rad"},
    {"    drive: {Ks", "    stops: {stiffness_nm_rad: -1}\n    drive: {Ks",
     "17:", "found -1, expected"},
    {"    drive: {Ks", "    stops: {stiffnes_nm_rad: 1}\n    drive: {Ks", "17:",
     "found unknown key \"stiffnes_nm_rad\" in the stops of joints, expected "
     "\"stiffness_nm_rad\""},
    {"L_h: 0.0003", "L_h: 0.0003, stop_Ks_nm_rad: 1", "17:12",
     "found a stop of the spring of joint \"shoulder\" without key \"deflection_rad\""},
    {"L_h: 0.0003", "L_h: 0.0003, deflection_rad: 0", "17:", "found 0, expected"},
    {"L_h: 0.0003", "L_h: 0.0003, coulomb_nm: -1", "17:", "found -1, expected"},
    {"L_h: 0.0003", "L_h: 0.0003, coulomb_nm: 2, breakaway_nm: 3", "17:12",
     "found a drive with key \"breakaway_nm\" and without \"stribeck_rad_s\", expected both"},
    {"L_h: 0.0003", "L_h: 0.0003, coulomb_nm: 2, breakaway_nm: 1, stribeck_rad_s: 1", "17:12",
     "found gear friction of 2 N m and a breakaway torque of 1 N m"},
    {"L_h: 0.0003", "L_h: 0.0003, presliding_nm_rad: 2", "17:12",
     "found a presliding stiffness of 2 N m/rad without friction of the gear"},
    {"L_h: 0.0003", "L_h: 0.0003, hysteresis_nm: 2", "17:12",
     "found a drive with key \"hysteresis_nm\" and without \"hysteresis_nm_rad\""},
    {"L_h: 0.0003", "L_h: 0.0003, gear_error: [{per_turn: 2, rad: 0.5}]", "17:12",
     "found sines of the motor's angle that cannot be"},
    {"L_h: 0.0003", "L_h: 0.0003, cogging: [{per_turn: 2, rad: 0.5}]",
     "17:", "found unknown key \"rad\" in a sine of the cogging torque"},
    {"L_h: 0.0003",
     "L_h: 0.0003, cogging: [{per_turn: 1, nm: 0}, {per_turn: 2, nm: 0}, {per_turn: 3, nm: 0}, "
     "{per_turn: 4, nm: 0}, {per_turn: 5, nm: 0}]",
     "17:", "found 5 sines, expected no more than 4"},
    {"L_h: 0.0003", "L_h: 0.0003, winding_k_w: 1", "17:12",
     "found a drive with key \"winding_k_w\" and without \"housing_k_w\""},
    {"L_h: 0.0003", "L_h: 0.0003, dead_time_s: 1e-4, pwm_hz: 5e3", "17:12",
     "found a dead time of 0.0001 s and 0 s of switching at 5000 Hz, expected each no more "
     "than a quarter of the period"},
    {", L_h: 0.0003", "", "17:12",
     "found the drive of joint \"shoulder\" without key \"L_h\", expected it here or in"},
    {"force_n: 20}", "force_n: 20}\n    drive: {Ks_nm_rad: 1}", "26:12",
     "found a drive on prismatic joint \"slide\""},
    {"force_n: 20}",
     "force_n: 20}\n    parallel_spring: {enabled: true, k_p_n_m: 9, d_p_n_s_m: 1, r_m: 0.1, "
     "sense: 1}",
     "26:22", "found a parallel spring on prismatic joint \"slide\""},
    {"force_n: 20}", "force_n: 20}\n    passive: {stiffness_nm_rad: 1}", "26:14",
     "found a passive spring of prismatic joint \"slide\", expected the keys stiffness_n_m"},
    {"force_n: 20}", "force_n: 20}\n    passive: {damping_n_s_m: -1}", "26:", "found -1, expected"},
    {"sense: -1", "sense: 0", "18:", "found sense 0, expected 1 or -1"},
    {"body: hand", "body: band", "27:24", "found unknown body \"band\", expected \"hand\""},
    {"frame: palm}", "frame: calm}", "29:26", "found unknown frame \"calm\", expected \"palm\""},
    {"imu: {frame: palm}", "imu: {frame: roof}", "30:14", "found unknown frame \"roof\""},
    {"frame: palm}",
     "frame: palm, distal: {mass_kg: 0, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}}",
     "29:40", "inertia without mass"},
    {"{shoulder: 0.5}", "{sholder: 0.5}", "32:46",
     "found unknown joint \"sholder\", expected \"shoulder\""},
    {"{shoulder: 0.5}", "{shoulder: 2.5}", "32:46",
     "found joint \"shoulder\" at 2.5, expected -1 to 2 (its limits)"},
    {"{shoulder: 0.5}", "{slide: 0.2}", "32:46",
     "found prismatic joint \"slide\", expected it in joints_m"},
    {", joints_m: {slide: 0.2}", "", "32:9", "found pose \"home\" without joint \"slide\""},
    {"base_xyz_m: [0, 0, 1], ", "", "32:9", "found pose \"home\" without key \"base_xyz_m\""},
    {"      - {name: arm, mass_kg: 5", "      - {name: leg, mass_kg: 5", "36:9",
     "found body \"leg\" that no joint moves"},
};

TEST_WITH(refuses_a_faulty_file_with_place_and_reason, open_arena, close_arena)
{
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        const struct fault *fault = &faults[i];
        const struct robot *robot = NULL;
        struct error error = {0};
        char where[64];
        const char *colon;

        if (load_changed(fault->part, fault->other, "heavy", &robot, &error) != ERROR_INPUT) {
            fail_msg("\"%s\" was accepted", fault->other);
        }
        colon = strchr(error.text, ':');
        snprintf(where, sizeof where, ":%s", fault->where);
        if (!colon || strncmp(colon, where, strlen(where)) != 0 ||
            !strstr(error.text, fault->what)) {
            fail_msg("\"%s\": found \"%s\", expected \"%s ... %s\"", fault->other, error.text,
                     fault->where, fault->what);
        }
        assert_null(strchr(error.text, '\n'));
    }
}

/* Cut anywhere, the file is refused or, at the end of a line, sometimes still a robot. */
TEST_WITH(a_truncated_file_never_crashes, open_arena, close_arena)
{
    for (size_t length = 0; length < sizeof sound - 1; length += 7) {
        const struct robot *robot = NULL;
        struct error error;

        if (load_changed(sound + length, "", NULL, &robot, &error)) {
            assert_non_null(strstr(error.text, "/tmp/robot-"));
        } else {
            assert_non_null(robot);
        }
    }
}
