/* SPDX-License-Identifier: Apache-2.0 */
/* What a protocol file may not say, with the place that the message names; and the limits of its
 * numbers. */
#include "boards/described/protocol.h"
#include "boards/described/load.h"

#include "tests/unit/schema_limits.h"

#define HEAD                                                                                       \
    "name: toy\nstates:\n  - {name: idle, law: \"off\"}\n  - {name: run, value: 1, law: "          \
    "voltage}\n"
#define FRAME HEAD "frames:\n"

static const struct {
    const char *text, *expected;
} wrong[] = {
    {"name: toy\nstates: [{name: run, law: voltage}]\nframes: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:1:1: found no state with law: off"},
    {HEAD "frames: []\n", "toy.yaml:1:1: found 0 frames"},
    {HEAD "on_timeout: runn\nframes: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:5:13: found unknown state \"runn\", expected \"run\""},
    {"name: toy\nstates: [{name: idle, law: \"off\"}, {name: run, law: position}]\n"
     "frames: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:2:53: found law: position with the gain 0"},
    {HEAD "unknown_state: run\nframes: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:5:16: found state \"run\", expected one with law: refused"},
    {FRAME "  - {name: A, from: board, id: 1, optional: true}\n",
     "toy.yaml:6:45: found optional without period_s"},
    {HEAD "faults: {over_curent: {bit: 1}}\nframes: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:5:10: found unknown key \"over_curent\" in the faults, expected \"over_current\""},
    {HEAD "faults: {stale: {bit: 8}}\nframes:\n"
          "  - {name: A, from: board, id: 1, fields: [{name: f, bits: 8, source: faults}]}\n",
     "toy.yaml:5:17: found bit 8 of fault \"stale\", but the longest field of faults has the bits "
     "0 "
     "to 7"},
    {FRAME "  - {name: A, from: host, id: 0x7ff, by: address}\n",
     "toy.yaml:6:31: found ids up to 0x81e"},
    {FRAME "  - {name: A, from: host, id: 1, step: 2}\n",
     "toy.yaml:6:40: found step, expected it with by: address only"},
    {FRAME "  - {name: A, from: board, id: 1, reply: A}\n",
     "toy.yaml:6:5: found a key of frames from the host in one from the board"},
    {FRAME "  - {name: A, from: host, id: 1, reply: B}\n", "toy.yaml:6:41: found reply \"B\""},
    {FRAME "  - {name: A, from: host, id: 1, reply_delay_s: 0}\n",
     "toy.yaml:6:5: found reply_delay_s or reply_spread_s without reply"},
    {FRAME "  - {name: A, from: host, id: 1}\n  - {name: A, from: host, id: 2}\n",
     "toy.yaml:7:5: found frame \"A\" again"},
    {FRAME "  - {name: A, from: board, id: 1, telemetry: true, period_s: 0.1}\n",
     "toy.yaml:6:62: found period_s beside telemetry"},
    {FRAME "  - {name: A, from: board, id: 1, period_s: 0.0015}\n",
     "toy.yaml:6:45: found a period of 0.0015 s"},
    {FRAME "  - {name: A, from: host, id: 1, payload: \"ff f\"}\n",
     "toy.yaml:6:43: found payload \"ff f\""},
    {FRAME "  - {name: A, from: host, id: 1, by: group, repeat: 2}\n",
     "toy.yaml:6:53: found repeat 2"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    length: 1\n    fields:\n"
           "      - {name: x, bits: 9}\n",
     "toy.yaml:9:13: found length 1, expected at least the 2 bytes"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8}\n      - {name: y, bits: 8, at_bit: 7}\n",
     "toy.yaml:11:36: found at_bit 7, expected 8 or more"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 4}\n      - {name: y, bits: 4, order: big}\n",
     "toy.yaml:11:9: found fields of both orders in one byte"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 16, type: float}\n",
     "toy.yaml:10:25: found a float of 16 bits, expected 32"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 16, source: current}\n",
     "toy.yaml:10:9: found field \"x\" of a frame from the host"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 3, value: 8}\n",
     "toy.yaml:10:35: found value 8, expected one that 3 bits hold"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, target: state, scale: 2}\n",
     "toy.yaml:10:9: found a scale, an offset, a range or a float of field \"x\""},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, target: voltage, range: [3, 1]}\n",
     "toy.yaml:10:52: found range"},
    {FRAME "  - name: A\n    from: board\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, source: deflection}\n",
     "toy.yaml:6:5: found a deflection"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    reply: B\n"
           "  - name: B\n    from: board\n    id: 2\n    fields:\n"
           "      - {name: x, bits: 8, source: echo}\n",
     "toy.yaml:9:12: found reply \"B\", whose field \"x\" echoes one"},
    {FRAME "  - {name: SET, from: host, id: 1, by: address, fields: [{name: v, bits: 8, target: "
           "voltage}]}\n  - {name: GO, from: host, id: 0x100, by: address, enter: run}\n"
           "host: {\"on\": [GO]}\n",
     "toy.yaml:8:7: found a host without command, expected the frames that carry set-points, as "
     "\"SET\""},
    {FRAME "  - {name: A, from: host, id: 1}\nhost: {command: [B]}\n",
     "toy.yaml:7:18: found \"B\", expected the name of a frame from the host"},
    {FRAME "  - {name: A, from: host, id: 1, perod_s: 1}\n", "toy.yaml:6:34: "},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 4}\n      - {name: x, bits: 4}\n",
     "toy.yaml:11:9: found field \"x\" again"},
    {FRAME "  - {name: A b, from: host, id: 1}\n", "toy.yaml:6:5: found the name \"A b\""},
    /* identifiers that are of two frames on every bus */
    {FRAME "  - {name: A, from: host, id: 0x10, by: address}\n"
           "  - {name: B, from: board, id: 0x10, by: address, period_s: 0.001}\n",
     "toy.yaml:7:32: found identifier 0x11 of frame \"B\" from the board, which frame \"A\" (line "
     "6) from the host has"},
    {FRAME
     "  - {name: A, from: host, id: 0x12}\n  - {name: B, from: board, id: 0x10, by: address}\n",
     "toy.yaml:7:32: found identifier 0x12 of frame \"B\""},
    {FRAME "  - {name: A, from: board, id: 0x10, by: address, step: 2}\n"
           "  - {name: B, from: board, id: 0x12, by: address}\n",
     "toy.yaml:7:32: found identifier 0x14 of frame \"B\" again, which frame \"A\" (line 6)"},
    {FRAME "  - {name: A, from: host, id: 1, length: 1}\n"
           "  - {name: B, from: host, id: 1, payload: \"ff\"}\n",
     "toy.yaml:7:31: found identifier 0x1 of frame \"B\" again"},
    {FRAME "  - {name: A, from: host, id: 1, remote: true}\n"
           "  - {name: B, from: host, id: 1, remote: true, length: 1}\n",
     "toy.yaml:7:31: found identifier 0x1 of frame \"B\" again"},
    {FRAME "  - name: A\n    from: host\n    id: 0x1000000\n    by: address\n    extended: true\n"
           "    id_fields:\n      - {name: x, at_bit: 8, bits: 16, target: torque}\n"
           "  - {name: B, from: board, id: 0x100ff00, extended: true, by: address}\n",
     "toy.yaml:13:32: found identifier 0x100ff01 of frame \"B\" from the board"},
    /* two names for one value */
    {"name: toy\nstates:\n  - {name: idle, law: \"off\"}\n  - {name: run, value: 1, law: voltage}\n"
     "  - {name: walk, value: 1, law: current}\nframes:\n  - name: A\n    from: host\n    id: 1\n"
     "    fields:\n      - {name: x, bits: 8, target: state}\n",
     "toy.yaml:5:25: found value 1 of \"walk\", which \"run\" (line 4) has"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, target: state, values: {a: 1, b: 1}}\n",
     "toy.yaml:10:58: found 1 for \"b\", which \"a\" has"},
    /* a list that is too long ends behind a word */
    {FRAME "  - name: A\n    from: board\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, source: torq}\n",
     "toy.yaml:10:36: found \"torq\", expected address, axis, state, law, telemetry_period, "
     "parameter_value, velocity_limit, current_limit, position_gain, velocity_gain, "
     "integral_gain, command_timeout, position_speed_limit, host_number, answer_id, result, "
     "motor_position, link_position, deflection, ... (did you mean \"torque\"?)"},
    /* 29 bits, CAN FD, counters and checksums */
    {FRAME "  - {name: A, from: host, id: 0x800}\n",
     "toy.yaml:6:31: found ids up to 0x800, expected them within 0x7ff"},
    {FRAME "  - {name: A, from: host, id: 0x1ffffffe, by: address, extended: true}\n",
     "toy.yaml:6:31: found ids up to 0x2000001d, expected them within 0x1fffffff"},
    {FRAME "  - name: A\n    from: host\n    id: 0\n    by: address\n    extended: true\n"
           "    id_fields:\n      - {name: x, at_bit: 4, bits: 8}\n",
     "toy.yaml:12:9: found field \"x\" in bits of the identifier that id or its number 16"},
    {FRAME "  - name: A\n    from: host\n    id: 0\n    extended: true\n"
           "    id_fields:\n      - {name: x, at_bit: 24, bits: 6}\n",
     "toy.yaml:11:9: found field \"x\" as the 1th or beyond bit 28"},
    {FRAME "  - name: A\n    from: host\n    id: 0\n    extended: true\n"
           "    id_fields:\n      - {name: x, bits: 8, checksum: xor}\n",
     "toy.yaml:11:9: found a field of the identifier that is big-endian"},
    {FRAME "  - {name: A, from: host, id: 1, length: 9}\n",
     "toy.yaml:6:42: found length 9, expected at most 8, or fd: true"},
    {FRAME "  - {name: A, from: host, id: 1, fd: true, length: 9}\n",
     "toy.yaml:6:52: found length 9, expected one of CAN FD"},
    {FRAME "  - {name: A, from: host, id: 1, bit_rate_switch: false}\n",
     "toy.yaml:6:51: found bit_rate_switch without fd: true"},
    {FRAME "  - {name: A, from: host, id: 1, fd: true, remote: true}\n",
     "toy.yaml:6:5: found fd beside remote"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 7, checksum: xor}\n",
     "toy.yaml:10:38: found checksum of field \"x\", expected one of a frame, a byte of its own"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, checksum: crc7}\n",
     "toy.yaml:10:38: "},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 4, counter: true}\n      - {name: y, bits: 4, counter: true}\n",
     "toy.yaml:6:5: found two counters in frame \"A\""},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    by: group\n    repeat: 2\n    fields:\n"
           "      - {name: x, bits: 8, counter: true}\n",
     "toy.yaml:10:13: found repeat or lengths beside a counter or a checksum"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, counter: true, target: voltage}\n",
     "toy.yaml:10:9: found field \"x\" of a frame from the host"},
    /* lengths, requests without data, parameters */
    {FRAME "  - {name: A, from: host, id: 1, lengths: [2, 8], length: 1}\n",
     "toy.yaml:6:43: found lengths [2, 8], expected whole numbers about the 1 bytes"},
    {FRAME "  - {name: A, from: host, id: 1, lengths: [0.5, 8], length: 1}\n",
     "toy.yaml:6:43: found lengths [0.5, 8]"},
    {FRAME "  - {name: A, from: board, id: 1, lengths: [0, 8], length: 1}\n",
     "toy.yaml:6:5: found a key of frames from the host in one from the board"},
    {FRAME "  - {name: A, from: host, id: 1, lengths: [0, 4]}\n"
           "  - {name: B, from: host, id: 1, lengths: [2, 8], length: 8}\n",
     "toy.yaml:7:31: found identifier 0x1 of frame \"B\" again"},
    {FRAME "  - {name: A, from: host, id: 1, or_empty: true}\n",
     "toy.yaml:6:5: found or_empty without remote: true"},
    {FRAME "  - {name: A, from: host, id: 1, remote: true, or_empty: true}\n"
           "  - {name: B, from: host, id: 1, lengths: [0, 8]}\n",
     "toy.yaml:7:31: found identifier 0x1 of frame \"B\" again"},
    {FRAME "  - {name: A, from: host, id: 1}\nparameters:\n"
           "  - {number: 3, field: {name: x, bits: 8, value: 1}}\n"
           "  - {number: 3, field: {name: y, bits: 8, source: state}}\n",
     "toy.yaml:9:14: found number 3 again"},
    {FRAME "  - {name: A, from: host, id: 1}\nparameters:\n"
           "  - {number: 3, field: {name: x, bits: 8, source: echo}}\n",
     "toy.yaml:8:51: found source: echo in a parameter"},
    {FRAME "  - {name: A, from: host, id: 1}\nparameters:\n"
           "  - {number: 3, field: {name: x, bits: 8, target: axis}}\n",
     "toy.yaml:8:51: found parameter \"x\", which no host can write"},
    {FRAME "  - {name: A, from: host, id: 1}\nparameters:\n"
           "  - {number: 3, writable: true, field: {name: x, bits: 8, source: supply}}\n",
     "toy.yaml:8:67: found parameter \"x\", which no host can write"},
    {FRAME "  - {name: A, from: host, id: 1}\nmodels: [{name: m, values: {y: 1}}]\n",
     "toy.yaml:7:29: found unknown parameter \"y\", expected none"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, target: voltage, times: y}\n",
     "toy.yaml:10:52: found unknown parameter \"y\""},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, target: voltage, times: y}\n"
           "parameters: [{field: {name: y, bits: 8, source: supply}}]\n",
     "toy.yaml:10:52: found the factor \"y\", expected a parameter with a value"},
    {FRAME "  - {name: A, from: host, id: 1, only: fast}\n",
     "toy.yaml:6:40: found unknown law \"fast\""},
    {FRAME "  - {name: A, from: board, id: 1, save: true}\n",
     "toy.yaml:6:5: found a key of frames from the host in one from the board"},
    {FRAME "  - {name: A, from: host, id: 1, answer_id: true}\n",
     "toy.yaml:6:5: found a key of frames from the board in one from the host"},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 8, value: 0.5}\n",
     "toy.yaml:10:35: found value 0.5, expected one that 8 bits hold"},
    {FRAME "  - name: A\n    from: board\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 1, fault: warm}\n",
     "toy.yaml:10:35: found unknown fault \"warm\""},
    {"name: toy\nstates: [{name: idle, law: \"off\", fault: stale}]\n"
     "frames: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:2:42: found fault without law: fault"},
    {"name: \"a\\\"b\"\nstates: []\nframes: []\n", "toy.yaml:1:1: found the name \"a"},
};

