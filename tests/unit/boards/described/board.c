/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Boards of the protocols in config/protocols: bytes worked out by hand from the public tables of
 * the actuators (ranges of the file, value = count * (max - min) / (2^bits - 1) + min), laws from
 * the torque that they have to make.
 */
#include "base/array.h"
#include "boards/described/protocol.h"

#include "tests/unit/boards/board_bench.h"

enum { DRIVES = 2 };

#define TORQUE_NM_A 4.1

/* With a counter and a checksum both ways, and a frame for both; what boards send is CAN FD. */
static const char checked[] =
    "name: checked\nstates:\n  - {name: idle, law: \"off\"}\n  - {name: run, value: 1, law: "
    "voltage}\n"
    "frames:\n  - name: SET\n    from: host\n    id: 0x200\n    by: address\n    fields:\n"
    "      - {name: crc, bits: 8, checksum: crc8_sae_j1850}\n"
    "      - {name: alive, bits: 4, counter: true}\n"
    "      - {name: state, bits: 4, target: state}\n"
    "      - {name: voltage, bits: 16, type: signed, target: voltage, scale: 0.01}\n"
    "  - name: ALL\n    from: host\n    id: 0x400\n    by: group\n    repeat: 2\n    fields:\n"
    "      - {name: kind, bits: 8, value: 7}\n"
    "      - {name: state, bits: 8, target: state}\n"
    "      - {name: voltage, bits: 16, type: signed, target: voltage, scale: 0.01}\n"
    "  - name: STATUS\n    from: board\n    id: 0x300\n    by: address\n    fd: true\n"
    "    period_s: 0.001\n    fields:\n      - {name: state, bits: 8, source: state}\n"
    "      - {name: alive, bits: 2, counter: true}\n"
    "      - {name: position, at_bit: 16, bits: 32, type: signed, source: motor_position, scale: "
    "1.0e-5}\n"
    "      - {name: crc, at_bit: 88, bits: 8, checksum: crc8_sae_j1850}\n";

/* Two requests with one answer; the second takes longer. */
static const char timed[] =
    "name: timed\nreply_delay_s: 0.0002\nstates:\n  - {name: idle, law: \"off\"}\nframes:\n"
    "  - {name: ASK, from: host, id: 0x100, by: address, reply: TELL}\n"
    "  - {name: SEEK, from: host, id: 0x200, by: address, reply: TELL, reply_delay_s: 0.0005,\n"
    "     reply_spread_s: 0.0001}\n"
    "  - name: TELL\n    from: board\n    id: 0x300\n    by: address\n    fields:\n"
    "      - {name: state, bits: 8, source: state}\n";

/* The bench of the test that runs */
static struct described_bench {
    struct board_bench base;
    struct boards_bus_config bus[BENCH_BUSES];
    struct arena protocols;
} bench;
static struct board_bench *const base = &bench.base;

static const char odrive[] = HIL_SOURCE_DIR "/config/protocols/odrive.yaml";
static const char watched[] = "odrive.yaml with a watchdog of 10 ms";

/* The text of odrive.yaml with its watchdog on. */
static size_t read_watched(char *text, size_t size)
{
    static const char off[] = "command_timeout_s: 0\n", on[] = "command_timeout_s: 0.01\n";
    FILE *file = fopen(odrive, "r");
    size_t length;
    char *at;

    assert_non_null(file);
    length = fread(text, 1, size - sizeof on, file);
    fclose(file);
    text[length] = '\0';
    at = strstr(text, off);
    assert_non_null(at);
    memmove(at + sizeof on - 1, at + sizeof off - 1, strlen(at + sizeof off - 1) + 1);
    memcpy(at, on, sizeof on - 1);
    return strlen(text);
}

static void read_protocol(const char *file)
{
    static char text[1 << 16];
    const struct described_protocol **protocol = &bench.bus[0].described;
    struct error error;
    enum error_code code;

    assert_ok(arena_init(&bench.protocols, 8u << 20, &error));
    code = strchr(file, '\n') ? described_read_text("checked", file, strlen(file), false,
                                                    &bench.protocols, protocol, &error)
           : file == watched ? described_read_text("watched", text, read_watched(text, sizeof text),
                                                   false, &bench.protocols, protocol, &error)
                             : described_load(file, false, &bench.protocols, protocol, &error);
    assert_no_error(code, error.text);
}

/* Bus 0 with two drives of one axis, addresses 1 and 2, joints 0 and 2. */
static void open_bench(const char *file, int64_t timeout_ns)
{
    bench_stop(base); /* of the previous test */
    arena_fini(&bench.protocols);
    memset(&bench, 0, sizeof bench);
    bench_configure(base);
    bench.bus[0].protocol = &protocol_described;
    bench.bus[0].fd = file == checked;
    read_protocol(file);
    base->config.bus = bench.bus;
    base->config.nboard = DRIVES;
    for (int i = 0; i < DRIVES; i++) {
        base->board[i] = bench_motor(i ? "two" : "one", 0, (uint8_t)(i + 1), 2 * i, -1);
        for (int k = 0; k < BOARD_AXES_MAX; k++) {
            base->board[i].axis[k].joint = k ? -1 : 2 * i;
        }
        base->board[i].command_timeout_ns = timeout_ns;
        base->board[i].reply = (struct board_reply_time){-1, -1}; /* the file's */
        base->board[i].axis[0].winding_ohm = 0.664;
        base->board[i].axis[0].winding_h = 0.4e-3;
        base->board[i].axis[0].bemf_v_s_rad = TORQUE_NM_A;
        base->board[i].axis[0].torque_nm_a = TORQUE_NM_A;
    }
    base->sense[0].qm = base->sense[0].q = 0.5;
    bench_start(base);
    bench_tick(base);
}

/* Sends a frame to the boards. Checks that the next tick sends one frame with this identifier and
 * these bytes. */
static void answers(uint32_t id, const char *bytes, uint32_t answer, const char *told)
{
    bench_say(base, 0, id, bytes);
    bench_expect(base, 0, answer, told);
}

static const char cheetah[] = HIL_SOURCE_DIR "/config/protocols/mini-cheetah.yaml";
static const char robstride[] = HIL_SOURCE_DIR "/config/protocols/robstride.yaml";

/* ---- mini cheetah ---- */

TEST(an_answer_takes_the_time_of_its_request_else_of_its_file)
{
    int64_t delay_ns;

    open_bench(timed, 0);
    for (int i = 0; i < 20; i++) {
        bench_send(base, 0, 0x101, "");
        delay_ns = boards_next_answer(base->boards, 0) - base->now_ns;
        assert_int_equal(delay_ns, 200000);
        bench_tick(base);
        bench_expect(base, 0, 0x301, "00");
        bench_send(base, 0, 0x201, "");
        delay_ns = boards_next_answer(base->boards, 0) - base->now_ns;
        assert_true(delay_ns >= 500000 && delay_ns <= 600000);
        bench_tick(base);
    }
}

TEST(a_cheetah_drive_answers_the_frames_that_switch_it)
{
    open_bench(cheetah, 0);
    assert_false(base->motor[0].bridge_on);
    answers(1, "ff ff ff ff ff ff ff fc", 0, "01 85 1e 80 08 00"); /* 0.5 rad, at rest, no torque */
    assert_true(base->motor[0].bridge_on);
    assert_false(base->motor[2].bridge_on);

    /* Position 0 from here on */
    answers(1, "ff ff ff ff ff ff ff fe", 0, "01 80 00 80 08 00");

    answers(1, "ff ff ff ff ff ff ff fd", 0, "01 80 00 80 08 00");
    assert_false(base->motor[0].bridge_on);
}

