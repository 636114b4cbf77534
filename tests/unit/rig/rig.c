/* SPDX-License-Identifier: Apache-2.0 */
/* Rig files: what becomes of a good one, and where a bad one is wrong. */
#include "rt/recording/recorder.h"

#include "tests/unit/rig/rig_bench.h"

static const struct rig *load_toy(void)
{
    write_rig_file(toy_rig);
    return load_rig(rig_path);
}

/* The toy rig with the first `from` replaced by `to`. */
static void write_toy_with(const char *from, const char *to)
{
    char text[sizeof toy_rig + 512];

    strcpy(text, toy_rig);
    assert_true(replace(text, sizeof text, from, to));
    write_rig_file(text);
}

/* That rig is refused: message is what follows the name of the file. */
static void refused_with(const char *from, const char *to, const char *message)
{
    write_toy_with(from, to);
    assert_rig_refused(to, message);
}

TEST_WITH(motor_boards_may_be_strict_and_keep_firmware, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_toy();

    assert_false(rig->boards.board[0].strict || rig->boards.board[0].require_calibration);
    write_toy_with("  current_limit_a: 12\n", "  current_limit_a: 12\n  strict: true\n");
    rig = load_rig(rig_path);
    assert_true(rig->boards.board[0].strict && !rig->boards.board[0].require_calibration);
    write_toy_with("  current_limit_a: 12\n", "  current_limit_a: 12\n  strict: true\n"
                                              "  require_calibration: true\n");
    rig = load_rig(rig_path);
    assert_true(rig->boards.board[0].require_calibration && !rig->boards.board[0].keep_firmware);
    write_toy_with("  current_limit_a: 12\n", "  current_limit_a: 12\n  keep_firmware: true\n");
    assert_true(load_rig(rig_path)->boards.board[0].keep_firmware);
    refused_with("  current_limit_a: 12\n", "  current_limit_a: 12\n  require_calibration: true\n",
                 "27:24: found require_calibration without strict, expected both or none");
    refused_with(
        "  current_limit_a: 12\n",
        "  current_limit_a: 12\n  switches: {knee: {index_pulse: true}}\n",
        "27:20: found a joint's switches with protocol icub, expected it with cia402 only");
}

/* ---- good rigs ---- */

TEST_WITH(reads_time_pose_and_settings, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_toy();

    assert_string_equal(rig->name, "toy");
    assert_string_equal(rig->file, rig_path);
    assert_int_equal(rig->clock, LOOP_CLOCK_FREE);
    assert_int_equal(rig->tick_ns, 2000000);
    assert_int_equal(rig->substep_ns, 500000);
    assert_int_equal(rig->substeps, 4);
    assert_true(rig->supply_v == 48.0);
    assert_string_equal(rig->pose, "bent");
    assert_true(rig->joint[0] == -0.5 && rig->joint[1] == 1.0 && rig->joint[2] == 0.0);
    assert_int_equal(rig->lockstep.bus, 1);
    assert_int_equal(rig->lockstep.step_id, 0x5f0);
    assert_int_equal(rig->lockstep.done_id, 0x6ff);
    assert_true(rig->lockstep.partner_timeout_ns == INT64_C(2500000000));
    assert_int_equal(rig->realtime.priority, 0);
    assert_int_equal(rig->realtime.cpu, 1);
    assert_false(rig->realtime.lock_memory);
    assert_int_equal(rig->realtime.overrun, LOOP_OVERRUN_STOP);
    assert_string_equal(rig->record.directory, "out");
    assert_int_equal(rig->record.format, RECORDER_CSV | RECORDER_MCAP);
    assert_string_equal(rig->page.listen, "8080");
    assert_int_equal(rig->servo.command_period_ns, 4000000);
    assert_true(rig->servo.gains[1].kp_v_per_rad == 10 && rig->servo.gains[1].kw_v_s_per_rad == 4);
    assert_int_equal(rig->squat.cycles, 5);
}

