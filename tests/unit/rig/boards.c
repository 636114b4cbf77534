/* SPDX-License-Identifier: Apache-2.0 */
/* The buses of rigs: what each speaks, what that allows on it, how far it is loaded. */
#include "boards/described/protocol.h"
#include "boards/protocol_list.h"

#include "tests/unit/rig/rig_bench.h"

/* ---- what a bus speaks ---- */

TEST_WITH(a_bus_says_how_its_real_interface_is_set, open_rig_tree, close_rig_tree)
{
    const struct rig *rig =
        load_buses("  - {name: left, interface: can0, configure: true, sample_point: 0.8,\n"
                   "     restart_ms: 100, boards: [{kind: motor, address: 4, axes: [hip]}]}\n"
                   "  - {name: right, interface: can1,\n"
                   "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n");

    assert_true(rig->bus[0].configure);
    assert_true(rig->bus[0].sample_point == 0.8);
    assert_int_equal(rig->bus[0].restart_ms, 100);
    assert_false(rig->bus[1].configure);
    assert_buses_refused(
        "  - {name: left, interface: can0, sample_point: 0.8,\n"
        "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n",
        "28:49: found sample_point on bus \"left\" without configure: true, expected both or none");
    assert_buses_refused(
        "  - {name: left, interface: can0, restart_ms: 0,\n"
        "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n",
        "28:47: found restart_ms on bus \"left\" without configure: true, expected both or none");
}

/* The toy rig on two buses of cia402 boards, with switches of its joints. */
static const char *write_switches(const char *switches)
{
    static char text[sizeof toy_rig + 2048];
    const char *from = strstr(toy_rig, "buses:\n"), *to = strstr(toy_rig, "lockstep:");

    snprintf(text, sizeof text,
             "%.*s  switches:\n%sbuses:\n"
             "  - {name: left, interface: can0, protocol: cia402,\n"
             "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n"
             "  - {name: right, interface: can1, protocol: cia402,\n"
             "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n%s",
             (int)(from - toy_rig), toy_rig, switches, strchr(to, '\n') + 1);
    write_rig_file(text);
    return switches;
}

TEST_WITH(switches_stand_on_joints, open_rig_tree, close_rig_tree)
{
    const struct board_switches *knee;

    write_switches(
        "    knee: {negative_limit_rad: -1, positive_limit_rad: 0.5, home_rad: [0, 0.1],\n"
        "           index_pulse: true}\n");
    knee = &load_rig(rig_path)->boards.board[1].axis[0].switches;
    assert_true(knee->negative && knee->positive && knee->home);
    assert_true(knee->negative_rad == -1.0 && knee->positive_rad == 0.5);
    assert_true(knee->home_rad[0] == 0.0 && knee->home_rad[1] == 0.1);
    assert_true(knee->index_rad > 0.0 && knee->index_rad < 2.0 * M_PI);
    assert_rig_refused(write_switches("    knee: {home_rad: [0.1, 0]}\n"),
                       "28:22: found a home switch that is on from 0.1 to 0 rad, expected the "
                       "smaller angle first");
    assert_rig_refused(
        write_switches("    knee: {negative_limit_rad: 1, positive_limit_rad: 0.5}\n"),
        "28:32: found negative_limit_rad 1, expected it below positive_limit_rad, 0.5");
    assert_rig_refused(write_switches("    kne: {index_pulse: true}\n"),
                       "28:10: found unknown joint \"kne\", expected \"knee\"");
}

TEST_WITH(a_bus_may_take_padded_frames, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_buses("  - {name: left, interface: can0, padded_frames: true,\n"
                                       "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n"
                                       "  - {name: right, interface: can1,\n"
                                       "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n");

    assert_true(rig->boards.bus[0].padded);
    assert_false(rig->boards.bus[1].padded);
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: compact, padded_frames: true,\n"
        "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n",
        "28:69: found padded_frames with protocol compact, expected it with icub or foc only");
}