/* The law lacks no current if the present current produces the torque of the command. */
TEST(a_cheetah_drive_has_the_impedance_of_its_command)
{
    /* 0.7 rad, 0 rad/s, 100 Nm/rad, 0 Nm s/rad, 5 Nm in counts 34602, 2048, 819, 0, 2116 */
    static const char command[] = "87 2a 80 03 33 00 08 44";
    const double torque = 100.0 * (34602 * 25.0 / 65535 - 12.5 - 0.5) + 2116 * 300.0 / 4095 - 150.0;

    open_bench(cheetah, 0);
    bench_send(base, 0, 1, "ff ff ff ff ff ff ff fc");
    base->sense[0].current_a = torque / TORQUE_NM_A;
    bench_tick(base);
    answers(1, command, 0, "01 85 1e 80 09 55"); /* the torque of the current */
    assert_near(bench_lacking_a(base, 0), 0.0, 1e-6);

    /* Damping brakes a motor that moves: 12.01 Nm s/rad at 1 rad/s in a running mean */
}

/* The law is satisfied by the current that makes its torque: of a spring to 3 rad, beyond the
 * joint's 2.5, in counts 40632 and 82 (10.01 Nm/rad); of a damper of 12.0 Nm s/rad (983) at
 * 13.96 rad/s (3000). */
TEST(a_spring_ignores_the_limits_of_the_joint)
{
    static const struct {
        const char *command;
        double torque_nm;
    } rows[] = {
        {"9e b8 80 00 52 00 08 00", 82 * 500.0 / 4095 * (40632 * 25.0 / 65535 - 13.0) + 0.0366},
        {"85 1e bb 80 00 3d 78 00", 983 * 50.0 / 4095 * (3000 * 60.0 / 4095 - 30.0) + 0.0366},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        open_bench(cheetah, 0);
        bench_stop(base);
        base->board[0].axis[0].current_limit_a = 100.0;
        bench_start(base);
        base->sense[0].current_a = rows[i].torque_nm / TORQUE_NM_A;
        bench_tick(base);
        bench_send(base, 0, 1, "ff ff ff ff ff ff ff fc");
        bench_say(base, 0, 1, rows[i].command);
        assert_near(bench_lacking_a(base, 0), 0.0, 1e-3);
    }
}

/* Counts of the firmware's ranges: 2 A of 4.1 Nm/A in 36 Nm, 24 V in 40. */
TEST(the_present_firmware_tells_its_bus_voltage)
{
    static const char motorcontrol[] = HIL_SOURCE_DIR "/config/protocols/motorcontrol.yaml";

    open_bench(motorcontrol, 0);
    base->sense[0].current_a = 2.0;
    base->sense[0].torque_nm = 3.0; /* what the spring has is not told */
    base->sensors.supply_v = 24.0;
    bench_tick(base);
    answers(1, "ff ff ff ff ff ff ff fd", 0, "01 85 1e 80 0b a4 99");
}

TEST(a_cheetah_drive_brakes_by_its_damping)
{
    /* 0.5 rad, 2048: 0.0073 rad/s, no stiffness, 983: 12.0024 Nm s/rad, 2048: 0.0366 Nm */
    static const char command[] = "85 1e 80 00 00 3d 78 00";

    open_bench(cheetah, 0);
    bench_send(base, 0, 1, "ff ff ff ff ff ff ff fc");
    bench_send(base, 0, 1, command);
    for (int i = 0; i < 40; i++) { /* to 1 rad/s in the mean of encoder steps of 65 ticks a ms */
        base->sense[0].qm += 1e-3;
        base->sense[0].q += 1e-3;
        base->sense[0].current_a =
            (983 * 50.0 / 4095 * (2048 * 60.0 / 4095 - 30.0 - 1.0) + 2048 * 300.0 / 4095 - 150.0) /
            TORQUE_NM_A;
        bench_tick(base);
    }

    /* What is left is the back-EMF of 1 rad/s and what the loop has summed up till the mean was
     * there: the error of the current is 0 from then on */
    {
        double before = base->motor[0].voltage_v;

        base->sense[0].qm += 1e-3;
        base->sense[0].q += 1e-3;
        bench_tick(base);
        assert_near(base->motor[0].voltage_v, before, 1e-3);
    }
}

TEST(a_frame_of_another_length_is_malformed)
{
    open_bench(cheetah, 0);
    bench_send(&bench.base, 0, 1, "ff ff ff ff ff ff fc");
    bench_send(&bench.base, 0, 3, "ff ff ff ff ff ff ff fc"); /* no such drive */
    bench_send(&bench.base, 0, 0, "00");                      /* that of the answers */
    bench_tick(&bench.base);
    assert_int_equal(bench_counters(&bench.base).malformed, 1);
    assert_int_equal(bench_counters(&bench.base).foreign, 2);
    assert_false(bench.base.motor[0].bridge_on);
}

/* ---- ODrive ---- */

TEST(an_odrive_tells_its_state_when_it_changes)
{
    open_bench(odrive, 0);
    bench_send(base, 0, 0x02b, "03 00 00 00 01 00 00 00");
    answers(0x027, "08 00 00 00", 0x021, "00 00 00 00 08 01 00 00"); /* busy */
    assert_int_equal(bench_sent(base, 0, 0x041), 0);
    assert_true(base->motor[0].bridge_on);

    /* A request for an unknown state changes nothing */
    answers(0x027, "0b 00 00 00", 0x021, "00 00 00 00 08 0c 00 00");
    assert_true(base->motor[0].bridge_on);

    /* IDLE by the host is no error */
    answers(0x027, "01 00 00 00", 0x021, "00 00 00 00 01 00 00 00");
    assert_false(base->motor[0].bridge_on);
}

/* ESTOP_REQUESTED is bit 25, and stays through every state until CLEAR_ERRORS. */
TEST(an_odrive_that_was_stopped_arms_when_errors_are_cleared)
{
    open_bench(odrive, 0);
    bench_send(base, 0, 0x027, "08 00 00 00 00 00 00 00"); /* eight bytes, as official clients */
    bench_tick(base);
    assert_true(base->motor[0].bridge_on);
    bench_send(base, 0, 0x022, ""); /* ESTOP */
    bench_tick(base);
    bench_expect(base, 0, 0x021, "00 00 00 02 01 03 00 00"); /* disarmed */
    assert_false(base->motor[0].bridge_on);
    assert_true(boards_fault(base->boards));
    bench_send(base, 0, 0x023, ""); /* empty, from a controller without remote frames */
    bench_tick(base);
    bench_expect(base, 0, 0x023, "00 00 00 02 00 00 00 02");

    bench_say(base, 0, 0x027, "08 00 00 00");
    assert_false(base->motor[0].bridge_on);
    bench_send(base, 0, 0x027, "01 00 00 00");
    bench_say(base, 0, 0x027, "08 00 00 00");
    assert_false(base->motor[0].bridge_on);

    bench_send(base, 0, 0x038, "");
    answers(0x027, "08 00 00 00", 0x021, "00 00 00 00 08 01 00 00");
    assert_true(base->motor[0].bridge_on);
    assert_false(boards_fault(base->boards));

    /* errors that are cleared in closed loop do not end it */
    bench_say(base, 0, 0x038, "00");
    assert_true(base->motor[0].bridge_on);

    /* one that is stopped at rest does not arm either */
    bench_send(base, 0, 0x042, "00");
    answers(0x047, "08 00 00 00", 0x041, "00 00 00 02 01 03 00 00");
    assert_int_equal(bench_counters(base).malformed, 0);
}

/* Asks for a frame and checks it. */
static void ask_odrive(uint32_t id, const char *answer)
{
    const struct bus_frame request = {.id = id, .flags = FRAME_REMOTE};

    boards_receive(base->boards, base->now_ns, 0, &request);
    bench_tick(base);
    bench_expect(base, 0, id, answer);
}