TEST_WITH(what_is_wrong_is_refused_with_its_place, open_arena, close_arena)
{
    int failed = 0;

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        const struct described_protocol *protocol;
        struct error error;

        assert_int_equal(described_read_text("toy.yaml", wrong[i].text, strlen(wrong[i].text),
                                             false, &arena, &protocol, &error),
                         ERROR_INPUT);
        if (strncmp(error.text, wrong[i].expected, strlen(wrong[i].expected)) != 0) {
            print_error("# case %zu: \"%s\", not \"%s\"\n", i, error.text, wrong[i].expected);
            failed++;
        }
    }
    assert_int_equal(failed, 0);
}

/* Fields of each order, placed by hand. */
TEST_WITH(fields_lie_where_the_file_says, open_arena, close_arena)
{
    static const char text[] = FRAME
        "  - name: A\n    from: host\n    id: 0x100\n    by: address\n    length: 8\n    fields:\n"
        "      - {name: a, bits: 4, target: voltage}\n"
        "      - {name: b, bits: 8, at_bit: 12, target: current}\n"
        "      - {name: c, bits: 12, at_bit: 24, order: big, target: torque, range: [-10, 10]}\n"
        "      - {name: d, bits: 12, order: big, type: signed, target: velocity, scale: 0.5}\n"
        "      - {name: e, bits: 8, value: 0xa5}\n";
    static const uint8_t data[] = {0x07, 0xb0, 0x0c, 0xff, 0xf8, 0x00, 0xa5, 0x00};
    static const double values[] = {7.0, 0xcb, 10.0, -1024.0};
    const struct described_protocol *protocol;
    const struct described_frame *frame;
    int64_t counts[DESCRIBED_FIELDS_MAX];
    struct bus_frame sent = frame_make(0x101, 8, data);
    struct bus_frame again = {0};
    struct error error;
    unsigned number;

    assert_no_error(
        described_read_text("toy.yaml", text, sizeof text - 1, false, &arena, &protocol, &error),
        error.text);
    frame = &protocol->frame[0];
    assert_true(described_number(frame, 0x11f, false, &number));
    assert_int_equal(number, 31);
    assert_false(described_number(frame, 0x11f, true, &number));
    assert_false(described_number(frame, 0x100, false, &number));
    assert_false(described_number(frame, 0x120, false, &number));
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_IS);
    described_decode(frame, &sent, 0, counts);
    for (size_t i = 0; i < ARRAY_COUNT(values); i++) {
        assert_true(fabs(described_value(&frame->field[i], counts[i]) - values[i]) < 1e-9);
        assert_int_equal(described_count(&frame->field[i], values[i]), counts[i]);
    }
    described_encode(frame, 0, 0, counts, &again);
    assert_memory_equal(again.data, data, 8);
    sent.len = 7;
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_BAD_LENGTH);
    sent.len = 8;
    sent.flags = FRAME_FD;
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_BAD_LENGTH);
    sent.flags = 0;
    sent.data[6] = 0xa4;
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_BAD_CONSTANT);
}