TEST_WITH(each_bus_speaks_its_own_protocol, open_rig_tree, close_rig_tree)
{
    const struct rig *rig =
        load_buses("  - {name: left, interface: can0, protocol: foc,\n"
                   "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n"
                   "  - {name: right, interface: can1, protocol: compact, fd: true,\n"
                   "     bitrate: 500000, data_bitrate: 2000000,\n"
                   "     boards: [{kind: motor, address: 31, axes: [knee]}]}\n");

    assert_ptr_equal(rig->bus[0].protocol, &protocol_foc);
    assert_ptr_equal(rig->boards.bus[0].protocol, &protocol_foc);
    assert_string_equal(rig->host_bus[0].protocol, "foc");
    assert_false(rig->bus[0].fd || rig->boards.bus[0].fd || rig->host_bus[0].fd);
    assert_ptr_equal(rig->bus[1].protocol, &protocol_compact);
    assert_string_equal(rig->host_bus[1].protocol, "compact");
    assert_true(rig->bus[1].fd && rig->boards.bus[1].fd && rig->host_bus[1].fd);
    assert_int_equal(rig->bus[1].bitrate, 500000);
    assert_int_equal(rig->bus[1].data_bitrate, 2000000);
}

TEST_WITH(the_controller_is_told_the_drives_of_foc_axes, open_rig_tree, close_rig_tree)
{
    const struct rig *rig =
        load_buses("  - {name: left, interface: can0, protocol: foc, boards: [\n"
                   "     {kind: motor, address: 1, axes: [hip], current_limit_a: 7},\n"
                   "     {kind: motor, address: 2, axes: [knee]},\n"
                   "     {kind: torque, address: 12, joints: [spare, hip], period_s: 0.008}]}\n");
    const struct host_drive *drive = &rig->axis[0].drive;

    assert_true(drive->gear == 100 && drive->spring_nm_rad == 400);
    assert_true(drive->winding_ohm == 0.6 && drive->winding_h == 0.0003);
    assert_true(drive->current_limit_a == 7 && rig->axis[1].drive.current_limit_a == 12);
    assert_int_equal(drive->poles, 8);
    assert_int_equal(rig->axis[0].torque_period_ns, 8000000);
    assert_int_equal(rig->axis[1].torque_period_ns, 0);
}

TEST_WITH(a_protocol_has_its_own_addresses_axes_and_boards, open_rig_tree, close_rig_tree)
{
    assert_buses_refused("  - {name: left, interface: can0, protocol: foc,\n"
                         "     boards: [{kind: motor, address: 5, axes: [hip]}]}\n",
                         "29:38: found address 5, expected 1 to 4 with protocol foc");
    assert_buses_refused("  - {name: left, interface: can0, protocol: foc,\n"
                         "     boards: [{kind: motor, address: 4, axes: [hip, knee]}]}\n",
                         "29:47: found 2 axes, expected 1");
    assert_buses_refused("  - {name: left, interface: can0, protocol: foc,\n"
                         "     boards: [{kind: ft, address: 15, sensor: foot_ft}]}\n",
                         "29:15: found an F/T board without key \"full_scale_n\", expected it");
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: compact,\n"
        "     boards: [{kind: torque, address: 15, joints: [hip]}]}\n",
        "29:15: found a torque board with protocol compact, expected it with icub or foc only");
    assert_buses_refused("  - {name: left, interface: can0, protocol: pdo, boards: []}\n",
                         "28:45: found no file \"pdo\", nor pdo.yaml in /etc/coman-hil/protocols; "
                         "coman-hil list has the protocols that are there");
}

