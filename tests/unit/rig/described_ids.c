/* SPDX-License-Identifier: Apache-2.0 */
/* Boards of a described bus whose identifiers meet are refused, at their place in the file. */
#include "tests/unit/rig/rig_bench.h"

#define FT_BOARD                                                                                   \
    "{kind: ft, address: 2, sensor: foot_ft, full_scale_n: [1000, 1000, 1000], "                   \
    "full_scale_nm: [40, 40, 40]}"

static void write_protocol(const char *text)
{
    assert_int_equal(write_file("config/rigs/two.yaml", text, strlen(text)), 0);
}

static void remove_protocol(void)
{
    char path[128];

    snprintf(path, sizeof path, "%s/config/rigs/two.yaml", tree);
    assert_int_equal(unlink(path), 0);
}

/* Host frames at 0x10 and board frames at 0x11, each by address: the command to board 2 has the
 * identifier that board 1 sends. */
static const char apart_by_address[] =
    "name: two\nstates: [{name: idle, law: \"off\"}]\nframes:\n"
    "  - {name: A, from: host, id: 0x10, by: address}\n"
    "  - {name: B, from: board, id: 0x11, by: address, period_s: 0.01}\n";

/* Boards 1 and 3 do not meet. */
TEST_WITH(boards_of_a_bus_do_not_share_identifiers, open_rig_tree, close_rig_tree)
{
    static const char buses[] = "  - {name: left, interface: can0, protocol: two.yaml,\n"
                                "     boards: [{kind: motor, address: 1, axes: [hip]},\n"
                                "     {kind: motor, address: %d, axes: [knee]}]}\n";
    char text[512];

    write_protocol(apart_by_address);
    snprintf(text, sizeof text, buses, 3);
    assert_int_equal(load_buses(text)->boards.nboard, 2);
    snprintf(text, sizeof text, buses, 2);
    assert_buses_refused(
        text, "30:29: found board left/0x02, whose frame A has the identifier 0x12 that frame B of "
              "board left/0x01 (line 29) has too, expected other addresses, or identifiers of "
              "their own in protocol two");
    remove_protocol();
}

TEST_WITH(boards_of_a_second_bus_are_shown_at_their_place, open_rig_tree, close_rig_tree)
{
    write_protocol(apart_by_address);
    assert_buses_refused(
        "  - {name: left, interface: can0, boards: [\n"
        "     " FT_BOARD "]}\n"
        "  - {name: right, interface: can1, protocol: two.yaml,\n"
        "     boards: [{kind: motor, address: 1, axes: [hip]},\n"
        "     {kind: motor, address: 2, axes: [knee]}]}\n",
        "32:29: found board right/0x02, whose frame A has the identifier 0x12 that frame B of "
        "board right/0x01 (line 31) has too, expected other addresses, or identifiers of their "
        "own in protocol two");
    remove_protocol();
}

/* A motor board and a force-torque one send frames of one identifier: whoever hears one knows its
 * sender only if both frames have an address in their data. */
TEST_WITH(one_identifier_does_for_boards_whose_data_has_the_address, open_rig_tree, close_rig_tree)
{
    static const char protocol[] =
        "name: two\nstates: [{name: idle, law: \"off\"}]\nframes:\n"
        "  - {name: A, from: board, of: motor, id: 0x20, period_s: 0.01,\n"
        "     fields: [{name: sender, bits: 8%s}]}\n"
        "  - {name: B, from: board, of: ft, id: 0x20, period_s: 0.01,\n"
        "     fields: [{name: sender, bits: 8%s}]}\n";
    static const char buses[] = "  - {name: left, interface: can0, protocol: two.yaml,\n"
                                "     boards: [{kind: motor, address: 1, axes: [hip]},\n"
                                "     " FT_BOARD "]}\n"
                                "  - {name: right, interface: can1,\n"
                                "     boards: [{kind: motor, address: 5, axes: [knee]}]}\n";
    char text[640];

    for (int has = 0; has < 4; has++) {
        snprintf(text, sizeof text, protocol, has & 1 ? ", source: address" : "",
                 has & 2 ? ", source: address" : "");
        write_protocol(text);
        if (has == 3) {
            assert_int_equal(load_buses(buses)->boards.nboard, 3);
        } else {
            assert_buses_refused(
                buses, "30:26: found board left/0x02, whose frame B has the identifier 0x20 that "
                       "frame A of board left/0x01 (line 29) has too, expected other addresses, or "
                       "identifiers of their own in protocol two");
        }
    }
    remove_protocol();
}