static const struct described_protocol *read_protocol(const char *text)
{
    const struct described_protocol *protocol;
    struct error error;

    assert_no_error(
        described_read_text("toy.yaml", text, strlen(text), false, &arena, &protocol, &error),
        error.text);
    return protocol;
}

/* Priority, parameter group and source address as J1939 lays them out: PGN 61444 (0xf004) of
 * address 3 with priority 3 is 0x0cf00403, as in SAE J1939-71. */
TEST_WITH(fields_lie_in_the_identifier, open_arena, close_arena)
{
    static const char text[] = FRAME
        "  - name: A\n    from: host\n    id: 0x00f00000\n    by: address\n    extended: true\n"
        "    id_fields:\n      - {name: group, at_bit: 8, bits: 8, value: 4}\n"
        "      - {name: priority, at_bit: 26, bits: 3, host_value: 3}\n"
        "    fields:\n      - {name: x, bits: 8, target: voltage}\n";
    const struct described_frame *frame = &read_protocol(text)->frame[0];
    struct bus_frame sent = {.id = 0x0cf00403, .flags = FRAME_EXTENDED, .len = 1, .data = {7}};
    struct bus_frame again = {0};
    int64_t counts[DESCRIBED_FIELDS_MAX];
    unsigned number;

    assert_int_equal(frame->flags, FRAME_EXTENDED);
    assert_int_equal(frame->mask, 0x1c000000);
    assert_true(described_number(frame, sent.id, true, &number));
    assert_int_equal(number, 3);
    assert_false(described_number(frame, sent.id, false, &number));
    assert_false(described_number(frame, 0x0cf00503, true, &number));
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_IS);
    described_decode(frame, &sent, 0, counts);
    assert_int_equal(counts[0], 7);
    assert_int_equal(counts[1], 4);
    assert_int_equal(counts[2], 3);
    described_encode(frame, 3, 0, counts, &again);
    assert_int_equal(again.id, sent.id);
    assert_int_equal(again.data[0], 7);
}