/* Each limit of a protocol has its place in the file. */
TEST_WITH(what_a_protocol_cannot_do_is_refused_with_its_place, open_rig_tree, close_rig_tree)
{
    const struct protocol *protocol;
    char buses[160], message[160];

    for (size_t i = 0; (protocol = protocol_at(i)); i++) {
        snprintf(buses, sizeof buses, "  - {name: left, interface: can0, protocol: %s%s,\n%s",
                 protocol->name, protocol->canfd_only ? ", fd: true, data_bitrate: 5000000" : "",
                 "     boards: [{kind: inertial, address: 1}]}\n");
        snprintf(message, sizeof message,
                 "29:15: found a board of sensors on a bus with protocol %s, expected motor "
                 "boards only",
                 protocol->name);
        if (protocol->motors_only) {
            assert_buses_refused(buses, message);
        }
        snprintf(buses, sizeof buses,
                 "  - {name: left, interface: can0, protocol: %s, boards: []}\n", protocol->name);
        snprintf(message, sizeof message,
                 "28:12: found bus \"left\" without fd, expected fd: true with protocol %s",
                 protocol->name);
        if (protocol->canfd_only) {
            assert_buses_refused(buses, message);
        }
    }
}

/* TPDO 4, SDO, and what is free */
TEST_WITH(lockstep_ids_keep_clear_of_cia402_nodes, open_rig_tree, close_rig_tree)
{
    static const char buses[] = "  - {name: left, interface: can0, protocol: cia402,\n"
                                "     boards: [{kind: motor, address: 1, axes: [hip, knee]}]}\n";
    static const char *const taken[] = {"0x481", "0x500", "0x59f", "0x600", "0x61f"};
    static const char *const free_ids[] = {"0x5a0", "0x620", "0x6c0"};
    char lockstep[32], message[160];

    for (int i = 0; i < 5; i++) {
        snprintf(lockstep, sizeof lockstep, "step_id: %s", taken[i]);
        snprintf(message, sizeof message,
                 "30:21: found id %s, which belongs to cia402 boards, expected one from 0x5a0 to "
                 "0x5ff, 0x620 to 0x67f or 0x6c0 to 0x6ff",
                 taken[i]);
        write_buses_and_lockstep(buses, lockstep);
        assert_rig_refused(buses, message);
    }
    for (int i = 0; i < 3; i++) {
        snprintf(lockstep, sizeof lockstep, "step_id: %s", free_ids[i]);
        write_buses_and_lockstep(buses, lockstep);
        assert_int_equal(load_rig(rig_path)->boards.nboard, 1);
    }
}

TEST_WITH(fd_belongs_to_some_protocols_and_has_a_data_bitrate, open_rig_tree, close_rig_tree)
{
    char list[80], message[160];

    snprintf(message, sizeof message,
             "28:39: found fd with protocol icub, expected it with %s only",
             protocols_list(offsetof(struct protocol, canfd), list, sizeof list));
    assert_buses_refused(
        "  - {name: left, interface: can0, fd: true, data_bitrate: 2000000, boards: []}\n",
        message);
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: compact, fd: true, boards: []}\n",
        "28:5: found fd without data_bitrate on bus \"left\", expected fd: true and a "
        "data_bitrate of at least the bitrate together");
    assert_buses_refused(
        "  - {name: left, interface: can0, data_bitrate: 2000000, boards: []}\n",
        "28:49: found data_bitrate without fd on bus \"left\", expected fd: true and a "
        "data_bitrate of at least the bitrate together");
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: compact, fd: true,\n"
        "     data_bitrate: 500000, boards: []}\n",
        "29:20: found a data_bitrate below the bitrate on bus \"left\", expected fd: true and a "
        "data_bitrate of at least the bitrate together");
}

/* ---- loads ---- */

struct expected_load {
    const char *bus;
    double percent;
};

static void check_loads(const char *file, int64_t command_period_ns,
                        const struct expected_load *expected, size_t count)
{
    char path[256];
    const struct rig *rig;

    snprintf(path, sizeof path, "%s/config/rigs/%s", HIL_SOURCE_DIR, file);
    rig = load_rig(path);
    assert_int_equal(rig->naxis, 23);
    assert_int_equal(rig->nft, 4);
    assert_int_equal(rig->nbus, count);
    for (size_t i = 0; i < count; i++) {
        double telemetry, command, percent;
        int bus = rig_find_bus(rig, expected[i].bus);

        assert_true(bus >= 0);
        rig_bus_load(rig, (size_t)bus, command_period_ns, &telemetry, &command);
        percent = 100 * (telemetry + command) / (double)rig->bus[bus].bitrate;
        if (fabs(percent - expected[i].percent) > 0.05) {
            fail_msg("%s: %s at %.3f %%, expected %.2f %%", file, expected[i].bus, percent,
                     expected[i].percent);
        }
    }
}