TEST(an_odrive_tells_versions_errors_and_powers)
{
    const struct bus_frame everyone = {.id = 0x7e6, .flags = FRAME_REMOTE};

    open_bench(odrive, 0);
    ask_odrive(0x020, "02 04 04 3a 00 06 0a 00");
    ask_odrive(0x023, "00 00 00 00 00 00 00 00");
    ask_odrive(0x03d, "00 00 00 00 00 00 00 00");
    ask_odrive(0x02e + 6, "00 00 00 00 00 00 00 00"); /* IQ */

    /* both say who they are, by serial numbers of their own */
    boards_receive(base->boards, base->now_ns, 0, &everyone);
    bench_tick(base);
    assert_int_equal(bench_sent(base, 0, 0x026), 1);
    assert_int_equal(bench_sent(base, 0, 0x046), 1);
    assert_int_equal(bench_find(base, 0, 0x026)->data[0], 1);
    assert_int_equal(bench_find(base, 0, 0x046)->data[0], 2);
    assert_memory_not_equal(bench_find(base, 0, 0x026)->data + 1,
                            bench_find(base, 0, 0x046)->data + 1, 4);

    /* 2 A at 5.125 Nm (4.1 Nm/A at the link): 8.2 Nm, of the rotor 0.082 */
    base->sense[0].current_a = 2.0;
    bench_tick(base);
    ask_odrive(0x034, "00 00 00 00 00 00 00 40");
    ask_odrive(0x03c, "00 00 00 00 9e ef a7 3d");
}

/* A new drive sends heartbeat and estimates; one configured for ros_odrive what that waits for. */
TEST(an_odrive_sends_by_itself_what_it_was_configured_for)
{
    static const uint8_t periodic[] = {0x01, 0x09, 0x03, 0x14, 0x15, 0x17, 0x1c};

    for (size_t configured = 0; configured < 2; configured++) {
        size_t sent[0x20] = {0};

        open_bench(odrive, 0);
        bench_stop(base);
        base->board[0].transmit_at_start = configured;
        bench_start(base);
        for (int t = 0; t < 200; t++) {
            bench_tick(base);
            for (size_t i = 0; i < base->count[0]; i++) {
                sent[base->frame[0][i].id & 0x1f] += base->frame[0][i].id >> 5 == 1;
            }
        }
        for (size_t i = 0; i < (configured ? sizeof periodic : 2); i++) {
            assert_true(sent[periodic[i]] >= 2);
            sent[periodic[i]] = 0;
        }
        for (size_t i = 0; i < 0x20; i++) {
            assert_int_equal(sent[i], 0); /* ros_odrive warns of others */
        }
    }
}

/* Results of ODrive.ProcedureResult, told in a heartbeat. A calibration is busy, then done. */
TEST(an_odrive_answers_requests_for_any_state_with_a_result)
{
    static const struct {
        const char *request, *told, *later;
    } cases[] = {
        {"0b 00 00 00", "00 00 00 00 01 0c 00 00", NULL}, /* homing without an end stop */
        {"05 00 00 00", "00 00 00 00 01 0d 00 00", NULL}, /* no such state */
        {"ff ff ff ff", "00 00 00 00 01 0d 00 00", NULL},
        {"03 00 00 00", "00 00 00 00 03 01 00 00", "00 00 00 00 01 00 00 00"},
        {"04 00 00 00", "00 00 00 00 04 01 00 00", "00 00 00 00 01 00 00 00"},
        {"07 00 00 00", "00 00 00 00 07 01 00 00", "00 00 00 00 01 00 00 00"},
        {"01 00 00 00", "00 00 00 00 01 00 00 00", NULL},
        {"08 00 00 00", "00 00 00 00 08 01 00 00", NULL},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        const struct bus_frame request = {.id = 0x021, .flags = FRAME_REMOTE};

        open_bench(odrive, 0);
        bench_send(base, 0, 0x027, cases[i].request);
        bench_ticks(base, 2);
        boards_receive(base->boards, base->now_ns, 0, &request);
        bench_tick(base);
        bench_expect(base, 0, 0x021, cases[i].told);
        assert_int_equal(base->motor[0].bridge_on, cases[i].request[1] == '8');
        bench_ticks(base, 600);
        boards_receive(base->boards, base->now_ns, 0, &request);
        bench_tick(base);
        bench_expect(base, 0, 0x021, cases[i].later ? cases[i].later : cases[i].told);
        assert_int_equal(bench_counters(base).malformed, 0);
    }
}

/* An ODrive without limit reports infinity, a drive without thermal model 25 degrees C. */
TEST(defaults_in_replies_are_those_of_a_drive)
{
    open_bench(odrive, 0);
    base->sense[0].winding_c = PLANT_AMBIENT_C;
    bench_tick(base);
    ask_odrive(0x035, "00 00 c8 41 00 00 c8 41");                    /* bridge and winding */
    answers(0x024, "00 84 01 00", 0x025, "00 84 01 00 00 00 80 7f"); /* vel_limit */
    bench_send(base, 0, 0x02f, "00 00 80 3f 00 00 48 41"); /* 12.5 A, above the drive's 12 A */
    answers(0x024, "00 0f 01 00", 0x025, "00 0f 01 00 00 00 48 41"); /* current_soft_max */
    base->sense[0].winding_c = 61.0;
    bench_tick(base);
    ask_odrive(0x035, "00 00 c8 41 00 00 74 42");
}

/* Endpoint 384 is pos_gain, 1 vbus_voltage. */
TEST(an_odrive_has_endpoints)
{
    open_bench(odrive, 0);
    answers(0x024, "00 01 00 00", 0x025, "00 01 00 00 00 00 40 42");
    answers(0x024, "00 80 01 00 00 00 00 00", 0x025, "00 80 01 00 00 00 a0 41"); /* 20 */
    bench_send(base, 0, 0x024, "01 80 01 00 00 00 20 41"); /* 10; a write is not answered */
    bench_tick(base);
    assert_int_equal(bench_sent(base, 0, 0x025), 0);
    bench_send(base, 0, 0x024, "01 80 01 00 00 00 80 7f"); /* infinity: not taken */
    answers(0x024, "00 80 01 00", 0x025, "00 80 01 00 00 00 20 41");
    bench_send(base, 0, 0x03a, "00 00 a0 40 00 00 00 00"); /* Set_Pos_Gain 5, of eight bytes */
    answers(0x024, "00 80 01 00", 0x025, "00 80 01 00 00 00 a0 40");

    /* An unknown endpoint, and a read-only endpoint */
    bench_send(base, 0, 0x024, "00 ff ff 00");
    bench_say(base, 0, 0x024, "01 01 00 00 00 00 00 00");
    assert_int_equal(bench_sent(base, 0, 0x025), 0);
    assert_int_equal(bench_counters(base).malformed, 2);

    /* REBOOT restores the value */
    bench_send(base, 0, 0x036, "00");
    bench_ticks(base, 3);
    answers(0x024, "00 80 01 00", 0x025, "00 80 01 00 00 00 a0 41");
}

TEST(an_odrive_heeds_limits_and_where_it_is_said_to_be)
{
    open_bench(odrive, 0);
    bench_send(base, 0, 0x02f, "00 00 80 3f 00 00 00 3f"); /* 1 turn/s, 0.5 A */
    bench_send(base, 0, 0x031, "00 00 80 3f 00 00 00 00"); /* of trajectories: taken */
    bench_send(base, 0, 0x032, "00 00 80 3f 00 00 80 3f");
    bench_send(base, 0, 0x033, "00 00 80 3f");
    bench_send(base, 0, 0x02b, "01 00 00 00 01 00 00 00");
    bench_send(base, 0, 0x027, "08 00 00 00");
    bench_send(base, 0, 0x02e, "00 00 80 3f 00 00 00 00"); /* 1 Nm of the rotor: 24 A */
    bench_tick(base);
    ask_odrive(0x034, "00 00 00 3f 00 00 00 00"); /* target 0.5 A */

    bench_send(base, 0, 0x039, "00 00 20 41"); /* it is at 10 turns */
    bench_ticks(base, 2);
    ask_odrive(0x029, "00 00 20 41 00 00 00 00");
    assert_int_equal(bench_counters(base).malformed, 0);
}

