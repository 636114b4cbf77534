/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The SDO server: transfers written down byte by byte from CiA 301, 7.2.4.3, and every abort code
 * that a request can provoke.
 */
#include "tests/unit/boards/cia402/cia402_bench.h"

#include "base/random.h"

/* ---- exchanges ---- */

TEST_ON(expedited_transfers_read_and_write, start, bench)
{
    /* 4, 2 and 1 bytes up: n = 0, 2, 3 */
    sdo(bench, 4, "40 00 10 00 00 00 00 00", "43 00 10 00 92 01 FF FF");
    sdo(bench, 4, "40 17 10 00 00 00 00 00", "4B 17 10 00 00 00 00 00");
    sdo(bench, 4, "40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00");
    sdo(bench, 4, "40 18 10 00 00 00 00 00", "4F 18 10 00 04 00 00 00");

    /* down, with a size and without */
    sdo(bench, 4, "2B 17 10 00 E8 03 00 00", "60 17 10 00 00 00 00 00");
    sdo(bench, 4, "40 17 10 00 00 00 00 00", "4B 17 10 00 E8 03 00 00");
    sdo(bench, 4, "22 17 10 00 0A 00 00 00", "60 17 10 00 00 00 00 00");
    sdo(bench, 4, "40 17 10 00 00 00 00 00", "4B 17 10 00 0A 00 00 00");
    sdo(bench, 4, "23 81 60 00 40 0D 03 00", "60 81 60 00 00 00 00 00");
    sdo(bench, 4, "40 81 60 00 00 00 00 00", "43 81 60 00 40 0D 03 00");

    /* the second axis is another one, and so is another node */
    sdo(bench, 4, "40 81 68 00 00 00 00 00", "43 81 68 00 A0 86 01 00");
    sdo(bench, 20, "40 81 60 00 00 00 00 00", "43 81 60 00 A0 86 01 00");
    sdo(bench, 31, "40 00 10 00 00 00 00 00", "43 00 10 00 94 01 02 00");

    /* signed values */
    sdo(bench, 4, "2F 60 60 00 FF 00 00 00", "60 60 60 00 00 00 00 00");
    sdo(bench, 4, "40 60 60 00 00 00 00 00", "4F 60 60 00 FF 00 00 00");
}

TEST_ON(segments_carry_what_is_longer, start, bench)
{
    /* "coman-hil drive" is 15 bytes: 7, 7 and 1 with n = 6, c = 1; t alternates from 0 */
    sdo(bench, 4, "40 08 10 00 00 00 00 00", "41 08 10 00 0F 00 00 00");
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "00 63 6F 6D 61 6E 2D 68");
    sdo(bench, 4, "70 00 00 00 00 00 00 00", "10 69 6C 20 64 72 69 76");
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "0D 65 00 00 00 00 00 00");

    /* "abcdefghij" down: 10 bytes, 7 and 3 with n = 4 */
    sdo(bench, 4, "21 00 20 00 0A 00 00 00", "60 00 20 00 00 00 00 00");
    sdo(bench, 4, "00 61 62 63 64 65 66 67", "20 00 00 00 00 00 00 00");
    sdo(bench, 4, "19 68 69 6A 00 00 00 00", "30 00 00 00 00 00 00 00");
    sdo(bench, 4, "40 00 20 00 00 00 00 00", "41 00 20 00 0A 00 00 00");
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "00 61 62 63 64 65 66 67");
    sdo(bench, 4, "70 00 00 00 00 00 00 00", "19 68 69 6A 00 00 00 00");

    /* a number may come in a segment, with a size or without; a short text in one go */
    sdo(bench, 4, "21 17 10 00 02 00 00 00", "60 17 10 00 00 00 00 00");
    sdo(bench, 4, "0B 34 12 00 00 00 00 00", "20 00 00 00 00 00 00 00");
    sdo(bench, 4, "40 17 10 00 00 00 00 00", "4B 17 10 00 34 12 00 00");
    sdo(bench, 4, "20 17 10 00 00 00 00 00", "60 17 10 00 00 00 00 00");
    sdo(bench, 4, "0B 00 00 00 00 00 00 00", "20 00 00 00 00 00 00 00");
    sdo(bench, 4, "40 17 10 00 00 00 00 00", "4B 17 10 00 00 00 00 00");
    sdo(bench, 4, "27 00 20 00 68 69 21 00", "60 00 20 00 00 00 00 00");
    sdo(bench, 4, "40 00 20 00 00 00 00 00", "47 00 20 00 68 69 21 00");

    /* an empty text is a transfer of no bytes */
    sdo(bench, 20, "40 00 20 00 00 00 00 00", "41 00 20 00 00 00 00 00");
    sdo(bench, 20, "60 00 00 00 00 00 00 00", "0F 00 00 00 00 00 00 00");
}