#define CHECK_LOADS(file, expected)                                                                \
    check_loads(file, 1000000, expected, sizeof expected / sizeof *expected)

/* The reference is the table "COMAN by limb" of the protocol study: iCub BLL, 4 ms telemetry, 1 kHz
 * voltage commands, F/T and joint torques at 5 ms, 1 Mbit/s. */
TEST_WITH(icub_loads_are_those_of_the_protocol_study, open_rig_tree, close_rig_tree)
{
    static const struct expected_load loads[] = {{"torso", 57.14},
                                                 {"left_leg", 100.69},
                                                 {"right_leg", 100.69},
                                                 {"left_arm", 70.20},
                                                 {"right_arm", 70.20}};

    CHECK_LOADS("coman.yaml", loads);
}

/* The study's 94.5 % for three axes, 67.5 % for two and 23 % for F/T at 1 kHz; torques every 10 ms
 * add 2.3 %, and ADDITIONAL_STATUS (95 bits every 100 + 100 a ms) 0.08 or 0.10 %. */
TEST_WITH(foc_loads_are_those_of_the_protocol_study, open_rig_tree, close_rig_tree)
{
    static const struct expected_load loads[] = {
        {"torso", 96.90},        {"left_hip", 96.90},       {"left_shank", 96.90},
        {"right_hip", 96.90},    {"right_shank", 96.90},    {"left_shoulder", 69.88},
        {"left_forearm", 92.88}, {"right_shoulder", 69.88}, {"right_forearm", 92.88},
        {"feet", 46.00},
    };

    CHECK_LOADS("coman-foc.yaml", loads);
}

/* The study's 54.0, 77.0, 40.5 and 63.5 % have a set-point frame of 8 bytes; three axes need 6 and
 * two need 4 of them (115 and 95 bits for 135). STATE adds 135 bits every 50 ms for each axis and
 * F/T board. */
TEST_WITH(compact_loads_are_those_of_the_protocol_study, open_rig_tree, close_rig_tree)
{
    static const struct expected_load loads[] = {
        {"torso", 54.0 - 2.0 + 0.81},         {"left_hip", 54.0 - 2.0 + 0.81},
        {"left_shank", 77.0 - 2.0 + 1.08},    {"right_hip", 54.0 - 2.0 + 0.81},
        {"right_shank", 77.0 - 2.0 + 1.08},   {"left_shoulder", 40.5 - 4.0 + 0.54},
        {"left_forearm", 63.5 - 4.0 + 0.81},  {"right_shoulder", 40.5 - 4.0 + 0.54},
        {"right_forearm", 63.5 - 4.0 + 0.81},
    };

    CHECK_LOADS("coman-compact.yaml", loads);
}

/* Frames of 0, 1, 6 and 8 bytes are 55, 65, 115 and 135 bits at the most: with every SYNC 8 bytes
 * an axis and twice 6 a force-torque node, the SYNC and 2 bytes an axis of each drive; every 100 ms
 * the statuswords, 2 bytes an axis, and the heartbeat of each node. */
TEST_WITH(cia402_loads_are_those_of_counted_bits, open_rig_tree, close_rig_tree)
{
    const double three = 3 * 13.5 + 11.5 + 5.5 + 0.115 + 0.065, ft = 2 * 11.5 + 0.065;
    const double four = 4 * 13.5 + 13.5 + 5.5 + 0.135 + 0.065;
    const struct expected_load loads[] = {
        {"torso", three},     {"left_hip", three},         {"left_shank", three + ft},
        {"right_hip", three}, {"right_shank", three + ft}, {"left_arm", four},
        {"right_arm", four},  {"wrists", 5.5 + 2 * ft},
    };

    CHECK_LOADS("coman-cia402.yaml", loads);
}