/* The published check values of the digits 1 to 9. */
TEST(checksums_are_those_of_the_standards)
{
    static const uint8_t digits[] = "1234567890";

    assert_int_equal(described_checksum(DESCRIBED_CRC8_SAE_J1850, digits, 9, 9), 0x4b);
    assert_int_equal(described_checksum(DESCRIBED_XOR, digits, 9, 9), 0x31);

    /* A byte that is left out is as if it were not there */
    assert_int_equal(described_checksum(DESCRIBED_CRC8_SAE_J1850, digits, 10, 9), 0x4b);
}

/* A frame of ten bytes and its checksum has the next length of CAN FD. */
TEST_WITH(a_long_frame_is_one_of_can_fd, open_arena, close_arena)
{
    static const char text[] = FRAME
        "  - name: A\n    from: host\n    id: 1\n    fd: true\n    fields:\n"
        "      - {name: crc, bits: 8, checksum: crc8_sae_j1850}\n"
        "      - {name: x, bits: 32, target: voltage}\n      - {name: y, bits: 32, at_bit: 56}\n";
    const struct described_frame *frame = &read_protocol(text)->frame[0];
    struct bus_frame sent = {.id = 1, .flags = FRAME_FD | FRAME_BRS, .len = 12};
    int64_t counts[DESCRIBED_FIELDS_MAX] = {0, 0x01020304, 0x05060708};

    assert_int_equal(frame->length, 12);
    assert_int_equal(frame->flags, FRAME_FD | FRAME_BRS);
    described_encode(frame, 0, 0, counts, &sent);
    assert_int_equal(sent.id, 1);
    assert_memory_equal(sent.data + 1, "\4\3\2\1\0\0\10\7\6\5", 10);
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_IS);
    described_decode(frame, &sent, 0, counts);
    assert_int_equal(counts[2], 0x05060708);
    sent.data[11] ^= 1; /* padding is under the checksum too */
    assert_int_equal(described_match_frame(frame, &sent), DESCRIBED_BAD_CHECKSUM);
}