TEST_ON(an_abort_or_a_new_request_ends_a_transfer, start, bench)
{
    sdo(bench, 4, "40 08 10 00 00 00 00 00", "41 08 10 00 0F 00 00 00");
    bench_say(bench, 0, 0x604, "80 08 10 00 00 00 04 05");
    assert_int_equal(bench_sent(bench, 0, 0x584), 0);
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05");

    sdo(bench, 4, "21 00 20 00 0A 00 00 00", "60 00 20 00 00 00 00 00");
    sdo(bench, 4, "40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00");
    sdo(bench, 4, "00 61 62 63 64 65 66 67", "80 01 10 00 01 00 04 05");
}

/* ---- abort codes ---- */

static const struct refusal {
    const char *what, *request, *answer;
} refusals[] = {
    {"no such command", "E0 08 10 00 00 00 00 00", "80 08 10 00 01 00 04 05"},
    {"no object", "40 00 30 00 00 00 00 00", "80 00 30 00 00 00 02 06"},
    {"no object in another axis", "40 40 70 00 00 00 00 00", "80 40 70 00 00 00 02 06"},
    {"no PDO of another axis", "40 80 14 01 00 00 00 00", "80 80 14 01 00 00 02 06"},
    {"no fifth PDO", "40 04 18 01 00 00 00 00", "80 04 18 01 00 00 02 06"},
    {"no objects of a sensor", "40 30 71 01 00 00 00 00", "80 30 71 01 00 00 02 06"},
    {"no sub-index", "40 18 10 05 00 00 00 00", "80 18 10 05 11 00 09 06"},
    {"no sub-index of a variable", "40 17 10 01 00 00 00 00", "80 17 10 01 11 00 09 06"},
    {"no sub-index 4 of a TPDO", "40 00 18 04 00 00 00 00", "80 00 18 04 11 00 09 06"},
    {"read only", "23 00 10 00 01 00 00 00", "80 00 10 00 02 00 01 06"},
    {"read only, a count", "2F 18 10 00 05 00 00 00", "80 18 10 00 02 00 01 06"},
    {"read only, a text", "21 08 10 00 05 00 00 00", "80 08 10 00 02 00 01 06"},
    {"too long", "23 17 10 00 01 00 00 00", "80 17 10 00 12 00 07 06"},
    {"too long, announced", "21 17 10 00 05 00 00 00", "80 17 10 00 12 00 07 06"},
    {"too long, a text", "21 00 20 00 21 00 00 00", "80 00 20 00 12 00 07 06"},
    {"too short", "2F 17 10 00 01 00 00 00", "80 17 10 00 13 00 07 06"},
    {"too short, announced", "21 83 60 00 02 00 00 00", "80 83 60 00 13 00 07 06"},
    {"too high", "2F 29 10 01 03 00 00 00", "80 29 10 01 31 00 09 06"},
    {"too high for the drive", "23 12 40 00 E1 2E 00 00", "80 12 40 00 31 00 09 06"},
    {"too low", "23 83 60 00 00 00 00 00", "80 83 60 00 32 00 09 06"},
    {"too low, negative", "2B 5E 60 00 FF FF 00 00", "80 5E 60 00 32 00 09 06"},
    {"value: mode", "2F 60 60 00 02 00 00 00", "80 60 60 00 30 00 09 06"},
    {"value: quick stop option", "2B 5A 60 00 04 00 00 00", "80 5A 60 00 30 00 09 06"},
    {"value: homing method", "2F 98 60 00 11 00 00 00", "80 98 60 00 30 00 09 06"},
    {"value: transmission type 252", "2F 00 18 02 FC 00 00 00", "80 00 18 02 30 00 09 06"},
    {"value: a SYNC generator", "23 05 10 00 80 00 00 40", "80 05 10 00 30 00 09 06"},
    {"value: a restricted COB-ID", "23 01 18 01 01 07 00 00", "80 01 18 01 30 00 09 06"},
    {"value: an extended COB-ID", "23 01 18 01 81 02 00 20", "80 01 18 01 30 00 09 06"},
    {"value: the COB-ID of a valid PDO", "23 00 18 01 85 01 00 00", "80 00 18 01 30 00 09 06"},
    {"value: history", "2F 03 10 00 01 00 00 00", "80 03 10 00 30 00 09 06"},
    {"value: heartbeat of node 128", "23 16 10 01 64 00 80 00", "80 16 10 01 30 00 09 06"},
    {"no data", "40 03 10 01 00 00 00 00", "80 03 10 01 24 00 00 08"},
    {"cannot be stored", "23 10 10 01 01 00 00 00", "80 10 10 01 20 00 00 08"},
    {"cannot be restored", "23 11 10 01 01 00 00 00", "80 11 10 01 20 00 00 08"},
    {"state: inhibit time of a valid PDO", "2B 00 18 03 0A 00 00 00", "80 00 18 03 22 00 00 08"},
    {"state: mapping of a valid PDO", "2F 00 1A 00 00 00 00 00", "80 00 1A 00 22 00 00 08"},
    {"state: an object of a mapping in use", "23 01 1A 01 20 00 64 60", "80 01 1A 01 22 00 00 08"},
};