TEST(an_odrive_answers_remote_frames)
{
    struct bus_frame request = {.id = 0x037, .len = 8, .flags = FRAME_REMOTE};

    open_bench(odrive, 0);
    boards_receive(base->boards, base->now_ns, 0, &request);
    bench_tick(base);
    bench_expect(base, 0, 0x037, "00 00 40 42 00 00 00 00"); /* 48 V */
    bench_ticks(base, 9);
    bench_expect(base, 0, 0x029, "dd a5 fe 40 00 00 00 00"); /* 7.957747 turns */
}

TEST(an_odrive_holds_its_position_in_counts_of_turns)
{
    open_bench(odrive, 0);
    bench_send(base, 0, 0x02b, "03 00 00 00 01 00 00 00");
    bench_send(base, 0, 0x027, "08 00 00 00");
    bench_send(base, 0, 0x02c, "dd a5 fe 40 00 00 00 00"); /* where it is */
    bench_ticks(base, 3);
    assert_near(bench_lacking_a(base, 0), 0.0, 1e-3);
    bench_send(base, 0, 0x02c, "00 00 00 41 00 00 00 00"); /* 8 turns: 0.50265 rad */
    bench_ticks(base, 3);
    assert_true(bench_lacking_a(base, 0) > 0.01);
}

TEST(a_watchdog_disarms_until_errors_are_cleared)
{
    open_bench(odrive, 10000000); /* what the rig says is nothing to the file's 0 */
    bench_send(base, 0, 0x027, "08 00 00 00");
    bench_ticks(base, 20);
    assert_true(base->motor[0].bridge_on);

    open_bench(watched, 0);
    bench_send(base, 0, 0x027, "08 00 00 00");
    bench_ticks(base, 9);
    assert_true(base->motor[0].bridge_on);
    bench_ticks(base, 4);
    assert_false(base->motor[0].bridge_on);
    assert_int_equal(bench_counters(base).timeouts, 1);
    bench_say(base, 0, 0x027, "08 00 00 00");
    assert_false(base->motor[0].bridge_on);

    /* The heartbeat has said so, until CLEAR_ERRORS */
    answers(0x038, "00", 0x021, "00 00 00 00 01 00 00 00");
    bench_say(base, 0, 0x027, "08 00 00 00");
    assert_true(base->motor[0].bridge_on);
}

TEST(a_fault_opens_the_bridge_and_its_bit_is_told)
{
    open_bench(odrive, 0);
    bench_say(base, 0, 0x027, "08 00 00 00");
    base->sensors.supply_v = 20.0;
    bench_ticks(base, 2);
    assert_false(base->motor[0].bridge_on);
    assert_true(boards_fault(base->boards));
    base->sensors.supply_v = SUPPLY_V;
    bench_send(base, 0, 0x038, "00");
    bench_ticks(base, 3);
    assert_false(boards_fault(base->boards));
}

/* ---- servo valves ---- */

TEST(a_valve_tells_its_pressures_and_takes_speeds_as_voltages)
{
    static const char valves[] = HIL_SOURCE_DIR "/config/protocols/servo-valve.yaml";

    open_bench(valves, 0);
    bench_stop(base);
    base->board[0].axis[0].valve = true;
    base->board[0].axis[0].bemf_v_s_rad = 0.36;
    base->board[0].transmit_at_start = true;
    base->sense[0].pressure_pa[0] = 60.0e5;
    base->sense[0].pressure_pa[1] = 160.0e5;
    base->sense[0].torque_nm = -10.0;
    bench_start(base);
    bench_tick(base);
    /* from the lowest bit on: 50000 in 20, -200 in 14, 1200 in 13, 3200 in 13 bits, a count */
    {
        const struct bus_frame *frame = bench_find(base, 0, 0x100);
        const uint64_t want =
            UINT64_C(50000) | UINT64_C(0x3f38) << 20 | UINT64_C(1200) << 34 | UINT64_C(3200) << 47;
        uint64_t found = 0;

        assert_non_null(frame);
        for (int i = 0; i < 8; i++) {
            found |= (uint64_t)frame->data[i] << 8 * i;
        }
        assert_int_equal(found & (UINT64_MAX >> 4), want);
    }

    /* 0.1 rad ahead at 12/s and 0.36 V s/rad */
    bench_send(base, 0, 0x020, "02 01 00 00 00");
    bench_say(base, 0, 0x040, "70 17");
    assert_true(base->motor[0].bridge_on);
    assert_near(base->motor[0].voltage_v, 12.0 * 0.1 * 0.36, 1e-4);
}

/* A supply below half or above 1.25 times the nominal pressure closes the valves of the axes that
 * have one; each has its bit. */
TEST(a_lost_oil_pressure_closes_the_valve)
{
    static const char valves[] = HIL_SOURCE_DIR "/config/protocols/servo-valve.yaml";
    static const struct {
        double pa;
        unsigned bit;
    } wrong[] = {{79.9e5, 7}, {200.1e5, 8}, {NAN, 7}};

    open_bench(valves, 0);
    bench_stop(base);
    base->board[0].axis[0].valve = true;
    base->board[0].under_pressure_pa = 80e5;
    base->board[0].over_pressure_pa = 200e5;
    bench_start(base);
    base->sensors.oil_pa = 80.1e5;
    bench_tick(base);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const struct bus_frame *frame = NULL;

        bench_send(base, 0, 0x020, "01 01 00 00 00");
        bench_send(base, 0, 0x040, "64 00");
        bench_ticks(base, 2);
        assert_true(base->motor[0].bridge_on);
        base->sensors.oil_pa = wrong[i].pa;
        for (int ms = 0; ms < 5 && !frame; ms++) {
            bench_tick(base);
            frame = bench_find(base, 0, 0x200);
            frame = frame && frame->data[0] % 8 == 7 ? frame : NULL;
        }
        assert_non_null(frame);
        assert_false(base->motor[0].bridge_on);
        assert_int_equal((frame->data[1] | frame->data[2] << 8) & 0x1ff, 1u << wrong[i].bit);

        /* off clears it once the pressure is back */
        base->sensors.oil_pa = 199.9e5;
        bench_send(base, 0, 0x020, "00 01 00 00 00");
        bench_ticks(base, 2);
        assert_false(boards_fault(base->boards));
    }

    /* the axis beside it is a motor's */
    bench_send(base, 0, 0x020, "01 02 00 00 00");
    base->sensors.oil_pa = 0.0;
    bench_ticks(base, 2);
    assert_true(base->motor[2].bridge_on);
}

TEST(a_valve_refuses_laws_of_current)
{
    static const char compact[] = HIL_SOURCE_DIR "/config/protocols/compact.yaml";

    open_bench(compact, 0);
    bench_stop(base);
    base->board[0].axis[0].valve = true;
    bench_start(base);
    bench_tick(base);
    bench_say(base, 0, 0x020, "02 03 00 00 00");
    assert_false(base->motor[0].bridge_on);
    assert_true(base->motor[2].bridge_on);
    assert_int_equal(bench_counters(base).malformed, 1);
    bench_say(base, 0, 0x020, "01 03 00 00 00");
    assert_true(base->motor[0].bridge_on);
    assert_int_equal(bench_counters(base).malformed, 1);
}

/* ---- RobStride: fields in identifiers of 29 bits ---- */

static void send_extended(uint32_t id, const char *hex)
{
    struct bus_frame frame = {.id = id, .flags = FRAME_EXTENDED};

    frame.len = bench_bytes(hex, frame.data);
    boards_receive(bench.base.boards, bench.base.now_ns, 0, &frame);
}

/* The first frame of the last tick has this identifier and format. */
static void expect_as(uint32_t id, uint8_t flags, const char *hex)
{
    struct bus_frame frame = bench.base.frame[0][0];

    assert_true(bench.base.count[0] > 0);
    assert_int_equal(frame.flags, flags);
    frame.flags = 0;
    bench_expect_frame(&frame, id, hex);
}

/* A stop and its answer as recorded from a drive with the number 10: at 3.8122 rad, 32 degree C and
 * next to no torque; but for its speed, which turned slowly and here stands still. */