/* What one board tells apart: frames by constants, the special one first, and by length; a remote
 * frame from the data that answers it; kinds of boards. What depends on addresses is the rig's. */
TEST_WITH(identifiers_are_shared_where_frames_are_told_apart, open_arena, close_arena)
{
    static const char *const good[] = {
        FRAME "  - {name: A, from: host, id: 1, payload: \"ff\"}\n"
              "  - {name: B, from: host, id: 1, length: 1}\n",
        FRAME "  - {name: A, from: host, id: 1, length: 2}\n"
              "  - {name: B, from: host, id: 1, length: 1}\n",
        FRAME "  - {name: A, from: host, id: 1, remote: true}\n"
              "  - {name: B, from: board, id: 1}\n",
        FRAME "  - {name: A, from: board, id: 1, by: address}\n"
              "  - {name: B, from: board, id: 1, by: address, of: ft}\n",
        FRAME "  - {name: A, from: host, id: 0x10, by: address}\n"
              "  - {name: B, from: board, id: 0x11, by: address}\n",
        FRAME "  - {name: A, from: host, id: 1}\n"
              "  - {name: B, from: board, id: 1, extended: true}\n",
    };

    for (size_t i = 0; i < ARRAY_COUNT(good); i++) {
        read_protocol(good[i]);
    }
}