TEST_ON(every_refusal_has_its_abort_code, start, bench)
{
    struct boards_counters counters;
    const size_t count = sizeof refusals / sizeof *refusals;

    for (size_t i = 0; i < count; i++) {
        sdo(bench, 4, refusals[i].request, refusals[i].answer);
    }
    counters = bench_counters(bench);
    assert_int_equal(counters.unknown + counters.malformed, count);
}

TEST_ON(segments_out_of_order_are_aborted, start, bench)
{
    /* the toggle bit, up and down */
    sdo(bench, 4, "40 08 10 00 00 00 00 00", "41 08 10 00 0F 00 00 00");
    sdo(bench, 4, "70 00 00 00 00 00 00 00", "80 08 10 00 00 00 03 05");
    sdo(bench, 4, "21 00 20 00 0A 00 00 00", "60 00 20 00 00 00 00 00");
    sdo(bench, 4, "00 61 62 63 64 65 66 67", "20 00 00 00 00 00 00 00");
    sdo(bench, 4, "09 68 69 6A 00 00 00 00", "80 00 20 00 00 00 03 05");

    /* more and less than announced, and more than there is room for */
    sdo(bench, 4, "21 00 20 00 03 00 00 00", "60 00 20 00 00 00 00 00");
    sdo(bench, 4, "01 61 62 63 64 65 66 67", "80 00 20 00 10 00 07 06");
    sdo(bench, 4, "21 00 20 00 09 00 00 00", "60 00 20 00 00 00 00 00");
    sdo(bench, 4, "01 61 62 63 64 65 66 67", "80 00 20 00 10 00 07 06");
    sdo(bench, 4, "20 00 20 00 00 00 00 00", "60 00 20 00 00 00 00 00");
    for (int i = 0; i < 4; i++) {
        sdo(bench, 4, i % 2 ? "10 61 62 63 64 65 66 67" : "00 61 62 63 64 65 66 67",
            i % 2 ? "30 00 00 00 00 00 00 00" : "20 00 00 00 00 00 00 00");
    }
    sdo(bench, 4, "01 61 62 63 64 65 66 67", "80 00 20 00 12 00 07 06");

    /* a number in segments of a wrong length in all */
    sdo(bench, 4, "20 17 10 00 00 00 00 00", "60 17 10 00 00 00 00 00");
    sdo(bench, 4, "0D 01 00 00 00 00 00 00", "80 17 10 00 13 00 07 06");

    /* segments of nothing */
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "80 17 10 00 01 00 04 05");
}

TEST_ON(a_request_of_another_length_is_counted_and_not_answered, start, bench)
{
    bench_say(bench, 0, 0x604, "40 00 10 00 00 00 00");
    assert_int_equal(bench_sent(bench, 0, 0x584), 0);
    assert_int_equal(bench_counters(bench).malformed, 1);
}

TEST_ON(gains_change_only_while_the_bridge_is_open, start, bench)
{
    WRITE(0x4014, 1, 4, 100);
    WRITE(0x6060, 0, 1, 0xff);
    WRITE(0x6040, 0, 2, 6);
    WRITE(0x6040, 0, 2, 7);
    WRITE(0x6040, 0, 2, 15);
    assert_int_equal(sdo_write(bench, 0, 4, 0x4014, 1, 4, 200), 0x08000022);
    assert_int_equal(sdo_write(bench, 0, 4, 0x1010, 1, 4, 0x65766173), 0x08000022);
    WRITE(0x6040, 0, 2, 0);
    WRITE(0x4014, 1, 4, 200);
    assert_int_equal(READ(0x4014, 1), 200);
}

