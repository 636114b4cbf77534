/* SPDX-License-Identifier: Apache-2.0 */
/* What a protocol file may not say, with the place that the message names; and the limits of its
 * numbers. */
#include "boards/described/protocol.h"
#include "boards/described/schema.h"

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
     "toy.yaml:5:13: found unknown state \"runn\", expected run"},
    {HEAD "faults: {over_curent: {bit: 1}}\nframes: [{name: A, from: host, id: 0}]\n",
     "toy.yaml:5:23: found unknown fault \"over_curent\", expected over_current"},
    {FRAME "  - {name: A, from: host, id: 0x7ff, by: address}\n",
     "toy.yaml:6:31: found ids up to 0x81e"},
    {FRAME "  - {name: A, from: host, id: 1, step: 2}\n",
     "toy.yaml:6:40: found step, expected it with by: address only"},
    {FRAME "  - {name: A, from: board, id: 1, reply: A}\n",
     "toy.yaml:6:5: found a key of frames from the host in one from the board"},
    {FRAME "  - {name: A, from: host, id: 1, reply: B}\n", "toy.yaml:6:41: found reply \"B\""},
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
    {FRAME "  - {name: A, from: host, id: 1}\nhost: {command: [B]}\n",
     "toy.yaml:7:18: found \"B\", expected the name of a frame from the host"},
    {FRAME "  - {name: A, from: host, id: 1, perod_s: 1}\n", "toy.yaml:6:34: "},
    {FRAME "  - name: A\n    from: host\n    id: 1\n    fields:\n"
           "      - {name: x, bits: 4}\n      - {name: x, bits: 4}\n",
     "toy.yaml:11:9: found field \"x\" again"},
    {FRAME "  - {name: A b, from: host, id: 1}\n", "toy.yaml:6:5: found the name \"A b\""},
    {"name: \"a\\\"b\"\nstates: []\nframes: []\n", "toy.yaml:1:1: found the name \"a"},
};

static void what_is_wrong_is_refused_with_its_place(void **state)
{
    int failed = 0;

    (void)state;
    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        const struct described_protocol *protocol;
        struct error error;

        assert_int_equal(described_read_text("toy.yaml", wrong[i].text, strlen(wrong[i].text),
                                             &arena, &protocol, &error),
                         ERROR_INPUT);
        if (strncmp(error.text, wrong[i].expected, strlen(wrong[i].expected)) != 0) {
            print_error("# case %zu: \"%s\", not \"%s\"\n", i, error.text, wrong[i].expected);
            failed++;
        }
    }
    assert_int_equal(failed, 0);
}

/* Fields of each order, placed by hand. */
static void fields_lie_where_the_file_says(void **state)
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
    int64_t counts[FIELDS_MAX];
    uint8_t again[8] = {0};
    struct error error;
    unsigned number;

    (void)state;
    if (described_read_text("toy.yaml", text, sizeof text - 1, &arena, &protocol, &error)) {
        fail_msg("%s", error.text);
    }
    frame = &protocol->frame[0];
    assert_true(described_number(frame, 0x11f, &number));
    assert_int_equal(number, 31);
    assert_false(described_number(frame, 0x100, &number));
    assert_false(described_number(frame, 0x120, &number));
    assert_int_equal(described_match_data(frame, data, 8, counts), DESCRIBED_IS);
    for (size_t i = 0; i < ARRAY_COUNT(values); i++) {
        assert_true(fabs(described_value(described_layout(frame, i), &frame->field[i], counts[i]) -
                         values[i]) < 1e-9);
        assert_int_equal(described_count(described_layout(frame, i), &frame->field[i], values[i]),
                         counts[i]);
    }
    fields_encode(frame->layout, counts, again);
    assert_memory_equal(again, data, 8);
    assert_int_equal(described_match_data(frame, data, 7, counts), DESCRIBED_BAD_LENGTH);
    again[6] = 0xa4;
    assert_int_equal(described_match_data(frame, again, 8, counts), DESCRIBED_BAD_CONSTANT);
}

static const struct limit limits[] = {
    {"name", 1, 31},
    {"description", 1, 1000},
    {"axes", 1, 4},
    {"address_max", 1, 31},
    {"command_timeout_s", 0, 60},
    {"on_timeout", 1, 31},
    {"*.name", 1, 31},
    {"*.set_point_scale", -1e12, 1e12},
    {"states[].value", 0, UINT32_MAX},
    {"laws[].value", 0, UINT32_MAX},
    {"faults[].bit", 0, 31},
    {"gains.position_per_s", 0, 1e6},
    {"gains.velocity_nm_s_rad", 0, 1e6},
    {"gains.velocity_nm_rad", 0, 1e6},
    {"frames[].id", 0, 0x7ff},
    {"frames[].step", 1, 0x7ff},
    {"frames[].length", 0, 8},
    {"frames[].repeat", 1, 8},
    {"frames[].payload", 2, 23},
    {"frames[].period_s", 0.001, 60},
    {"frames[].spread_s", 0, 1},
    {"frames[].reply", 1, 31},
    {"frames[].enter", 1, 31},
    {"frames[].fields[].bits", 1, 32},
    {"frames[].fields[].at_bit", 0, 63},
    {"frames[].fields[].scale", -1e12, 1e12},
    {"frames[].fields[].offset", -1e12, 1e12},
    {"frames[].fields[].range", -1e12, 1e12},
    {"frames[].fields[].value", INT32_MIN, UINT32_MAX},
    {"frames[].fields[].host_value", -1e12, 1e12},
    {"frames[].fields[].axis", 0, 3},
    {"host.on_state", 1, 31},
    {"host.off_state", 1, 31},
};

static void every_limit_of_a_protocol_file_holds(void **state)
{
    (void)state;
    check_schema(&described_file_schema, limits, ARRAY_COUNT(limits));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_wrong_is_refused_with_its_place, open_arena,
                                        close_arena),
        cmocka_unit_test_setup_teardown(fields_lie_where_the_file_says, open_arena, close_arena),
        cmocka_unit_test_setup_teardown(every_limit_of_a_protocol_file_holds, open_arena,
                                        close_arena),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