TEST_WITH(places_surfaces_on_bodies_frames_and_the_world, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_toy();
    const struct contact_surface *ball;

    assert_int_equal(rig->contact.nsurface, 4);
    assert_int_equal(rig->contact.nbody, 2);
    assert_int_equal(rig->contact_body[0], robot_find_body(rig->robot, "lower"));
    assert_int_equal(rig->contact_body[1], robot_find_body(rig->robot, "tail"));
    assert_int_equal(rig->contact.surface[0].body, -1);
    assert_int_equal(rig->contact.surface[3].body, 0);
    assert_int_equal(rig->contact.surface[3].mesh->nface, 4);
    assert_int_equal(rig->contact.surface[2].cells_per_edge, 7);
    assert_true(rig->contact.transition_velocity_m_s == 0.02);
    assert_int_equal(rig->contact.npair, 2);
    assert_int_equal(rig->contact.pair[1].a, 2);
    assert_int_equal(rig->contact.pair[1].b, 1);
    /* 0.1 m along x of a frame that is turned by 90 degrees about z is 0.1 m along y of its body */
    ball = &rig->contact.surface[1];
    assert_true(fabs(ball->position[0] - 0.5) < 1e-15);
    assert_true(fabs(ball->position[1] - 0.1) < 1e-15);
    assert_true(fabs(ball->position[2] + 0.2) < 1e-15);
    assert_true(fabs(ball->rotation[3] - 1.0) < 1e-15);
    assert_true(fabs(ball->rotation[1] + 1.0) < 1e-15);
    assert_true(ball->material.viscous_friction == 0.5);
}

TEST_WITH(meshes_interact_by_the_law_that_the_rig_names, open_rig_tree, close_rig_tree)
{
    assert_int_equal(load_toy()->contact.mesh_law, CONTACT_PRESSURE_FIELD);
    write_toy_with("  materials:", "  mesh_law: elastic_foundation\n  materials:");
    assert_int_equal(load_rig(rig_path)->contact.mesh_law, CONTACT_ELASTIC_FOUNDATION);
    refused_with("  materials:", "  mesh_law: springs\n  materials:",
                 "11:13: found \"springs\", expected pressure_field or elastic_foundation");
}

TEST_WITH(hands_every_board_what_it_needs, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_toy();
    const struct board_config *board = rig->boards.board;

    assert_int_equal(rig->boards.nboard, 4);
    assert_int_equal(rig->boards.nbus, 2);
    assert_int_equal(rig->boards.njoint, 3);
    assert_int_equal(rig->boards.nft, 2);
    assert_string_equal(board[0].name, "left/0x01");
    assert_string_equal(board[2].name, "shin");
    assert_int_equal(board[0].axis[0].joint, -1);
    assert_int_equal(board[0].axis[1].joint, 0);
    assert_true(board[0].axis[1].current_limit_a == 5.0);
    assert_true(board[2].axis[0].current_limit_a == 12.0);
    assert_true(board[2].axis[0].temperature_limit_c == 70.0); /* COMAN's, where none is given */
    assert_true(fabs(board[0].axis[1].joint_ticks_per_rad * 2 * M_PI - 4096) < 1e-9);
    assert_true(board[0].axis[1].upper_rad == 2.0);
    assert_int_equal(board[0].command_timeout_ns, 100000000);
    /* Without boot_s a run begins with boards that are up, and a restart takes 50 ms */
    assert_int_equal(board[0].boot_ns, 0);
    assert_int_equal(board[0].restart_ns, 50000000);
    assert_int_equal(board[1].torque_joint[2], 0);
    assert_int_equal(board[1].torque_joint[3], -1);
    assert_true(board[1].full_scale[0] == 55.0);
    assert_int_equal(board[1].period_ns, 4000000);
    assert_int_equal(board[2].axis[1].joint, -1);
    assert_int_equal(board[3].ft, 0);
    assert_true(board[3].full_scale[2] == 2000.0 && board[3].full_scale[5] == 30.0);
    assert_int_equal(board[3].period_ns, 1000000);
    assert_true(board[3].transmit_at_start);
    assert_int_equal(board[3].bus, 1);
}

