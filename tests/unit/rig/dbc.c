/* SPDX-License-Identifier: Apache-2.0 */
/* The DBC database of COMAN's left leg: who hears what, and what the bits of a signal are worth. */
#include "rig/dbc.h"

#include "tests/unit/rig/rig_bench.h"

enum { LEFT_LEG = 1, HOST = 0, SIMULATOR = 1, FIRST_BOARD = 2 };

static const struct rig *rig;
static struct dbc *dbc;

FIXTURE(load)
{
    char path[512];
    struct error error;

    snprintf(path, sizeof path, "%s/config/rigs/coman.yaml", HIL_SOURCE_DIR);
    return open_arena(test_state) || rig_load(path, &arena, &rig, &error) ||
           rig_dbc(rig, LEFT_LEG, &arena, &dbc, &error);
}

static const struct dbc_message *message_of(uint32_t id)
{
    for (const struct dbc_message *message = dbc->message; message; message = message->next) {
        if (message->id == id) {
            return message;
        }
    }
    fail_msg("no message 0x%x", id);
    return NULL;
}

static const struct dbc_signal *signal_of(uint32_t id, const char *name)
{
    for (const struct dbc_signal *signal = message_of(id)->signal; signal; signal = signal->next) {
        if (strcmp(signal->name, name) == 0) {
            return signal;
        }
    }
    fail_msg("no signal %s of 0x%x", name, id);
    return NULL;
}

/* The node of the board with an address: its name ends with that. */
static int node_of(unsigned address)
{
    char name[32];

    snprintf(name, sizeof name, "left_leg_0x%02x", address);
    for (size_t i = FIRST_BOARD; i < dbc->nnode; i++) {
        if (strcmp(dbc->node[i].name, name) == 0) {
            return (int)i;
        }
    }
    fail_msg("no node %s", name);
    return -1;
}

/* Identifiers of class 0, 2 and 7 end with the address that they are for, 0xf for all. */
TEST_WITH(whom_an_identifier_names_receives_it, load, close_arena)
{
    const uint64_t boards = ((UINT64_C(1) << dbc->nnode) - 1) & ~UINT64_C(3);
    size_t to_one = 0, to_all = 0, to_host = 0;

    for (const struct dbc_message *message = dbc->message; message; message = message->next) {
        const unsigned class = message->id >> 8, to = message->id & 0xf;

        for (const struct dbc_signal *signal = message->signal; signal; signal = signal->next) {
            if (message->sender >= FIRST_BOARD) {
                assert_int_equal(signal->receivers, 1 << HOST);
                to_host++;
            } else if (message->sender == HOST && (class == 0 || class == 2 || class == 7)) {
                assert_int_equal(signal->receivers,
                                 to == 0xf ? boards : UINT64_C(1) << node_of(to));
                to_one += to != 0xf;
                to_all += to == 0xf;
            }
        }
    }
    assert_true(to_one > 0 && to_all > 0 && to_host > 0);
}

/* A signal of COMAN's knee: ticks of a joint's encoder of 4096 a turn, and of the motor's behind a
 * gear of 100. */
TEST_WITH(ticks_are_told_in_radians_of_the_joint, load, close_arena)
{
    static const struct {
        uint32_t id;
        const char *name;
        unsigned start, bits;
        double scale;
    } cases[] = {{0x121, "LKneeSag_position", 32, 32, 2.0 * M_PI / 4096.0},
                 {0x12a, "LKneeSag_position", 32, 32, 2.0 * M_PI / 409600.0},
                 {0x128, "LKneeSag_position_error", 16, 16, 2.0 * M_PI / 4096.0}};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct dbc_signal *signal = signal_of(cases[i].id, cases[i].name);
        const double half = ldexp(1.0, (int)cases[i].bits - 1), scale = cases[i].scale;

        assert_int_equal(signal->role, DBC_PLAIN);
        assert_int_equal(signal->type, DBC_SIGNED);
        assert_int_equal(signal->start, cases[i].start);
        assert_int_equal(signal->bits, cases[i].bits);
        assert_int_equal(signal->frame_length, 0); /* as long as the message */
        assert_string_equal(signal->unit, "rad");
        assert_string_equal(signal->comment, "LKneeSag");
        assert_true(fabs(signal->scale - scale) < 1e-12 * scale);
        assert_true(fabs(signal->min + half * scale) < 1e-9 * half * scale);
        assert_true(fabs(signal->max - (half - 1.0) * scale) < 1e-9 * half * scale);
    }
}

/* Of 65536 counts the middle one is 0; the ankle's sensor takes 2000 N, a joint's 55 Nm. */
TEST_WITH(channels_have_the_names_of_what_they_measure, load, close_arena)
{
    static const char *const forces[] = {"fx", "fy", "fz"}, *const moments[] = {"mx", "my", "mz"};

    for (int i = 0; i < 3; i++) {
        const struct dbc_signal *force = signal_of(0x3da, forces[i]);
        const struct dbc_signal *moment = signal_of(0x3db, moments[i]);

        assert_string_equal(force->unit, "N");
        assert_string_equal(moment->unit, "Nm");
        assert_string_equal(force->comment, "l_leg_ft");
        assert_string_equal(moment->comment, "l_leg_ft");
        assert_int_equal(force->start, 16 * i);
        assert_int_equal(moment->start, 16 * i);
        assert_true(force->scale == 2000.0 / 32768.0 && force->min == -2000.0);
        assert_true(force->max == 2000.0 * (32767.0 / 32768.0));
    }
    assert_string_equal(signal_of(0x3cb, "LKneeSag_torque")->unit, "Nm");
    assert_string_equal(signal_of(0x3cb, "LKneeSag_torque")->comment, "LKneeSag");
    assert_true(signal_of(0x3cb, "LKneeSag_torque")->min == -55.0);
}

/* Byte 0 of a command selects what follows; SET_CONTROL_MODE's is 9 of 3 bytes. */
TEST_WITH(commands_are_selected_by_their_first_byte, load, close_arena)
{
    const struct dbc_message *command = message_of(0x001);
    size_t selected = 0;

    assert_non_null(command->multiplexor);
    assert_int_equal(command->multiplexor->role, DBC_MULTIPLEXOR);
    for (const struct dbc_signal *signal = command->signal; signal; signal = signal->next) {
        if (signal->role == DBC_MULTIPLEXED) {
            assert_true(signal->start >= 8);
            assert_true(signal->frame_length == 0 || signal->frame_length < command->length);
            selected++;
        }
    }
    assert_true(selected > 20);
}