static const struct limit limits[] = {
    {"name", 1, 31},
    {"description", 1, 1000},
    {"axes", 1, 4},
    {"address_max", 1, 254},
    {"command_timeout_s", 0, 60},
    {"on_timeout", 1, 31},
    {"unknown_state", 1, 31},
    {"*.lasts_s", 0, 60},
    {"*.name", 1, 31},
    {"*.set_point_scale", -1e12, 1e12},
    {"states[].value", 0, UINT32_MAX},
    {"states[].result", 0, UINT32_MAX},
    {"laws[].result", 0, UINT32_MAX},
    {"parameters[].number", 0, UINT32_MAX},
    {"parameters[].field.value", -FLT_MAX, FLT_MAX},
    {"frames[].lengths", 0, 64},
    {"laws[].value", 0, UINT32_MAX},
    {"*.bit", 0, 31},
    {"gains.position_per_s", 0, 1e6},
    {"gains.velocity_nm_s_rad", 0, 1e6},
    {"gains.velocity_nm_rad", 0, 1e6},
    {"frames[].id", 0, 0x1fffffff},
    {"frames[].step", 1, 0x1fffffff},
    {"frames[].length", 0, 64},
    {"frames[].repeat", 1, 64},
    {"frames[].payload", 2, 191},
    {"frames[].period_s", 0.001, 60},
    {"frames[].spread_s", 0, 1},
    {"frames[].reply", 1, 31},
    {"reply_delay_s", 0, 0.1},
    {"reply_spread_s", 0, 0.1},
    {"*.reply_delay_s", 0, 0.1},
    {"*.reply_spread_s", 0, 0.1},
    {"frames[].enter", 1, 31},
    {"*.bits", 1, 32},
    {"*.at_bit", 0, 511},
    {"*.scale", -1e12, 1e12},
    {"*.offset", -1e12, 1e12},
    {"*.range", -1e12, 1e12},
    {"frames[].fields[].value", -FLT_MAX, FLT_MAX},
    {"frames[].id_fields[].value", -FLT_MAX, FLT_MAX},
    {"*.fault", 1, 31},
    {"*.times", 1, 31},
    {"frames[].select", 1, 31},
    {"frames[].only", 1, 31},
    {"*.host_value", -1e12, 1e12},
    {"*.axis", 0, 3},
    {"host.on_state", 1, 31},
    {"host.off_state", 1, 31},
};

TEST_WITH(every_limit_of_a_protocol_file_holds, open_arena, close_arena)
{
    check_schema(&described_file_schema, limits, ARRAY_COUNT(limits));
}