TEST_WITH(the_rig_can_put_joints_and_base_elsewhere_than_the_pose, open_rig_tree, close_rig_tree)
{
    char robot[sizeof toy_robot + 128];
    const struct rig *rig;

    strcpy(robot, toy_robot);
    assert_true(replace(robot, sizeof robot, "type: fixed", "type: floating"));
    assert_true(replace(robot, sizeof robot, "straight: {}", "straight: {base_xyz_m: [0, 0, 0]}"));
    assert_true(replace(robot, sizeof robot, "bent: {", "bent: {base_xyz_m: [0, 0, 0], "));
    assert_int_equal(write_file("config/robots/toy.yaml", robot, strlen(robot)), 0);
    write_toy_with("{pose: bent}", "{pose: bent, joints_rad: {knee: 0.25}, base_xyz_m: [1, 2, 3],\n"
                                   "  base_rpy_rad: [1.5707963267948966, 0, 0]}");
    rig = load_rig(rig_path);
    assert_true(rig->joint[0] == -0.5 && rig->joint[1] == 0.25);
    assert_true(rig->initial_rad[1] == 0.25);
    assert_true(rig->base_position[0] == 1 && rig->base_position[2] == 3);
    assert_true(fabs(rig->base_quaternion[0] - sqrt(0.5)) < 1e-15);
    assert_true(fabs(rig->base_quaternion[1] - sqrt(0.5)) < 1e-15);
    assert_true(fabs(rig->base_quaternion[2]) < 1e-15 && fabs(rig->base_quaternion[3]) < 1e-15);
}

TEST_WITH(rejects_joints_of_the_start_beyond_their_limits, open_rig_tree, close_rig_tree)
{
    refused_with(
        "{pose: bent}", "{pose: bent, joints_rad: {knee: 3.5}}",
        "7:36: found joint \"knee\" at 3.5 rad, expected a revolute joint within its limits, "
        "0 to 3");
    refused_with("{pose: bent}", "{pose: bent, joints_rad: {kne: 1}}",
                 "7:36: found unknown joint \"kne\", expected \"knee\"");
}

TEST_WITH(tells_a_controller_where_everything_is, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_toy();

    assert_int_equal(rig->naxis, 2);
    assert_string_equal(rig->axis[0].joint, "hip");
    assert_int_equal(rig->axis[0].bus, 0);
    assert_int_equal(rig->axis[0].address, 1);
    assert_int_equal(rig->axis[0].axis, 1);
    assert_int_equal(rig->axis[0].torque_address, 0x0c);
    assert_int_equal(rig->axis[0].torque_channel, 2);
    assert_string_equal(rig->axis[1].joint, "knee");
    assert_int_equal(rig->axis[1].torque_address, -1);
    assert_true(rig->initial_rad[0] == -0.5 && rig->initial_rad[1] == 1.0);
    assert_int_equal(rig->nft, 1);
    assert_string_equal(rig->ft[0].name, "foot_ft");
    assert_int_equal(rig->ft[0].address, 0x0d);
    assert_int_equal(rig_find_bus(rig, "right"), 1);
    assert_int_equal(rig_find_bus(rig, "none"), -1);
}

#define SERVO_END "kw_v_s_per_rad: 4, command_period_s: 0.004}"
#define SERVO_OTHERS(list) "kw_v_s_per_rad: 4, command_period_s: 0.004, others: [" list "]}"

TEST_WITH(gains_of_some_joints_differ, open_rig_tree, close_rig_tree)
{
    const struct servo_gains *gains;

    write_toy_with(SERVO_END, SERVO_OTHERS("{joints: [knee], kp_v_per_rad: 30, kd_v_s_per_rad: 2, "
                                           "limit_v: 24}"));
    gains = load_rig(rig_path)->servo.gains;
    assert_true(gains[0].kp_v_per_rad == 10 && gains[0].kd_v_s_per_rad == 0);
    assert_true(gains[0].limit_v == 0);
    assert_true(gains[1].kp_v_per_rad == 30 && gains[1].kd_v_s_per_rad == 2);
    assert_true(gains[1].ki_v_per_rad_s == 20 && gains[1].kw_v_s_per_rad == 4);
    assert_true(gains[1].limit_v == 24);
}