/* ---- a simple model of the whole dictionary ---- */

/* A variable of the dictionary that keeps what is written within its range, whatever the drive
 * does: values, bounds and type are the model's own. */
static const struct variable {
    uint16_t index;
    uint8_t sub, bytes;
    int64_t low, high, initial;
} variables[] = {
    {0x100c, 0, 2, 0, 65535, 0},
    {0x100d, 0, 1, 0, 255, 0},
    {0x1015, 0, 2, 0, 65535, 0},
    {0x1029, 1, 1, 0, 2, 0},
    {0x6007, 0, 2, 0, 3, 1},
    {0x605b, 0, 2, 0, 1, 0},
    {0x605d, 0, 2, 1, 2, 1},
    {0x605e, 0, 2, 0, 2, 2},
    {0x6065, 0, 4, 0, 4294967295, 4294967295},
    {0x6066, 0, 2, 0, 65535, 0},
    {0x606d, 0, 2, 0, 65535, 5000},
    {0x6072, 0, 2, 0, 65535, 1000},
    {0x607c, 0, 4, -2147483648, 2147483647, 0},
    {0x6083, 0, 4, 1, 4294967295, 1000000},
    {0x6087, 0, 4, 1, 4294967295, 1000000},
    {0x6099, 2, 4, 0, 4294967295, 10000},
    {0x60b2, 0, 2, -32768, 32767, 0},
    {0x60c2, 1, 1, 1, 255, 1},
    {0x4011, 0, 2, 0, 65535, 0},
    {0x4016, 0, 4, 0, 1000000000, 400},
};

enum { VARIABLES = sizeof variables / sizeof *variables };

static bool variable_is_signed(const struct variable *v)
{
    return v->low < 0 || (v->index >= 0x6007 && v->index <= 0x605e) || v->index == 0x4016;
}

static int64_t variable_of_data(const struct variable *v, uint32_t data)
{
    int shift = 64 - 8 * v->bytes;

    return variable_is_signed(v) ? (int64_t)((uint64_t)data << shift) >> shift
                                 : (int64_t)((uint64_t)data << shift >> shift);
}

/* One random read or write of some variable, or of none; the answer must be the model's. */
static void exchange_at_random(struct board_bench *bench, struct random_stream *random,
                               int64_t value[2][VARIABLES])
{
    unsigned axis = (unsigned)(random_bits(random) >> 40) & 1, answer;
    unsigned which = (unsigned)(random_bits(random) >> 33) % (VARIABLES + 1);
    bool write = random_bits(random) >> 63;
    uint32_t data = (uint32_t)(random_bits(random) >> 32), got;
    const struct variable *v = &variables[which % VARIABLES];
    unsigned bytes = random_bits(random) >> 61 ? v->bytes : 1 + (data & 3);
    unsigned index = v->index + (v->index >= 0x4000 ? 0x800 * axis : 0);

    axis = v->index >= 0x4000 ? axis : 0;
    if (which == VARIABLES) { /* sub-indices that are not there */
        got = sdo_exchange(bench, 0, 4, 0x40, index, v->sub + 7, 0, &answer);
        assert_int_equal(answer, 0x80);
        assert_int_equal(got, 0x06090011);
        return;
    }
    if (data & 0x100) { /* small values are often in range, others seldom */
        data &= 0xff000003;
    }
    if (!write) {
        uint32_t mask = v->bytes == 4 ? UINT32_MAX : (UINT32_C(1) << 8 * v->bytes) - 1;

        got = sdo_exchange(bench, 0, 4, 0x40, index, v->sub, 0, &answer);
        assert_int_equal(answer, 0x43 | (4 - v->bytes) << 2);
        assert_int_equal(got, (uint32_t)value[axis][which] & mask);
        return;
    }
    got = sdo_exchange(bench, 0, 4, 0x23 | (4 - bytes) << 2, index, v->sub, data, &answer);
    if (bytes != v->bytes) {
        assert_int_equal(answer, 0x80);
        assert_int_equal(got, bytes > v->bytes ? 0x06070012 : 0x06070013);
    } else if (variable_of_data(v, data) > v->high || variable_of_data(v, data) < v->low) {
        assert_int_equal(answer, 0x80);
        assert_int_equal(got, variable_of_data(v, data) > v->high ? 0x06090031 : 0x06090032);
    } else {
        assert_int_equal(answer, 0x60);
        assert_int_equal(got, 0);
        value[axis][which] = variable_of_data(v, data);
    }
}