/* Frames as compact's above, and 135 bits of each command, 115 of each answer a millisecond; of
 * ODrive's 135 bits of each command, and every 10 and 100 ms from each drive; of
 * RobStride's 160 bits of each command and as many of its answer, with identifiers of 29 bits,
 * every 2 ms. */
TEST_WITH(described_loads_are_those_of_counted_bits, open_rig_tree, close_rig_tree)
{
    const double cheetah = 13.5 + 11.5, odrive = 13.5 + 3 * 1.35 + 4 * 0.135;
    const double robstride = (16.0 + 16.0) / 2;
    const struct expected_load of_cheetah[] = {
        {"torso", 3 * cheetah},         {"left_hip", 3 * cheetah},
        {"left_shank", 3 * cheetah},    {"right_hip", 3 * cheetah},
        {"right_shank", 3 * cheetah},   {"left_shoulder", 2 * cheetah},
        {"left_forearm", 2 * cheetah},  {"right_shoulder", 2 * cheetah},
        {"right_forearm", 2 * cheetah}, {"sensors", 4 * (11.5 + 0.27)},
    };
    const struct expected_load of_odrive[] = {
        {"torso", 3 * odrive},         {"left_hip", 3 * odrive},
        {"left_shank", 3 * odrive},    {"right_hip", 3 * odrive},
        {"right_shank", 3 * odrive},   {"left_shoulder", 2 * odrive},
        {"left_forearm", 2 * odrive},  {"right_shoulder", 2 * odrive},
        {"right_forearm", 2 * odrive}, {"sensors", 4 * (11.5 + 0.27)},
    };

    const struct expected_load of_robstride[] = {
        {"torso", 3 * robstride},         {"left_hip", 3 * robstride},
        {"left_shank", 3 * robstride},    {"right_hip", 3 * robstride},
        {"right_shank", 3 * robstride},   {"left_shoulder", 2 * robstride},
        {"left_forearm", 2 * robstride},  {"right_shoulder", 2 * robstride},
        {"right_forearm", 2 * robstride}, {"sensors", 4 * (11.5 + 0.27)},
    };

    CHECK_LOADS("coman-mini-cheetah.yaml", of_cheetah);
    CHECK_LOADS("coman-odrive.yaml", of_odrive);
    CHECK_LOADS("coman-robstride.yaml", of_robstride);
}

/* A file that describes a protocol is needed, is looked for beside the rig, and says which boards
 * there may be. */
