/* SPDX-License-Identifier: Apache-2.0 */
/* The message tables agree with themselves: lengths with fields, fields with the codec. */
#include "boards/icub/table.h"
#include "tests/unit/boards/board_bench.h"

static void check_command(const struct icub_command *row, unsigned code)
{
    size_t request = 1 + fields_bytes(row->request);
    size_t reply = 1 + fields_bytes(row->reply);

    if (!row->kind) {
        assert_null(row->name);
        return;
    }
    assert_non_null(row->name);
    assert_in_range(row->request_min, 1, row->request_max);
    assert_in_range(row->request_max, row->request_min, 8);
    assert_true(fields_count(row->request) <= FIELDS_MAX);
    assert_true(fields_count(row->reply) <= FIELDS_MAX);
    if (row->request && row->request_min == row->request_max && request != row->request_max) {
        fail_msg("command 0x%02x %s: request of %zu bytes, not %d", code, row->name, request,
                 row->request_max);
    }
    assert_int_equal(row->reply_length > 0, row->reply != NULL);
    if (row->reply && reply != row->reply_length) {
        fail_msg("command 0x%02x %s: reply of %zu bytes, not %d", code, row->name, reply,
                 row->reply_length);
    }
    if (row->kind == ICUB_SET) {
        assert_true(row->parameter + fields_count(row->request) <= ICUB_P_COUNT);
    } else if (row->kind == ICUB_GET) {
        assert_true(row->parameter + fields_count(row->reply) <= ICUB_P_COUNT);
    }
}

TEST(lengths_of_commands_are_those_of_their_fields)
{
    for (unsigned code = 0; code < ICUB_MOTOR_COMMANDS; code++) {
        check_command(&icub_motor_commands[code], code);
    }
    for (unsigned code = 0; code < ICUB_STRAIN_COMMANDS; code++) {
        check_command(&icub_strain_commands[code], code);
    }
    for (unsigned code = 0; code < 256; code++) {
        const struct icub_command *row = icub_management_command((uint8_t)code);

        if (row) {
            check_command(row, code);
        }
    }
}

TEST(lengths_of_periodic_frames_are_those_of_their_fields)
{
    for (int type = 0; type < 16; type++) {
        assert_int_equal(fields_bytes(icub_motor_frames[type].fields),
                         icub_motor_frames[type].length);
        assert_int_equal(fields_bytes(icub_analog_frames[type].fields),
                         icub_analog_frames[type].length);
    }
}

TEST(names_are_unique_within_a_class)
{
    for (int i = 0; i < ICUB_MOTOR_COMMANDS; i++) {
        for (int j = 0; j < i && icub_motor_commands[i].name; j++) {
            if (icub_motor_commands[j].name) {
                assert_string_not_equal(icub_motor_commands[i].name, icub_motor_commands[j].name);
            }
        }
    }
}

TEST(every_type_survives_the_codec_at_its_ends)
{
    static const struct {
        unsigned type;
        int64_t min, max;
        const char *low, *high;
    } types[] = {
        {FIELD_U8, 0, UINT8_MAX, "00", "FF"},
        {FIELD_U16, 0, UINT16_MAX, "00 00", "FF FF"},
        {FIELD_I16, INT16_MIN, INT16_MAX, "00 80", "FF 7F"},
        {FIELD_U32, 0, UINT32_MAX, "00 00 00 00", "FF FF FF FF"},
        {FIELD_I32, INT32_MIN, INT32_MAX, "00 00 00 80", "FF FF FF 7F"},
        {FIELD_U16_BE, 0, UINT16_MAX, "00 00", "FF FF"},
        {FIELD_I16_BE, INT16_MIN, INT16_MAX, "80 00", "7F FF"},
    };

    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        const struct field fields[] = {{.type = types[i].type}, {.type = FIELD_END}};
        const int64_t ends[] = {types[i].min, types[i].max, INT64_MIN, INT64_MAX};
        const char *const texts[] = {types[i].low, types[i].high, types[i].low, types[i].high};

        for (int e = 0; e < 4; e++) {
            uint8_t expected[64], data[8] = {0xaa, 0xaa, 0xaa, 0xaa};
            uint8_t len = bench_bytes(texts[e], expected);
            int64_t value = 1;

            fields_encode(fields, &ends[e], data);
            assert_memory_equal(data, expected, len);
            assert_true(fields_decode(fields, data, len, &value));
            assert_int_equal(value, e % 2 ? types[i].max : types[i].min);
        }
    }
}

TEST(decoding_stops_at_the_end_and_checks_ranges)
{
    const struct field fields[] = {{.type = FIELD_U8, .name = "a", .min = 2, .max = 5},
                                   {.type = FIELD_PAD},
                                   {.type = FIELD_I16, .name = "b"},
                                   {.type = FIELD_END}};
    const uint8_t data[] = {3, 99, 0x34, 0x12};
    int64_t values[2] = {-1, -1};

    assert_true(fields_decode(fields, data, 4, values));
    assert_int_equal(values[0], 3);
    assert_int_equal(values[1], 0x1234);
    assert_true(fields_decode(fields, data, 3, values)); /* half a field is none */
    assert_int_equal(values[1], 0);
    assert_false(fields_decode(fields, (const uint8_t[]){6}, 1, values));
    assert_false(fields_decode(fields, (const uint8_t[]){1}, 1, values));
    assert_false(fields_decode(fields, data, 0, values));
}

/* ---- configuration ---- */

TEST(too_small_an_arena_is_an_error_at_any_size)
{
    struct board_bench bench;
    struct boards *boards;
    struct error error;
    size_t size = 4096;

    bench_configure(&bench);
    for (;; size += 4096) {
        enum error_code code;

        assert_ok(arena_init(&bench.arena, size, &error));
        code = boards_create(&bench.config, &bench.arena, &boards, &error);
        arena_fini(&bench.arena);
        if (!code) {
            break;
        }
        assert_int_equal(code, ERROR_MEMORY);
    }
    assert_true(size > 4096); /* it did fail before */
}

TEST_ON(a_rig_without_boards_does_nothing, bench_configure, bench)
{
    bench->config.nboard = 0;
    bench_start(bench);
    bench_say(bench, 0, 0x70f, "FF");
    assert_int_equal(bench->count[0], 0);
    assert_int_equal(bench_counters(bench).foreign, 1);
    boards_shut_down(bench->boards, bench->now_ns, &bench->command);
}