TEST(a_robstride_drive_answers_as_one_that_was_recorded)
{
    open_bench(robstride, 0);
    bench_stop(base);
    base->board[0].address = 10;
    base->sense[0].qm = base->sense[0].q = 3.812192;
    base->sense[0].torque_nm = -0.0018;
    base->sense[0].winding_c = 32.0;
    bench_start(base);
    bench_ticks(base, 2);
    send_extended(0x0400fd0a, "00 00 00 00 00 00 00 00");
    bench_tick(base);
    assert_int_equal(base->count[0], 1);
    expect_as(0x02000afd, FRAME_EXTENDED, "a6 d4 80 00 7f ff 01 40");

    /* The same number with 11 bits is nobody's */
    bench_send(base, 0, 0x10a, "00 00 00 00 00 00 00 00");
    assert_int_equal(bench_counters(base).foreign, 1);
}

/* A host other than RobStride's gets its answers, and values by their number. A number that no
 * drive has gives a value of zero, with a 1 above the drive's number. */
TEST(a_robstride_drive_answers_the_host_that_asks)
{
    static const struct {
        uint32_t id, answer;
        const char *data, *told;
    } cases[] = {
        {0x0300aa01, 0x028001aa, "00 00 00 00 00 00 00 00", "8a 2f 80 00 80 00 00 00"},
        {0x1100aa01, 0x110001aa, "19 70 00 00 00 00 00 00", "19 70 00 00 00 00 00 3f"},
        {0x1100fd01, 0x110001fd, "1c 70 00 00 00 00 00 00", "1c 70 00 00 00 00 40 42"},
        {0x1100fd01, 0x110101fd, "03 10 00 00 00 00 00 00", "03 10 00 00 00 00 00 00"},
    };

    open_bench(robstride, 0);
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        send_extended(cases[i].id, cases[i].data);
        bench_tick(base);
        if (i > 0) {
            expect_as(cases[i].answer, FRAME_EXTENDED, cases[i].told);
        }
        assert_int_equal(base->frame[0][0].id, cases[i].answer);
    }
    assert_int_equal(bench_counters(base).malformed + bench_counters(base).foreign, 0);
}

/* 0.7 rad, 0 rad/s, 100 Nm/rad, 0 Nm s/rad in the data, 5 Nm in the identifier: counts 34593,
 * 32768, 1311, 0 and 34133 of 65535, worked out by the ranges of the manual. */
TEST(a_robstride_drive_takes_its_torque_from_the_identifier)
{
    const double pi = 3.14159265358979324;
    const double torque = 1311 * 5000.0 / 65535 * (34593 * 8 * pi / 65535 - 4 * pi - 0.5) +
                          34133 * 240.0 / 65535 - 120.0;

    open_bench(robstride, 0);
    send_extended(0x0300fd01, "00 00 00 00 00 00 00 00");
    base->sense[0].current_a = torque / TORQUE_NM_A;
    bench_tick(base);
    expect_as(0x028001fd, FRAME_EXTENDED, "85 17 80 00 80 00 00 00");
    assert_true(base->motor[0].bridge_on);
    assert_false(base->motor[2].bridge_on);
    send_extended(0x01855501, "87 21 80 00 05 1f 00 00");
    bench_tick(base);
    assert_near(bench_lacking_a(base, 0), 0.0, 1e-2);

    /* A lost supply opens the bridge; bit 16 of the identifier tells it */
    base->sensors.supply_v = 10.0;
    bench_ticks(base, 2);
    send_extended(0x01800001, "85 17 80 00 00 00 00 00");
    bench_tick(base);
    expect_as(0x020101fd, FRAME_EXTENDED, "85 17 80 00 80 00 00 00");
    assert_false(base->motor[0].bridge_on);
}
/* ---- drives whose registers a host writes ---- */

static const char damiao[] = HIL_SOURCE_DIR "/config/protocols/damiao.yaml";

/* A frame to drive 1 and its answer; NULL = no answer, and the frame is malformed. id 0: `answer`
 * ticks pass, from now on at a supply of `data` volts. */
struct exchange {
    uint32_t id, answer;
    const char *data, *told;
};

static void play(const char *file, const struct exchange *exchange, size_t count)
{
    open_bench(file, 0);
    base->sense[0].winding_c = PLANT_AMBIENT_C;
    bench_tick(base);
    for (size_t i = 0; i < count; i++) {
        const struct exchange *e = &exchange[i];
        const uint64_t malformed = bench_counters(base).malformed;

        if (e->id == 0) {
            base->sensors.supply_v = atof(e->data);
            bench_ticks(base, (int)e->answer);
            continue;
        }
        if (e->id > DESCRIBED_STANDARD_ID_MAX) {
            send_extended(e->id, e->data);
        } else {
            bench_send(base, 0, e->id, e->data);
        }
        bench_tick(base);
        if (bench_counters(base).malformed != malformed + !e->told ||
            base->count[0] != (e->told != NULL)) {
            fprintf(stderr, "exchange %zu\n", i);
        }
        assert_int_equal(bench_counters(base).malformed, malformed + !e->told);
        assert_int_equal(base->count[0], e->told != NULL);
        if (e->told) {
            expect_as(e->answer, e->answer > DESCRIBED_STANDARD_ID_MAX ? FRAME_EXTENDED : 0,
                      e->told);
        }
    }
    assert_int_equal(bench_counters(base).foreign, 0);
}

/* Recorded from a drive at rest near its zero, 25 degree C at the bridges and 21 at the rotor. */
TEST(a_damiao_drive_answers_as_one_that_was_recorded)
{
    open_bench(damiao, 0);
    bench_stop(base);
    base->sense[0].qm = base->sense[0].q = -0.004387;
    base->sense[0].winding_c = 21.0;
    bench_start(base);
    bench_ticks(base, 2);
    answers(0x001, "ff ff ff ff ff ff ff fc", 0x011, "11 7f f4 80 08 00 19 15");
}

/* All drives hear identifier 0x7ff. An unknown register is malformed for the addressed drive. */
TEST(an_unknown_register_of_another_drive_is_foreign)
{
    open_bench(damiao, 0);
    bench_tick(base);
    bench_say(base, 0, 0x7ff, "09 00 33 c8 00 00 00 00");
    assert_int_equal(bench_counters(base).malformed, 0);
    assert_int_equal(bench_counters(base).foreign, 1);
    bench_say(base, 0, 0x7ff, "01 00 33 c8 00 00 00 00");
    assert_int_equal(bench_counters(base).malformed, 1);
}

/* At 0.5 rad, count 34078 of 65535 over 25 rad; over 50 rad 33423. Floats by IEEE 754. */
TEST(a_damiao_drive_has_its_registers)
{
    static const char at_rest[] = "01 85 1e 80 08 00 19 19";
    static const struct exchange exchange[] = {
        {0x7ff, 0x011, "01 00 cc 00 00 00 00 00", at_rest},
        {0x7ff, 0x011, "01 00 33 15 00 00 00 00", "01 00 33 15 00 00 48 41"}, /* PMAX 12.5 */
        {0x7ff, 0x011, "01 00 33 0a 00 00 00 00", "01 00 33 0a 01 00 00 00"}, /* MIT */
        {0x7ff, 0x011, "01 00 33 07 00 00 00 00", "01 00 33 07 11 00 00 00"}, /* MST_ID */
        {0x7ff, 0x011, "01 00 33 08 00 00 00 00", "01 00 33 08 01 00 00 00"}, /* ESC_ID */
        {0x7ff, 0x011, "01 00 33 3c 00 00 00 00", "01 00 33 3c 00 00 40 42"}, /* 48 V */
        /* unknown, read only, no mode, no range, no number */
        {0x7ff, 0, "01 00 33 c8 00 00 00 00", NULL},
        {0x7ff, 0, "01 00 55 0e 01 00 00 00", NULL},
        {0x7ff, 0, "01 00 55 0a 05 00 00 00", NULL},
        {0x7ff, 0, "01 00 55 15 00 00 00 00", NULL},
        {0x7ff, 0, "01 00 55 15 00 00 c0 7f", NULL},
        {0x7ff, 0, "01 00 55 07 00 08 00 00", NULL},
        /* a wider range */
        {0x7ff, 0x011, "01 00 55 15 00 00 c8 41", "01 00 55 15 00 00 c8 41"},
        {0x7ff, 0x011, "01 00 cc 00 00 00 00 00", "01 82 8f 80 08 00 19 19"},
        {0x7ff, 0x011, "01 00 55 15 00 00 48 41", "01 00 55 15 00 00 48 41"},
        /* answers by another identifier, then a drive of another number */
        {0x7ff, 0x022, "01 00 55 07 22 00 00 00", "01 00 55 07 22 00 00 00"},
        {0x7ff, 0x022, "01 00 cc 00 00 00 00 00", at_rest},
        {0x7ff, 0x022, "01 00 aa 01 00 00 00 00", "01 00 aa 01 00 00 00 00"},
        {0x7ff, 0x022, "01 00 55 08 13 00 00 00", "13 00 55 08 13 00 00 00"},
        {0x013, 0x022, "ff ff ff ff ff ff ff fc", "13 85 1e 80 08 00 19 19"},
    };

    play(damiao, exchange, ARRAY_COUNT(exchange));
}