TEST_WITH(a_described_bus_has_its_protocol, open_rig_tree, close_rig_tree)
{
    static const char protocol[] =
        "name: own\naddress_max: 4\nstates: [{name: idle, law: \"off\"}]\n"
        "frames: [{name: A, from: board, id: 0x6f8, by: address, period_s: 0.01}]\n";
    static const char fast[] =
        "name: fast\nstates: [{name: idle, law: \"off\"}]\n"
        "frames: [{name: A, from: board, id: 0x100, by: address, period_s: 0.001}]\n";
    const struct rig *rig;
    char path[128];

    assert_int_equal(write_file("config/rigs/own.yaml", protocol, sizeof protocol - 1), 0);
    rig = load_buses("  - {name: left, interface: can0, protocol: own.yaml,\n"
                     "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n"
                     "  - {name: right, interface: can1,\n"
                     "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n");
    assert_ptr_equal(rig->bus[0].protocol, &protocol_described);
    assert_ptr_equal(rig->boards.bus[0].described, rig->bus[0].described);
    assert_ptr_equal(rig->host_bus[0].described, rig->bus[0].described);
    assert_null(rig->bus[1].described);

    assert_buses_refused(
        "  - {name: left, interface: can0, boards: []}\nprotocol: described\n",
        "29:11: found protocol described, expected the name or the file of a protocol");
    assert_buses_refused("  - {name: left, interface: can0, protocol: icup, boards: []}\n",
                         "28:45: found unknown protocol \"icup\", expected \"icub\"");
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: nobody, boards: []}"
        "\n",
        "28:45: found no file \"nobody\", nor nobody.yaml in /etc/coman-hil/protocols; coman-hil "
        "list has the protocols that are there");
    assert_buses_refused("  - {name: left, interface: can0, protocol: own.yaml,\n"
                         "     boards: [{kind: motor, address: 5, axes: [hip]}]}\n",
                         "29:38: found address 5, expected 1 to 4 with protocol own");
    assert_buses_refused("  - {name: left, interface: can0, protocol: own.yaml,\n"
                         "     boards: [{kind: motor, address: 1, axes: [hip, knee]}]}\n",
                         "29:47: found 2 axes, expected at most 1 with protocol own");

    /* The tick of this rig is 2 ms */
    assert_int_equal(write_file("config/rigs/fast.yaml", fast, sizeof fast - 1), 0);
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: fast.yaml,\n"
        "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n",
        "28:5: found frame A of protocol fast every 0.001 s on bus \"left\", expected the tick of "
        "0.002 s or more");
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: own.yaml,\n"
        "     boards: [{kind: inertial, address: 1}]}\n",
        "29:15: found a board of a kind that sends no frame in protocol own, expected another "
        "kind or such a frame");
    write_buses_and_lockstep("  - {name: left, interface: can0, protocol: own.yaml,\n"
                             "     boards: [{kind: motor, address: 4, axes: [hip]}]}\n"
                             "  - {name: right, interface: can1,\n"
                             "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n",
                             "step_id: 0x6fc");
    assert_rig_refused("step_id",
                       "32:21: found id 0x6fc, which belongs to frame A of protocol own, "
                       "expected another");
    snprintf(path, sizeof path, "%s/config/rigs/own.yaml", tree);
    assert_int_equal(unlink(path), 0);
    snprintf(path, sizeof path, "%s/config/rigs/fast.yaml", tree);
    assert_int_equal(unlink(path), 0);
}

/* What files of before the key "personality" was renamed mean. */
TEST_WITH(the_old_key_of_a_protocol_is_read_and_its_place_kept, open_rig_tree, close_rig_tree)
{
    static const char own[] =
        "name: own\nstates: [{name: idle, law: \"off\"}]\naddress_max: 4\n"
        "frames: [{name: A, from: board, id: 0x6f8, by: address, period_s: 0.01}]\n";
    static const char boards[] = "     boards: [{kind: motor, address: %d, axes: [%s]}]}\n";
    /* Keys of the rig and of the buses, the protocols that these mean, and the places */
    static const struct {
        const char *rig, *left, *right, *of_left, *of_right;
        int line[3], column;
    } rows[] = {
        {"personality: cia402", "", "", "cia402", "cia402", {32}, 1},
        {"personality: described\nprotocol: own.yaml", "", "", "own", "own", {32}, 1},
        {"protocol: own.yaml",
         "personality: described,",
         "personality: foc,",
         "own",
         "foc",
         {28, 30},
         35},
        {"personality: foc\nprotocol: own.yaml",
         "personality: described,",
         "",
         "own",
         "foc",
         {32, 28},
         1},
        {"protocol: foc",
         "personality: described, protocol: own.yaml,",
         "protocol: cia402,",
         "own",
         "cia402",
         {28},
         35},
    };
    char path[128], buses[600];

    assert_int_equal(write_file("config/rigs/own.yaml", own, sizeof own - 1), 0);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct yaml_old_key *old;
        const struct rig *rig;
        int used;

        used =
            snprintf(buses, sizeof buses, "  - {name: left, interface: can0, %s\n", rows[i].left);
        used += snprintf(buses + used, sizeof buses - (size_t)used, boards, 1, "hip");
        used += snprintf(buses + used, sizeof buses - (size_t)used,
                         "  - {name: right, interface: can1, %s\n", rows[i].right);
        used += snprintf(buses + used, sizeof buses - (size_t)used, boards, 2, "knee");
        snprintf(buses + used, sizeof buses - (size_t)used, "%s\n", rows[i].rig);
        rig = load_buses(buses);
        for (int bus = 0; bus < 2; bus++) {
            const char *of = bus ? rows[i].of_right : rows[i].of_left;

            assert_string_equal(rig->bus[bus].described ? rig->bus[bus].described->name
                                                        : rig->bus[bus].protocol->name,
                                of);
        }
        old = rig->old_key;
        assert_non_null(old);
        assert_int_equal(old->mark.column, rows[i].column);
        for (int k = 0; k < 3 && rows[i].line[k]; k++, old = old->next) {
            assert_non_null(old);
            assert_int_equal(old->mark.line, rows[i].line[k]);
        }
        assert_null(old);
    }
    assert_null(load_buses("  - {name: left, interface: can0,\n"
                           "     boards: [{kind: motor, address: 1, axes: [hip, knee]}]}\n")
                    ->old_key);
    assert_buses_refused("  - {name: left, interface: can0, personality: icub, protocol: foc,\n"
                         "     boards: []}\n",
                         "28:35: found unknown key \"personality\" in a bus, expected name, "
                         "interface, bitrate, fd, data_bitrate, protocol, padded_frames, "
                         "configure, sample_point, restart_ms or boards");
    snprintf(path, sizeof path, "%s/config/rigs/own.yaml", tree);
    assert_int_equal(unlink(path), 0);
}