TEST_WITH(gains_of_other_joints_are_refused, open_rig_tree, close_rig_tree)
{
    refused_with(SERVO_END, SERVO_OTHERS("{joints: [knea], kp_v_per_rad: 30}"),
                 "43:112: found unknown driven joint \"knea\", expected \"knee\"");
    refused_with(SERVO_END,
                 SERVO_OTHERS("{joints: [knee], ki_v_per_rad_s: 1}, {joints: [hip, knee]}"),
                 "43:154: found joint \"knee\" again, expected it once (line 43)");
}

TEST_WITH(the_coman_rig_reaches_every_joint_and_both_ankles, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_rig(HIL_SOURCE_DIR "/config/rigs/coman.yaml");
    double weight = 0.0;

    assert_int_equal(rig->robot->nv, 29);
    assert_int_equal(rig->naxis, 23);
    assert_int_equal(rig->nft, 4);
    assert_int_equal(rig->nbus, 5);
    assert_int_equal(rig->contact.nbody, 12); /* feet, and bodies with capsules */
    for (size_t i = 0; i < rig->naxis; i++) {
        assert_true(rig->axis[i].torque_address > 0);
    }
    for (size_t i = 1; i < 3; i++) {
        assert_int_equal(rig->contact.surface[i].mesh->nface, 504);
    }
    weight = rig->robot->total_mass * 9.81;
    assert_true(weight > 278.0 && weight < 278.5);
}

/* ---- bad rigs ---- */

/* What a rig that says nothing gets: the integrator of second order, one step a tick. */
TEST_WITH(steps_are_ticks_of_the_implicit_integrator_by_default, open_rig_tree, close_rig_tree)
{
    const struct rig *rig;

    write_toy_with("substep_s: 0.0005\n", "");
    rig = load_rig(rig_path);
    assert_int_equal(rig->substep_ns, rig->tick_ns);
    assert_int_equal(rig->substeps, 1);
    assert_int_equal(rig->integrator, PLANT_IMPLICIT);
}

TEST_WITH(rejects_ticks_that_substeps_do_not_fill, open_rig_tree, close_rig_tree)
{
    refused_with("substep_s: 0.0005", "substep_s: 0.0003",
                 "5:12: found a substep of 0.0003 s, expected one that divides the tick of "
                 "0.002 s exactly");
    refused_with("substep_s: 0.0005", "substep_s: 0.000333333333333333",
                 "5:12: found a substep of 0.000333333333333333 s, expected one that divides "
                 "the tick of 0.002 s exactly");
    refused_with("substep_s: 0.0005", "substep_s: 0.004",
                 "5:12: found a substep of 0.004 s, expected one that divides the tick of "
                 "0.002 s exactly");
    refused_with("tick_s: 0.002", "tick_s: 0.00200000000049",
                 "4:9: found a tick of 0.00200000000049 s, expected a whole number of "
                 "nanoseconds");
}

TEST_WITH(rejects_cogging_that_substeps_do_not_resolve, open_rig_tree, close_rig_tree)
{
    char robot[sizeof toy_robot + 128];

    strcpy(robot, toy_robot);
    assert_true(replace(robot, sizeof robot, "L_h: 0.0003}",
                        "L_h: 0.0003, cogging: [{per_turn: 24, nm: 1000}]}"));
    assert_int_equal(write_file("config/robots/toy.yaml", robot, strlen(robot)), 0);
    refused_with("substep_s: 0.0005", "substep_s: 0.0005",
                 "5:12: joint hip: the rotor oscillates on its cogging at up to "
                 "4899 rad/s, expected no more than 4000 rad/s for substeps of "
                 "0.0005 s; lower the cogging, or set substep_s to at most 0.000408");
    write_toy_with("substep_s: 0.0005", "substep_s: 0.0004");
    assert_true(load_rig(rig_path)->substep_ns == 400000);
    write_toy_with("substep_s: 0.0005", "substep_s: 0.0005\nintegrator: rk4");
    assert_true(load_rig(rig_path)->integrator == PLANT_RK4);
}

