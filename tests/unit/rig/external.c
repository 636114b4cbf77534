/* SPDX-License-Identifier: Apache-2.0 */
/* Boards that a rig calls external: what becomes of the keys, and where they are refused. */

#include "tests/unit/rig/rig_bench.h"

#define SHIN "{name: shin, kind: motor, address: 3, axes: [knee]}"
#define RIGHT "  - name: right\n    interface: can1\n"

/* The toy rig with another shin board (line 36, from column 9 on), its bus of some protocol. */
static void write_shin(const char *protocol, const char *keys)
{
    char text[sizeof toy_rig + 512], shin[256], bus[128];

    strcpy(text, toy_rig);
    snprintf(shin, sizeof shin, "{%s name: shin, kind: motor, address: 3, axes: [knee]}", keys);
    snprintf(bus, sizeof bus, "  - {name: right, protocol: %s, interface: can1, boards: [\n",
             protocol);
    assert_true(replace(text, sizeof text, SHIN, shin));
    if (protocol[0]) {
        /* One line less above it; the F/T board goes, which not all have there */
        assert_true(replace(text, sizeof text, RIGHT "    boards:\n      - ", bus));
        strcpy(strchr(strstr(text, shin), '\n'), "]}\n");
    }
    write_rig_file(text);
}

static void refused(const char *protocol, const char *keys, const char *message)
{
    write_shin(protocol, keys);
    assert_rig_refused(keys, message);
}

static const struct board_config *load_shin(const char *protocol, const char *keys)
{
    const struct rig *rig;

    write_shin(protocol, keys);
    rig = load_rig(rig_path);
    return &rig->boards.board[rig->bus[1].first_board];
}

TEST_WITH(a_board_may_be_external, open_rig_tree, close_rig_tree)
{
    const struct board_config *shin = load_shin("", "");

    assert_false(shin->external || shin->external_torque);
    shin = load_shin("", "external: true,");
    assert_true(shin->external && !shin->external_torque);
    assert_int_equal(shin->external_timeout_ns, 20000000);
    shin =
        load_shin("compact", "external: true, external_timeout_s: 0.5, external_follows: torque,");
    assert_true(shin->external && shin->external_torque);
    assert_int_equal(shin->external_timeout_ns, 500000000);
    shin = load_shin("foc", "external: true, external_follows: position,");
    assert_true(shin->external && !shin->external_torque);
}

TEST_WITH(what_only_external_boards_have_is_refused_of_others, open_rig_tree, close_rig_tree)
{
    refused("", "external_timeout_s: 0.1,",
            "36:30: found external_timeout_s without external: true, expected both or none");
    refused("", "external: false, external_timeout_s: 0.1,",
            "36:47: found external_timeout_s without external: true, expected both or none");
    refused("", "external_follows: position,",
            "36:28: found external_follows without external: true, expected both or none");
    refused("", "external: maybe,", "36:20: found \"maybe\", expected true or false");
    refused("compact", "external: true, external_follows: force,",
            "34:36: found \"force\", expected position or torque");
}

TEST_WITH(boards_that_cannot_be_read_are_refused, open_rig_tree, close_rig_tree)
{
    char text[sizeof toy_rig + 512];

    refused("cia402", "external: true,",
            "34:12: found external: true with protocol cia402, expected it with icub, "
            "compact or foc only");
    refused("icub", "external: true, external_follows: torque,",
            "34:36: found external_follows: torque with protocol icub, expected it with compact "
            "only");

    /* Kinds of boards, on the icub buses of the toy rig */
    strcpy(text, toy_rig);
    assert_true(replace(text, sizeof text, "{kind: torque,", "{external: true, kind: torque,"));
    write_rig_file(text);
    assert_rig_refused("torque",
                       "32:20: found external: true on a board of another kind, expected it on a "
                       "motor or an F/T board");
    strcpy(text, toy_rig);
    assert_true(replace(text, sizeof text, "{kind: ft,",
                        "{external: true, external_follows: position, kind: ft,"));
    write_rig_file(text);
    assert_rig_refused("ft", "37:44: found external_follows on an F/T board, expected it on a "
                             "motor board: no joint follows a sensor");
}

TEST_WITH(a_joint_without_rotor_or_spring_cannot_follow, open_rig_tree, close_rig_tree)
{
    char robot[sizeof toy_robot + 64], copy[512];

    snprintf(copy, sizeof copy, "cp '%s/tests/old/robots/oil.yaml' '%s/config/robots/toy.yaml'",
             HIL_SOURCE_DIR, tree);
    assert_int_equal(system(copy), 0);
    write_rig_file("name: valve\nsupply_v: 48\n"
                   "robot: {file: ../robots/toy.yaml}\n"
                   "motors: {joint_ticks_per_rev: 65536, motor_ticks_per_link_rev: 65536,\n"
                   "         torque_full_scale_nm: 200, current_limit_a: 10}\n"
                   "initial: {pose: bent}\n"
                   "buses:\n"
                   "  - name: leg\n"
                   "    interface: can0\n"
                   "    boards: [{kind: motor, address: 1, axes: [hip, knee], external: true}]\n");
    assert_rig_refused("valve", "10:47: found joint \"hip\" with a hydraulic drive on an external "
                                "board, expected one with a motor: there is no rotor that could "
                                "follow");

    strcpy(robot, toy_robot);
    assert_true(replace(robot, sizeof robot, "Ks_nm_rad: 400", "Ks_nm_rad: 0"));
    assert_int_equal(write_file("config/robots/toy.yaml", robot, strlen(robot)), 0);
    refused("compact", "external: true, external_follows: torque,",
            "34:88: found joint \"knee\" without a spring on a board with external_follows: "
            "torque, expected one with a spring, which exerts it");
    assert_true(load_shin("compact", "external: true,")->external);
}

/* ---- faults ---- */

TEST_WITH(what_a_real_board_does_nobody_disturbs, open_rig_tree, close_rig_tree)
{
    static const char *const fault[] = {"board shin off", "motor knee jam"};
    const bool wire[2] = {false, false};
    const struct rig *rig;
    struct faults *faults;
    struct error error;

    write_shin("", "external: true,");
    rig = load_rig(rig_path);
    assert_int_equal(rig_faults_create(rig, fault, 1, 1, wire, &arena, &faults, &error),
                     ERROR_INPUT);
    assert_string_equal(error.text,
                        "--fault: \"board shin off\": found a fault of board shin, which is "
                        "external, expected one of the simulator's own");
    assert_ok(rig_faults_create(rig, fault + 1, 1, 1, wire, &arena, &faults, &error));
}