TEST_WITH(a_bus_with_described_fd_frames_is_one_of_can_fd, open_rig_tree, close_rig_tree)
{
    static const char protocol[] = "name: long\nstates: [{name: idle, law: \"off\"}]\nframes:\n"
                                   "  - {name: A, from: board, id: 0x100, by: address, fd: true, "
                                   "length: 48, period_s: 0.01}\n";
    const struct rig *rig;
    double telemetry, command;
    char path[128];

    assert_int_equal(write_file("config/rigs/long.yaml", protocol, sizeof protocol - 1), 0);
    assert_buses_refused(
        "  - {name: left, interface: can0, protocol: long.yaml,\n"
        "     boards: [{kind: motor, address: 1, axes: [hip]}]}\n",
        "28:5: found bus \"left\" of classic CAN, expected fd: true and a data_bitrate: frame A of "
        "protocol long is a CAN FD one");
    rig = load_buses("  - {name: left, interface: can0, protocol: long.yaml,\n"
                     "     fd: true, data_bitrate: 8000000,\n"
                     "     boards: [{kind: motor, address: 1, axes: [hip]}]}\n"
                     "  - {name: right, interface: can1,\n"
                     "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n");
    assert_true(rig->bus[0].fd && rig->boards.bus[0].fd && rig->host_bus[0].fd);

    /* 98.9 us as in the study below, every 10 ms */
    rig_bus_load(rig, 0, 1000000, &telemetry, &command);
    assert_true(fabs(telemetry - 9890.0) < 10.0);
    assert_true(command == 0.0);
    snprintf(path, sizeof path, "%s/config/rigs/long.yaml", tree);
    assert_int_equal(unlink(path), 0);
}

/* The study's worst-case times at 1/8 Mbit/s: 48 bytes 98.9 us, 64 bytes 118.9, 12 bytes 53.2, 8
 * bytes 48.2; from 24 bytes (68.9 us) on a byte is 1.25 us, so that the set-points of 13 axes in 32
 * bytes take 78.9 and those of 10 axes in 20 bytes 63.9. */
TEST_WITH(fd_loads_are_those_of_the_protocol_study, open_rig_tree, close_rig_tree)
{
    const double left = 3 * 98.9 + 118.9 + 2 * 53.2 + 78.9 + 15 * 48.2 / 50;
    const double right = 2 * 98.9 + 118.9 + 2 * 53.2 + 63.9 + 12 * 48.2 / 50;
    const struct expected_load loads[] = {{"left", left / 10}, {"right", right / 10}};

    CHECK_LOADS("coman-fd.yaml", loads);
}

/* Three frames of 8 bytes (135 bits at the most) every 5 ms; of 6, 6 and 8 bytes every 2 ms, with 6
 * and 8 more every 50 ms; one of 32 bytes a millisecond, and of 8 every 50 ms (times as above). */