TEST_WITH(rejects_names_that_nothing_has, open_rig_tree, close_rig_tree)
{
    refused_with("pose: bent", "pose: bend",
                 "7:17: found unknown pose \"bend\", expected \"bent\"");
    refused_with("body: tail", "body: tial",
                 "17:27: found unknown body \"tial\", expected \"tail\"");
    refused_with("body: tail", "body: upper",
                 "17:27: found body \"upper\", on which the robot file has no frame or capsule, "
                 "expected one with either");
    refused_with("frame: sole", "frame: soul",
                 "16:27: found unknown frame \"soul\", expected \"sole\"");
    refused_with("material: rubber", "material: ruber",
                 "15:83: found unknown material \"ruber\", expected \"rubber\"");
    refused_with("[ground, ball]", "[ground, bell]",
                 "20:25: found unknown surface \"bell\", expected \"ball\"");
    refused_with("[spare, hip]", "[spare, hipp]",
                 "31:49: found unknown joint \"hipp\", expected \"hip\"");
    refused_with("[spare, spare, hip]", "[pelvis_rotation]",
                 "32:48: found unknown joint \"pelvis_rotation\", expected hip, knee or wag");
    refused_with("sensor: foot_ft", "sensor: foot_fr",
                 "37:43: found unknown F/T sensor \"foot_fr\", expected \"foot_ft\"");
    refused_with("{bus: right", "{bus: rigth",
                 "39:17: found unknown bus \"rigth\", expected \"right\"");
}

TEST_WITH(rejects_files_out_of_the_tree_or_missing, open_rig_tree, close_rig_tree)
{
    refused_with("file: ../robots/toy.yaml", "file: ../../robots/toy.yaml",
                 "2:15: found path \"../../robots/toy.yaml\", which leaves the configuration "
                 "tree, expected one at or below \"..\"");
    refused_with("mesh: ../meshes/toy.obj", "mesh: /etc/passwd",
                 "18:53: found absolute path \"/etc/passwd\", expected one relative to this "
                 "file");
}

TEST_WITH(rejects_keys_that_belong_to_another_shape, open_rig_tree, close_rig_tree)
{
    refused_with("shape: half_space", "shape: half_space, radius_m: 1",
                 "15:7: found key \"radius_m\" in a half space, expected none there");
    refused_with("radius_m: 0.02", "cells: 3",
                 "16:7: found a sphere without key \"radius_m\", expected it");
    refused_with("half_extents_m: [0.1, 0.2, 0.3]", "cells: 3",
                 "17:7: found a box without key \"half_extents_m\", expected it");
    refused_with("mesh: ../meshes/toy.obj, ", "",
                 "18:7: found a mesh without key \"mesh\", expected it");
    refused_with("body: world, ", "",
                 "15:7: found no body, expected one of \"body\" and \"frame\"");
    refused_with("body: world, ", "body: world, frame: sole, ",
                 "15:7: found both a body and a frame, expected one of \"body\" and \"frame\"");
}

TEST_WITH(rejects_pairs_that_cannot_touch, open_rig_tree, close_rig_tree)
{
    refused_with("[ground, ball]", "[ground]",
                 "20:16: found 1 surfaces, expected two: [one, other]");
    refused_with("[ground, ball]", "[wedge, ball]",
                 "20:16: found two surfaces of one body, expected surfaces of two bodies");
    refused_with("[block, ball]", "[ball, ground]",
                 "21:7: found the pair of line 20 again, expected it once");
}