/* Values by name, by which a command is scaled; a saved one and one that is not; a bit that stays,
 * and one that goes; a count that wraps. */
TEST(the_words_for_registers_work_alone)
{
    static const char text[] =
        "name: checked\nstates:\n  - {name: idle, law: \"off\"}\n"
        "  - {name: run, value: 1, law: selected}\n"
        "  - {name: low, value: 7, law: fault, fault: under_voltage}\n"
        "laws: [{name: v, value: 3, law: voltage}, {name: w, value: 4, law: current}]\n"
        "faults: {under_voltage: {bit: 0, sticky: true}, over_voltage: {bit: 1, momentary: true}}\n"
        "models: [{name: m, values: {F: 2}}]\n"
        "parameters:\n  - {number: 5, writable: true, field: {name: F, bits: 16, value: 1}}\n"
        "  - {number: 6, writable: true, field: {name: L, bits: 8, source: law}}\n"
        "  - {number: 7, field: {name: V, bits: 32, type: float, target: voltage, times: F}}\n"
        "  - {number: 8, field: {name: C, bits: 32, type: float, value: 12.5}}\n"
        "frames:\n"
        "  - {name: ON, from: host, id: 0x10, by: address, payload: \"01\", enter: run, select: v, "
        "reply: S}\n"
        "  - {name: SAVE, from: host, id: 0x10, by: address, payload: \"02\", save: true, reply: "
        "S}\n"
        "  - {name: RESET, from: host, id: 0x10, by: address, payload: \"03\", restart: true, "
        "reply: S}\n"
        "  - {name: CLEAR, from: host, id: 0x10, by: address, payload: \"04\", clear_faults: true, "
        "reply: S}\n"
        "  - {name: R, from: host, id: 0x20, by: address, reply: A, fields: [{name: n, bits: 8, "
        "target: parameter}]}\n"
        "  - {name: W, from: host, id: 0x20, by: address, reply: A, fields: [{name: n, bits: 8, "
        "target: parameter}, {name: x, bits: 32, target: parameter_value}]}\n"
        "  - {name: A, from: board, id: 0x30, by: address, fields: [{name: n, bits: 8, source: "
        "echo}, {name: x, bits: 32, source: parameter_value}]}\n"
        "  - {name: S, from: board, id: 0x40, by: address, fields: [{name: s, bits: 8, source: "
        "state}, {name: f, bits: 8, source: faults}, {name: l, bits: 8, source: law}, {name: p, "
        "bits: 4, source: motor_position, scale: 0.01, wraps: true}, {name: u, bits: 1, fault: "
        "under_voltage}, {name: a, at_bit: 30, bits: 1, source: address, wraps: true}]}\n";
    static const struct exchange exchange[] = {
        {0x021, 0x031, "08", "08 00 00 48 41"},
        {0x021, 0x031, "05", "05 02 00 00 00"},
        {0x011, 0x041, "01", "01 00 03 42"},
        {0x021, 0x031, "07 00 00 40 40", "07 00 00 40 40"},
        {0x021, 0x031, "05 09 00 00 00", "05 09 00 00 00"},
        {0x011, 0x041, "02", "01 00 03 42"},
        {0x021, 0x031, "05 03 00 00 00", "05 03 00 00 00"},
        {0x021, 0x031, "06 04 00 00 00", "06 04 00 00 00"},
        {0x021, 0, "06 05 00 00 00", NULL},
        {0, 2, "20", NULL},
        {0x011, 0x041, "01", "07 01 03 52"}, /* the fault has a state and a bit of its own */
        {0, 2, "48", NULL},
        {0x011, 0x041, "01", "07 01 03 52"}, /* sticky */
        {0x011, 0x041, "04", "00 00 03 42"},
        {0x011, 0x041, "01", "01 00 03 42"},
        {0, 2, "70", NULL},
        {0x011, 0x041, "01", "07 02 03 42"},
        {0, 2, "48", NULL},
        {0x011, 0x041, "01", "07 00 03 42"}, /* momentary: only the state remains */
        {0x011, 0x041, "04", "00 00 03 42"},
        {0x021, 0x031, "05", "05 03 00 00 00"},
        {0x021, 0x031, "06 04 00 00 00", "06 04 00 00 00"},
        {0x011, 0x041, "03", "00 00 04 42"}, /* restarts with what was saved */
        {0, 60, "48", NULL},
        {0x021, 0x031, "05", "05 09 00 00 00"},
        {0x021, 0x031, "06", "06 03 00 00 00"},
    };

    play(text, exchange, ARRAY_COUNT(exchange));
}

/* LK-TECH's motors answer 0x140 + number with the same identifier: 0x9c with 25 degree C, a command
 * that only switches with its first byte. */
TEST(a_drive_answers_with_the_identifier_of_its_request)
{
    static const char text[] =
        "name: lk\nstates: [{name: idle, law: \"off\"}, {name: run, value: 1, law: voltage}]\n"
        "frames:\n"
        "  - {name: ON, from: host, id: 0x140, by: address, enter: run, reply: ECHO, length: 8, "
        "fields: [{name: command, bits: 8, value: 0x88}]}\n"
        "  - {name: STATE, from: host, id: 0x140, by: address, reply: STATUS, length: 8, "
        "fields: [{name: command, bits: 8, value: 0x9c}]}\n"
        "  - {name: STATUS, from: board, id: 0x140, by: address, length: 8, fields: [{name: "
        "command, bits: 8, value: 0x9c}, {name: t, bits: 8, source: temperature}]}\n"
        "  - {name: ECHO, from: board, id: 0x140, by: address, length: 8, fields: [{name: "
        "command, bits: 8, source: echo}]}\n";
    static const struct exchange exchange[] = {
        {0x141, 0x141, "9c 00 00 00 00 00 00 00", "9c 19 00 00 00 00 00 00"},
        {0x141, 0x141, "88 00 00 00 00 00 00 00", "88 00 00 00 00 00 00 00"},
    };

    play(text, exchange, ARRAY_COUNT(exchange));
}

/* A drive whose firmware has another constant than its motor reports another torque: 2 A at
 * 4.1 Nm/A are 8.2 Nm, told as 0.5 x 8.2 + 1 = 5.1 Nm, count 2208 of 4095 over 130 Nm. It takes
 * 4.1 Nm, count 2177, as 8.2 Nm too. */