/* The mapping of the process data: RPDO 2 of node 4 has three of the variables, TPDO 2 both
 * encoders' difference and the rotor, of axis 0. */
static void map_process_data(struct board_bench *bench)
{
    static const struct {
        uint16_t index;
        uint8_t sub, bytes;
        uint32_t value;
    } writes[] = {
        {0x1601, 0, 1, 0},          {0x1601, 1, 4, 0x60b20010}, {0x1601, 2, 4, 0x60720010},
        {0x1601, 3, 4, 0x60830020}, {0x1601, 0, 1, 3},          {0x1401, 1, 4, 0x304},
        {0x1a01, 0, 1, 0},          {0x1a01, 1, 4, 0x40040010}, {0x1a01, 2, 4, 0x40030020},
        {0x1a01, 0, 1, 2},          {0x1801, 2, 1, 1},          {0x1801, 1, 4, 0x284}};

    for (size_t i = 0; i < sizeof writes / sizeof *writes; i++) {
        assert_int_equal(sdo_write(bench, 0, 4, writes[i].index, writes[i].sub, writes[i].bytes,
                                   writes[i].value),
                         0);
    }
    nmt(bench, CIA402_NMT_START, 4);
}

/* What a variable of the model has after a PDO. */
static void take_from_pdo(int64_t value[VARIABLES], unsigned index, uint32_t data)
{
    for (int i = 0; i < VARIABLES; i++) {
        if (variables[i].index == index) {
            int64_t wanted = variable_of_data(&variables[i], data);

            value[i] =
                wanted >= variables[i].low && wanted <= variables[i].high ? wanted : value[i];
        }
    }
}

/* A random RPDO, and the TPDO that answers the SYNC. */
static void exchange_process_data(struct board_bench *bench, struct random_stream *random,
                                  int64_t value[2][VARIABLES])
{
    uint64_t data = random_bits(random) & (random_bits(random) >> 63 ? UINT64_MAX : 0xffffffff);
    struct bus_frame frame = {.id = 0x304, .len = 8};
    const struct bus_frame *answer;
    int32_t motor = (int32_t)(random_bits(random) >> 48) - 32768;
    int32_t deflection = (int32_t)(random_bits(random) >> 50) - 8192;

    put_u32_le(frame.data, (uint32_t)data);
    put_u32_le(frame.data + 4, (uint32_t)(data >> 32));
    boards_receive(bench->boards, bench->now_ns, 0, &frame);
    take_from_pdo(value[0], 0x60b2, data & 0xffff);
    take_from_pdo(value[0], 0x6072, data >> 16 & 0xffff);
    take_from_pdo(value[0], 0x6083, (uint32_t)(data >> 32));

    /* encoders of the bench have 65000 and 10000 ticks a rad; multiples of both are exact */
    bench->sense[0].qm = motor * 20e-5;
    bench->sense[0].q = (motor - deflection) * 20e-5;
    bench_say(bench, 0, CIA402_SYNC, "");
    assert_int_equal(bench_sent(bench, 0, 0x284), 1);
    answer = bench_find(bench, 0, 0x284);
    assert_int_equal(answer->len, 6);
    assert_int_equal(get_i32_le(answer->data + 2), motor * 20);
    assert_int_equal(get_i16_le(answer->data), deflection * 20 > 32767    ? 32767
                                               : deflection * 20 < -32768 ? -32768
                                                                          : deflection * 20);
}

TEST_ON(random_exchanges_agree_with_a_simple_model, start, bench)
{
    const char *wanted = getenv("CIA402_EXCHANGES");
    long exchanges = wanted ? atol(wanted) : 1000000;
    struct random_stream random = random_named(1, "cia402 exchanges");
    int64_t value[2][VARIABLES];

    map_process_data(bench);
    for (int i = 0; i < VARIABLES; i++) {
        value[0][i] = value[1][i] = variables[i].initial;
    }
    for (long i = 0; i < exchanges; i++) {
        if (random_bits(&random) >> 62) {
            exchange_at_random(bench, &random, value);
        } else {
            exchange_process_data(bench, &random, value);
        }
    }
}