TEST_WITH(rejects_materials_that_stick_less_than_they_slide, open_rig_tree, close_rig_tree)
{
    refused_with("static_friction: 1.1", "static_friction: 0.8",
                 "12:13: found static_friction 0.8 below dynamic_friction 0.9, expected at "
                 "least as much");
}

TEST_WITH(rejects_names_given_twice, open_rig_tree, close_rig_tree)
{
    refused_with("name: ball", "name: ground",
                 "16:14: found surface \"ground\" again, expected a name of its own");
    refused_with("name: right", "name: left",
                 "33:11: found bus \"left\" again, expected a name of its own (line 28 has "
                 "it)");
    refused_with("interface: can1", "interface: can0",
                 "34:16: found interface \"can0\" again, expected one of its own (bus "
                 "\"left\" has it)");
}

TEST_WITH(rejects_names_that_cannot_be_file_names, open_rig_tree, close_rig_tree)
{
    refused_with("name: toy", "name: a/toy",
                 "1:1: found rig \"a/toy\", expected letters, digits and _ - . only");
    refused_with("name: shin", "name: my shin",
                 "36:9: found board \"my shin\", expected letters, digits and _ - . only");
    refused_with("name: left", "name: ../left",
                 "28:11: found bus \"../left\", expected letters, digits and _ - . only");
    refused_with("interface: can0", "interface: can 0",
                 "29:16: found interface \"can 0\", expected letters, digits and _ - . only");
    refused_with("interface: can0", "interface: a_name_that_is_too_long",
                 "29:16: found \"a_name_that_is_too_long\", expected a text of 1 to 15 bytes");
}

TEST_WITH(rejects_an_address_twice_on_a_bus, open_rig_tree, close_rig_tree)
{
    refused_with("address: 0x0c", "address: 1",
                 "32:33: found address 0x01 again on bus \"left\", expected another (line 31 "
                 "has it)");
    refused_with("address: 0x0c", "address: 15",
                 "32:33: found address 15, expected 1 to 14 with protocol icub");
    refused_with("address: 0x0c", "address: 255",
                 "32:33: found 255, expected an integer from 1 to 254");
}

TEST_WITH(rejects_a_joint_driven_twice_or_not_at_all, open_rig_tree, close_rig_tree)
{
    refused_with("axes: [knee]", "axes: [hip]",
                 "36:54: found joint \"hip\" again, expected it on one axis (board in line "
                 "31)");
    refused_with("axes: [knee]", "axes: [spare]",
                 "1:1: found no axis for the drive of joint \"knee\", expected one on some "
                 "board, or the joint in \"undriven\"");
    refused_with("axes: [knee]", "axes: [wag]",
                 "36:54: found joint \"wag\", which has no drive, expected a driven joint");
    refused_with("buses:\n", "undriven: [hip]\nbuses:\n",
                 "27:12: found joint \"hip\", which a board drives (line 32), expected one "
                 "without");
}

TEST_WITH(takes_a_joint_that_is_said_to_be_undriven, open_rig_tree, close_rig_tree)
{
    char text[sizeof toy_rig + 64];

    strcpy(text, toy_rig);
    assert_true(replace(text, sizeof text, "axes: [knee]", "axes: [spare]"));
    assert_true(replace(text, sizeof text, "buses:\n", "undriven: [knee]\nbuses:\n"));
    write_rig_file(text);
    assert_int_equal(load_rig(rig_path)->naxis, 1);
}

TEST_WITH(rejects_torques_that_no_host_would_hear, open_rig_tree, close_rig_tree)
{
    refused_with("[spare, spare, hip]", "[knee]",
                 "32:47: found joint \"knee\", which is driven from bus \"right\", expected "
                 "joints of this bus");
    refused_with("[spare, spare, hip]", "[hip, hip]",
                 "32:53: found joint \"hip\" again, expected it on one torque board (line 32)");
    refused_with("[spare, spare, hip]", "[]", "32:47: found 0 joints, expected 1 to 6");
    refused_with("[spare, spare, hip]", "[hip, spare, spare, spare, spare, spare, spare]",
                 "32:47: found 7 joints, expected 1 to 6");
}