TEST(a_drive_reports_and_takes_torques_by_the_gains_of_the_rig)
{
    open_bench(HIL_SOURCE_DIR "/config/protocols/cubemars-mit.yaml", 0);
    bench_stop(base);
    base->board[0].axis[0].torque_gain = 0.5;
    base->board[0].axis[0].torque_offset_nm = 1.0;
    bench_start(base);
    base->sense[0].current_a = 2.0;
    base->sense[0].winding_c = PLANT_AMBIENT_C;
    bench_ticks(base, 2);
    answers(1, "ff ff ff ff ff ff ff fd", 0, "01 85 1e 80 08 a0 19 00");
    bench_say(base, 0, 1, "ff ff ff ff ff ff ff fc");
    bench_say(base, 0, 1, "80 00 80 00 00 00 08 81");
    assert_near(bench_lacking_a(base, 0), 0.0, 0.02);
}

/* The velocity loop's integral stops at the current limit. torque_gain does not move this limit. */
TEST(the_integral_of_a_velocity_loop_reaches_the_current_limit)
{
    static const double gains[] = {0.0, 0.5, 2.0};

    for (size_t i = 0; i < ARRAY_COUNT(gains); i++) {
        const struct current_law *law;

        open_bench(odrive, 0);
        bench_stop(base);
        base->board[0].axis[0].torque_gain = gains[i];
        bench_start(base);
        bench_tick(base);
        bench_send(base, 0, 0x2b, "02 00 00 00 01 00 00 00"); /* velocity control, without an input
                                                               * filter */
        bench_send(base, 0, 0x3b, "00 00 00 00 00 00 00 3f"); /* an integral gain alone */
        bench_send(base, 0, 0x27, "08 00 00 00");
        bench_tick(base);
        bench_send(base, 0, 0x2d, "00 00 80 3f 00 00 00 00"); /* a turn a second */
        bench_ticks(base, 5000);
        law = &base->command.motor[0].law;
        assert_true(law->on && law->damping_a_s_rad == 0.0);
        assert_near(law->current_a, base->board[0].axis[0].current_limit_a, 1e-9);
    }
}

/* Commands of another mode are refused by name; 10 ms of silence are 200 of register 9. */
TEST(a_damiao_drive_obeys_its_mode_and_tells_its_faults)
{
    static const struct exchange exchange[] = {
        {0x001, 0x011, "ff ff ff ff ff ff ff fc", "11 85 1e 80 08 00 19 19"},
        {0x101, 0, "00 00 00 3f 00 00 80 3f", NULL},
        {0x7ff, 0x011, "01 00 55 0a 02 00 00 00", "01 00 55 0a 02 00 00 00"},
        {0x001, 0, "85 1e 7f f0 00 00 07 ff", NULL},
        {0x101, 0x011, "00 00 00 3f 00 00 80 3f", "11 85 1e 80 08 00 19 19"},
        {0x7ff, 0x011, "01 00 55 0a 03 00 00 00", "01 00 55 0a 03 00 00 00"},
        {0x201, 0x011, "00 00 00 00", "11 85 1e 80 08 00 19 19"},
        {0x7ff, 0x011, "01 00 55 0a 04 00 00 00", "01 00 55 0a 04 00 00 00"},
        {0x301, 0x011, "00 00 00 3f 64 00 10 27", "11 85 1e 80 08 00 19 19"},
        {0x7ff, 0x011, "01 00 55 09 c8 00 00 00", "01 00 55 09 c8 00 00 00"},
        {0, 5, "48", NULL},
        {0x7ff, 0x011, "01 00 cc 00 00 00 00 00", "11 85 1e 80 08 00 19 19"},
        {0, 8, "48", NULL},
        {0x7ff, 0x011, "01 00 cc 00 00 00 00 00", "d1 85 1e 80 08 00 19 19"},
        {0x001, 0x011, "ff ff ff ff ff ff ff fc", "d1 85 1e 80 08 00 19 19"},
        {0x001, 0x011, "ff ff ff ff ff ff ff fb", "01 85 1e 80 08 00 19 19"},
        {0x001, 0x011, "ff ff ff ff ff ff ff fc", "11 85 1e 80 08 00 19 19"},
        {0, 2, "20", NULL},
        {0x7ff, 0x011, "01 00 cc 00 00 00 00 00", "91 85 1e 80 08 00 19 19"},
        {0x001, 0x011, "ff ff ff ff ff ff ff fb", "91 85 1e 80 08 00 19 19"}, /* it is still low */
        {0, 2, "70", NULL},
        {0x7ff, 0x011, "01 00 cc 00 00 00 00 00", "81 85 1e 80 08 00 19 19"},
        {0, 2, "48", NULL},
        {0x001, 0x011, "ff ff ff ff ff ff ff fb", "01 85 1e 80 08 00 19 19"},
    };

    play(damiao, exchange, ARRAY_COUNT(exchange));
}

/* ---- faults as each maker tells them ---- */

enum cause { LOW_SUPPLY, HIGH_SUPPLY, HIGH_CURRENT, HOT_WINDING, NO_ENCODER, SILENCE };

/* A drive that was switched on meets a cause. Its bridge opens, and a question, or the tick itself
 * (ask NULL), gives this answer. */
struct fault_row {
    const char *file;
    enum cause cause;
    uint32_t on_id;
    const char *on;
    uint32_t ask_id;
    const char *ask;
    uint32_t id;
    const char *told;
};

/* Error words: myactuator_rmd's error_code.hpp (0x4 low voltage, 0x8 high voltage, 0x10 current,
 * 0x1000 temperature, 0x2000 encoder), ODrive's enumeration Error (0x200, 0x100, 0x1000, 0x2000,
 * 0x1000000). VESC has no error in its status frames: speed, current and duty become 0. */
TEST(a_fault_is_told_as_the_makers_drive_tells_it)
{
#define RMD HIL_SOURCE_DIR "/config/protocols/myactuator-rmd.yaml"
#define RMD_ON 0x141, "a2 00 00 00 00 00 00 00"
#define RMD_ASK 0x141, "9a 00 00 00 00 00 00 00", 0x241
#define ODRIVE_ON 0x027, "08 00 00 00"
#define ODRIVE_ASK 0x023, "", 0x023
#define VESC HIL_SOURCE_DIR "/config/protocols/vesc.yaml"
#define VESC_STILL 0x301, "00 00 00 00", 0, NULL, 0x901, "00 00 00 00 00 00 00 00"
    static const struct fault_row rows[] = {
        {RMD, LOW_SUPPLY, RMD_ON, RMD_ASK, "9a 19 19 01 46 00 04 00"},
        {RMD, HIGH_SUPPLY, RMD_ON, RMD_ASK, "9a 19 19 01 bc 02 08 00"},
        {RMD, HIGH_CURRENT, RMD_ON, RMD_ASK, "9a 19 19 01 e0 01 10 00"},
        {RMD, HOT_WINDING, RMD_ON, RMD_ASK, "9a 7f 19 01 e0 01 00 10"},
        {RMD, NO_ENCODER, RMD_ON, RMD_ASK, "9a 19 19 01 e0 01 00 20"},
        {odrive, LOW_SUPPLY, ODRIVE_ON, ODRIVE_ASK, "00 02 00 00 00 02 00 00"},
        {odrive, HIGH_SUPPLY, ODRIVE_ON, ODRIVE_ASK, "00 01 00 00 00 01 00 00"},
        {odrive, HIGH_CURRENT, ODRIVE_ON, ODRIVE_ASK, "00 10 00 00 00 10 00 00"},
        {odrive, HOT_WINDING, ODRIVE_ON, ODRIVE_ASK, "00 20 00 00 00 20 00 00"},
        {watched, SILENCE, ODRIVE_ON, ODRIVE_ASK, "00 00 00 01 00 00 00 01"},
        {VESC, LOW_SUPPLY, VESC_STILL},
        {VESC, HIGH_SUPPLY, VESC_STILL},
        {VESC, HIGH_CURRENT, VESC_STILL},
        {VESC, HOT_WINDING, VESC_STILL},
        {VESC, NO_ENCODER, VESC_STILL},
        {VESC, SILENCE, VESC_STILL},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        const struct fault_row *row = &rows[i];
        const bool extended = row->on_id == 0x301;
        int ms = 0;

        open_bench(row->file, 0);
        base->sense[0].winding_c = PLANT_AMBIENT_C;
        bench_tick(base);
        extended ? send_extended(row->on_id, row->on) : bench_send(base, 0, row->on_id, row->on);
        bench_tick(base);
        assert_true(base->motor[0].bridge_on);
        base->sensors.supply_v = row->cause == LOW_SUPPLY    ? 7.0
                                 : row->cause == HIGH_SUPPLY ? 70.0
                                                             : base->sensors.supply_v;
        base->sense[0].current_a = row->cause == HIGH_CURRENT ? 500.0 : 0.0;
        base->sense[0].winding_c = row->cause == HOT_WINDING ? 200.0 : PLANT_AMBIENT_C;
        base->sense[0].qm = row->cause == NO_ENCODER ? (double)NAN : 0.5;
        for (; ms < 600 && base->motor[0].bridge_on; ms++) {
            bench_tick(base);
        }
        if (ms == 600 || (row->cause == SILENCE && ms < 9)) {
            fail_msg("row %zu: the bridge opened after %d ms", i, ms);
        }
        base->sense[0].current_a = 0.0;
        if (row->ask) {
            bench_send(base, 0, row->ask_id, row->ask);
        }
        do {
            bench_tick(base);
        } while (base->count[0] == 0 && ms++ < 700);
        expect_as(row->id, extended ? FRAME_EXTENDED : 0, row->told);
    }
}