TEST_WITH(inertial_boards_load_their_buses, open_rig_tree, close_rig_tree)
{
    static const struct {
        const char *with, *without, *bus;
        double percent;
    } rigs[] = {
        {"coman-imu", "coman", "torso", 3 * 135 / 5e1},
        {"coman-compact-imu", "coman-compact", "torso",
         (115 + 115 + 135) / 2e1 + (115 + 135) / 50e1},
        {"coman-fd-imu", "coman-fd", "left", 78.9 / 10 + 48.2 / 50 / 10},
    };

    for (int i = 0; i < 3; i++) {
        double percent[2];

        for (int k = 0; k < 2; k++) {
            char path[256];
            const struct rig *rig;
            double telemetry, command;
            int bus;

            snprintf(path, sizeof path, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR,
                     k ? rigs[i].with : rigs[i].without);
            rig = load_rig(path);
            assert_int_equal(rig->imu.present, k);
            bus = rig_find_bus(rig, rigs[i].bus);
            rig_bus_load(rig, (size_t)bus, rig->servo.command_period_ns, &telemetry, &command);
            percent[k] = 100.0 * telemetry / (double)rig->bus[bus].bitrate;
            assert_true(telemetry + command < (double)rig->bus[bus].bitrate);
        }
        assert_true(fabs(percent[1] - percent[0] - rigs[i].percent) < 0.01);
    }
}

/* On classic CAN a command and its answer take 135 bits each. So 3 Damiao drives fit into a
 * millisecond at 1 Mbit/s. For a bus with sensor boards, `check` prints no such number. */
TEST_WITH(a_bus_carries_as_many_axes_as_fit_between_two_commands, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_rig(HIL_SOURCE_DIR "/config/rigs/coman-damiao.yaml");
    const int bus = rig_find_bus(rig, "left_hip"), sensors = rig_find_bus(rig, "sensors");

    for (int ms = 1; ms <= 10; ms++) {
        assert_int_equal(rig_bus_capacity(rig, (size_t)bus, ms * 1000000), ms * 1000 / 270);
    }
    assert_int_equal(rig_bus_capacity(rig, (size_t)sensors, 1000000), 0);
}

TEST_WITH(one_inertial_board_where_the_robot_has_the_sensor, open_rig_tree, close_rig_tree)
{
    assert_buses_refused(
        "  - {name: left, interface: can0, boards: [{kind: inertial, address: 9}]}\n",
        "28:44: found an inertial board, expected none: the robot has no imu");
    assert_buses_refused("  - {name: left, interface: can0,\n"
                         "     boards: [{kind: inertial, address: 9, axes: [hip]}]}\n",
                         "29:15: found key \"axes\" in an inertial board, expected none there");
}

/* ---- rigs that extend others ---- */

TEST_WITH(a_plan_shares_all_but_the_buses_with_the_rig_that_it_extends, open_rig_tree,
          close_rig_tree)
{
    const struct rig *base = load_rig(HIL_SOURCE_DIR "/config/rigs/coman.yaml");
    const struct rig *plan = load_rig(HIL_SOURCE_DIR "/config/rigs/coman-fd.yaml");

    assert_string_equal(plan->name, "coman-fd");
    assert_string_equal(plan->robot->file, base->robot->file);
    assert_int_equal(plan->contact.nsurface, base->contact.nsurface);
    assert_string_equal(plan->pose, base->pose);
    assert_true(plan->servo.command_period_ns == 1000000);
    assert_true(base->servo.command_period_ns == 2000000);
    for (size_t i = 0; i < plan->naxis; i++) {
        assert_true(plan->servo.gains[i].kp_v_per_rad == base->servo.gains[i].kp_v_per_rad);
    }
    assert_int_equal(plan->squat.cycles, base->squat.cycles);
    assert_int_equal(plan->lockstep.bus, rig_find_bus(plan, "left"));
    assert_int_equal(plan->lockstep.step_id, base->lockstep.step_id);
}