TEST_WITH(rejects_keys_that_belong_to_another_board, open_rig_tree, close_rig_tree)
{
    refused_with("axes: [knee]", "axes: [knee], period_s: 0.01",
                 "36:9: found key \"period_s\" in a motor board, expected none there");
    refused_with("sensor: foot_ft, ", "",
                 "37:9: found an F/T board without key \"sensor\", expected it");
    refused_with("axes: [knee]", "axes: [knee, spare, spare]",
                 "36:53: found 3 axes, expected 1 to 2");
    refused_with("axes: [knee]", "axes: []", "36:53: found 0 axes, expected 1 to 2");
}

TEST_WITH(rejects_what_the_boards_cannot_tell_a_host, open_rig_tree, close_rig_tree)
{
    refused_with("[1000, 1000, 2000]", "[1000, 1000.5, 2000]",
                 "37:66: found full scale 1000.5, expected an integer: boards report it as "
                 "one");
    refused_with("torque_full_scale_nm: 55", "torque_full_scale_nm: 55.5",
                 "25:25: found full scale 55.5, expected an integer: boards report it as "
                 "one");
    refused_with("period_s: 0.004", "period_s: 0.0045",
                 "32:78: found a period of 0.0045 s, expected whole milliseconds");
}

TEST_WITH(rejects_lockstep_ids_that_boards_use, open_rig_tree, close_rig_tree)
{
    refused_with("step_id: 0x5f0", "step_id: 0x123",
                 "39:33: found id 0x123, which belongs to the boards, expected one from 0x400 "
                 "to 0x6ff");
    refused_with("step_id: 0x5f0", "step_id: 0x6ff",
                 "39:11: found the id of the STEP frame, expected another for DONE");
}

TEST_WITH(rejects_a_base_position_twice_or_of_a_fixed_base, open_rig_tree, close_rig_tree)
{
    refused_with("{pose: bent}", "{pose: bent, base_height_m: 1, base_xyz_m: [0, 0, 1]}",
                 "7:10: found base_xyz_m and base_height_m, expected one of them");
    refused_with("{pose: bent}", "{pose: bent, base_height_m: 1}",
                 "7:10: found a place of the base, expected none for a robot with a fixed base");
}

TEST_WITH(rejects_a_command_period_off_the_ticks, open_rig_tree, close_rig_tree)
{
    refused_with("command_period_s: 0.004", "command_period_s: 0.003",
                 "43:86: found a command period of 0.003 s, expected a multiple of the tick "
                 "of 0.002 s");
}

TEST_WITH(rejects_a_rig_without_buses_and_with_too_many, open_rig_tree, close_rig_tree)
{
    const char *from = strstr(toy_rig, "buses:\n"), *to = strstr(toy_rig, "lockstep:");
    char text[2048], buses[2048] = "";
    size_t used = 0;

    snprintf(text, sizeof text, "%.*s", (int)(to - from), from);
    refused_with(text, "buses: []\n", "27:8: found 0 buses, expected 1 to 32");
    for (int i = 0; i <= RIG_BUSES_MAX; i++) {
        used += (size_t)snprintf(buses + used, sizeof buses - used,
                                 "  - {name: b%d, interface: can%d, boards: []}\n", i, i);
    }
    assert_buses_refused(buses, "28:3: found 33 buses, expected 1 to 32");
}

TEST_WITH(reports_an_arena_that_is_full, open_rig_tree, close_rig_tree)
{
    size_t capacity = 4096;
    enum error_code code;

    load_toy();
    do {
        const struct rig *rig = NULL;
        struct arena small;
        struct error error;

        assert_ok(arena_init(&small, capacity, &error));
        code = rig_load(rig_path, &small, &rig, &error);
        assert_true(code == ERROR_NONE || code == ERROR_MEMORY);
        arena_fini(&small);
        capacity += 256;
    } while (code);
}