/* ---- counters and checksums; the bytes by long division of polynomials ---- */

TEST(a_board_counts_and_signs_its_frames)
{
    static const char *const told[] = {
        "00 00 50 c3 00 00 00 00 00 00 00 87", "00 01 50 c3 00 00 00 00 00 00 00 7a",
        "00 02 50 c3 00 00 00 00 00 00 00 60", "00 03 50 c3 00 00 00 00 00 00 00 9d",
        "00 00 50 c3 00 00 00 00 00 00 00 87"};

    open_bench(checked, 0);
    for (size_t i = 0; i < sizeof told / sizeof *told; i++) {
        expect_as(0x301, FRAME_FD | FRAME_BRS, told[i]);
        assert_int_equal(bench.base.frame[0][1].id, 0x302); /* counts for itself */
        assert_int_equal(bench.base.frame[0][1].data[1], i % 4);
        bench_tick(&bench.base);
    }
}

TEST(a_wrong_checksum_or_a_stuck_counter_is_malformed)
{
    struct board_event event;
    char text[256];

    open_bench(checked, 0);
    bench_say(base, 0, 0x201, "3b 10 f4 01");
    assert_near(base->motor[0].voltage_v, 5.0, 1e-9);

    /* 7 V with the checksum of 5 V, then right but with the counter of before, then lawful */
    bench_say(base, 0, 0x201, "b4 11 bc 02");
    assert_near(base->motor[0].voltage_v, 5.0, 1e-9);
    assert_int_equal(bench_counters(base).malformed, 1);
    assert_true(bench_event(base, BOARD_EVENT_MALFORMED, &event));
    assert_int_equal(event.a, 0x201);
    bench_say(base, 0, 0x201, "ac 10 bc 02");
    assert_near(base->motor[0].voltage_v, 5.0, 1e-9);
    assert_int_equal(bench_counters(base).malformed, 2);
    assert_true(boards_last_malformed(base->boards, &event));
    board_event_format(base->boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "frame SET (id 0x201): counter alive is 0 again, expected 1"));
    bench_say(base, 0, 0x201, "20 13 bc 02");
    assert_near(base->motor[0].voltage_v, 7.0, 1e-9);
    assert_int_equal(bench_counters(base).malformed, 2);

    /* The other board has heard nothing yet: any count will do */
    bench_say(base, 0, 0x202, "20 13 bc 02");
    assert_near(base->motor[2].voltage_v, 7.0, 1e-9);
    assert_int_equal(bench_counters(base).malformed, 2);
}

/* The log names frame, field, found and expected value, and states as the file does. */
TEST(the_log_speaks_in_the_names_of_the_file)
{
    static const struct {
        const char *file, *bytes;
        uint32_t id;
        const char *text;
    } cases[] = {
        {checked, "3b 10 f4 01", 0x201, "axis 0 from idle to run"},
        {checked, "b4 10 f4 01", 0x201, "frame SET (id 0x201): checksum is 0xb4, expected 0x3b"},
        {checked, "3b 10 f4", 0x201, "frame SET (id 0x201): length is 3, expected 4"},
        {checked, "07 05 f4 01", 0x400,
         "frame ALL (id 0x400): state is 5, expected a value that protocol checked lists"},
        {odrive, "08 00 00 00", 0x027, "axis 0 from idle to closed_loop_control (position)"},
        {odrive, "09 00 00 00 01 00 00 00", 0x02b,
         "frame SET_CONTROLLER_MODE (id 0x02b): control_mode is 9, expected a value that protocol "
         "odrive lists"},
        {odrive, "00 09 00 00", 0x024,
         "frame READ_SDO (id 0x024): endpoint is 9, expected a value that protocol odrive lists"},
        {robstride, "00", 0x101, NULL},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct board_event event, last;
        char text[256], again[256];

        open_bench(cases[i].file, 0);
        bench_say(base, 0, cases[i].id, cases[i].bytes);
        if (!cases[i].text) {
            assert_false(boards_last_malformed(base->boards, &last));
            continue;
        }
        assert_true(boards_next_event(base->boards, &event));
        board_event_format(base->boards, &event, text, sizeof text);
        assert_string_equal(strstr(text, "): ") + 3, cases[i].text);
        if (event.kind == BOARD_EVENT_MALFORMED) {
            assert_true(boards_last_malformed(base->boards, &last));
            board_event_format(base->boards, &last, again, sizeof again);
            assert_string_equal(again, text);
        }
    }
}

/* The reason of a malformed frame must not appear in the next event. */
TEST(a_wrong_frame_for_no_board_leaves_no_trace)
{
    struct board_event event;
    char text[256];

    open_bench(checked, 0);
    bench_send(base, 0, 0x20f, "3b 10 f4");
    bench_say(base, 0, 0x201, "3b 10 f4 01");
    assert_true(boards_next_event(base->boards, &event));
    board_event_format(base->boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "axis 0 from idle to run"));
    assert_int_equal(event.why, 0);
}

/* What is wrong in one part of it, a state or a constant, stops no other drive. */
TEST(each_drive_judges_its_part_of_a_frame_for_all)
{
    static const struct {
        const char *bytes;
        double voltage_v[DRIVES];
        unsigned malformed, unknown;
        unsigned drive; /* whose part is wrong */
    } sent[] = {
        {"07 01 f4 01 07 05 bc 02", {5.0, 0.0}, 1, 0, 1},
        {"07 02 f4 01 07 01 bc 02", {5.0, 7.0}, 2, 0, 0},
        {"07 01 bc 02 08 01 f4 01", {7.0, 7.0}, 2, 1, 1},
        {"07 01 f4 01 07 01 f4 01", {5.0, 5.0}, 2, 1, 0},
    };
    struct board_event event;

    open_bench(checked, 0);
    for (size_t i = 0; i < sizeof sent / sizeof *sent; i++) {
        bench_say(base, 0, 0x400, sent[i].bytes);
        for (int k = 0; k < DRIVES; k++) {
            assert_near(base->motor[2 * k].voltage_v, sent[i].voltage_v[k], 1e-9);
        }
        assert_int_equal(bench_counters(base).malformed, sent[i].malformed);
        assert_int_equal(bench_counters(base).unknown, sent[i].unknown);
        if (i < 3) {
            assert_true(
                bench_event(base, i < 2 ? BOARD_EVENT_MALFORMED : BOARD_EVENT_UNKNOWN, &event));
            assert_int_equal(event.board, sent[i].drive);
        }
    }
}
