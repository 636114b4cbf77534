/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Block transfers of the SDO server: exchanges written down byte by byte from CiA 301, 7.2.4.3.8 to
 * 7.2.4.3.17, every abort code, and a client on a lossy line with a checksum of its own.
 */
#include "tests/unit/boards/cia402/cia402_bench.h"

#include "base/random.h"

enum { REQUEST = 0x604, REPLY = 0x584, DOMAIN_INDEX = 0x2001 };

/* Sends a request that has no answer in this tick. */
static void say(struct board_bench *bench, const char *request)
{
    bench_say(bench, 0, REQUEST, request);
    assert_int_equal(bench_sent(bench, 0, REPLY), 0);
}

/* ---- exchanges ---- */

/* 31C3 is the checksum that the standard gives for these nine bytes. */
TEST_ON(blocks_carry_the_check_value_of_the_standard, start, bench)
{
    /* down: 7 and 2 bytes, n = 5 */
    sdo(bench, 4, "C6 00 20 00 09 00 00 00", "A4 00 20 00 7F 00 00 00");
    say(bench, "01 31 32 33 34 35 36 37");
    sdo(bench, 4, "82 38 39 00 00 00 00 00", "A2 02 7F 00 00 00 00 00");
    sdo(bench, 4, "D5 C3 31 00 00 00 00 00", "A1 00 00 00 00 00 00 00");

    /* up: a segment a millisecond */
    sdo(bench, 4, "A4 00 20 00 7F 00 00 00", "C6 00 20 00 09 00 00 00");
    sdo(bench, 4, "A3 00 00 00 00 00 00 00", "01 31 32 33 34 35 36 37");
    bench_tick(bench);
    bench_expect(bench, 0, REPLY, "82 38 39 00 00 00 00 00");
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, REPLY), 0);
    sdo(bench, 4, "A2 02 7F 00 00 00 00 00", "D5 C3 31 00 00 00 00 00");
    say(bench, "A1 00 00 00 00 00 00 00");

    /* without a checksum, and without a size */
    sdo(bench, 4, "C0 00 20 00 00 00 00 00", "A4 00 20 00 7F 00 00 00");
    sdo(bench, 4, "81 61 62 63 00 00 00 00", "A2 01 7F 00 00 00 00 00");
    sdo(bench, 4, "D1 00 00 00 00 00 00 00", "A1 00 00 00 00 00 00 00");
    sdo(bench, 4, "A0 00 20 00 7F 00 00 00", "C6 00 20 00 03 00 00 00");
    sdo(bench, 4, "A3 00 00 00 00 00 00 00", "81 61 62 63 00 00 00 00");
    sdo(bench, 4, "A2 01 7F 00 00 00 00 00", "D1 00 00 00 00 00 00 00");
    say(bench, "A1 00 00 00 00 00 00 00");

    /* a number, and nothing at all: a segment of seven unused bytes */
    sdo(bench, 4, "C2 17 10 00 02 00 00 00", "A4 17 10 00 7F 00 00 00");
    sdo(bench, 4, "81 E8 03 00 00 00 00 00", "A2 01 7F 00 00 00 00 00");
    sdo(bench, 4, "D5 00 00 00 00 00 00 00", "A1 00 00 00 00 00 00 00");
    assert_int_equal(READ(0x1017, 0), 1000);
    sdo(bench, 4, "A4 01 20 00 7F 00 00 00", "C6 01 20 00 00 00 00 00");
    sdo(bench, 4, "A3 00 00 00 00 00 00 00", "81 00 00 00 00 00 00 00");
    sdo(bench, 4, "A2 01 7F 00 00 00 00 00", "DD 00 00 00 00 00 00 00");
    say(bench, "A1 00 00 00 00 00 00 00");
    assert_int_equal(bench_counters(bench).unknown + bench_counters(bench).malformed, 0);
}

/* Up to the client's threshold the answer is that of an upload without blocks. */
TEST_ON(few_bytes_go_without_blocks, start, bench)
{
    sdo(bench, 4, "A4 08 10 00 7F 0F 00 00", "41 08 10 00 0F 00 00 00");
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "00 63 6F 6D 61 6E 2D 68");
    sdo(bench, 4, "70 00 00 00 00 00 00 00", "10 69 6C 20 64 72 69 76");
    sdo(bench, 4, "60 00 00 00 00 00 00 00", "0D 65 00 00 00 00 00 00");
    sdo(bench, 4, "A4 00 10 00 7F 04 00 00", "43 00 10 00 92 01 FF FF");
    sdo(bench, 4, "A4 08 10 00 7F 0E 00 00", "C6 08 10 00 0F 00 00 00");
}

/* What a gap leaves out comes again, from either side. */
TEST_ON(a_block_goes_on_after_the_last_that_was_taken, start, bench)
{
    /* the second of three is lost; the third, being the last, has the block acknowledged */
    sdo(bench, 4, "C6 00 20 00 0F 00 00 00", "A4 00 20 00 7F 00 00 00");
    say(bench, "01 63 6F 6D 61 6E 2D 68");
    sdo(bench, 4, "83 65 00 00 00 00 00 00", "A2 01 7F 00 00 00 00 00");
    say(bench, "01 69 6C 20 64 72 69 76");
    sdo(bench, 4, "82 65 00 00 00 00 00 00", "A2 02 7F 00 00 00 00 00");
    sdo(bench, 4, "D9 B3 44 00 00 00 00 00", "80 00 20 00 04 00 04 05");

    /* blocks of two; the client takes one, then blocks of one */
    sdo(bench, 4, "A0 08 10 00 02 00 00 00", "C6 08 10 00 0F 00 00 00");
    sdo(bench, 4, "A3 00 00 00 00 00 00 00", "01 63 6F 6D 61 6E 2D 68");
    bench_tick(bench);
    bench_expect(bench, 0, REPLY, "02 69 6C 20 64 72 69 76");
    sdo(bench, 4, "A2 00 02 00 00 00 00 00", "01 63 6F 6D 61 6E 2D 68");
    bench_tick(bench);
    sdo(bench, 4, "A2 01 01 00 00 00 00 00", "01 69 6C 20 64 72 69 76");
    sdo(bench, 4, "A2 01 01 00 00 00 00 00", "81 65 00 00 00 00 00 00");
    sdo(bench, 4, "A2 00 01 00 00 00 00 00", "81 65 00 00 00 00 00 00");
    sdo(bench, 4, "A2 01 01 00 00 00 00 00", "D9 00 00 00 00 00 00 00");
    say(bench, "A1 00 00 00 00 00 00 00");
}

/* ---- abort codes ---- */

#define DOWN "C6 00 20 00 09 00 00 00", "A4 00 20 00 7F 00 00 00"
#define LAST "81 31 32 33 34 35 36 37", "A2 01 7F 00 00 00 00 00"
#define UP "A4 08 10 00 01 00 00 00", "C6 08 10 00 0F 00 00 00"
#define FIRST "A3 00 00 00 00 00 00 00", "01 63 6F 6D 61 6E 2D 68"

/* What belongs to no transfer is refused with the object of the last one. */
static const struct refusal {
    const char *what;
    const char *line[8]; /* requests and answers by turns */
} refusals[] = {
    {"no block", {"A4 08 10 00 00 00 00 00", "80 08 10 00 02 00 04 05"}},
    {"a block too large", {"A4 08 10 00 80 00 00 00", "80 08 10 00 02 00 04 05"}},
    {"no next block", {UP, FIRST, "A2 01 00 00 00 00 00 00", "80 08 10 00 02 00 04 05"}},
    {"a next one too large", {UP, FIRST, "A2 01 80 00 00 00 00 00", "80 08 10 00 02 00 04 05"}},
    {"more than was sent", {UP, FIRST, "A2 02 01 00 00 00 00 00", "80 08 10 00 03 00 04 05"}},
    {"segment 0", {DOWN, "00 31 32 33 34 35 36 37", "80 00 20 00 03 00 04 05"}},
    {"checksum",
     {"C6 00 20 00 07 00 00 00", "A4 00 20 00 7F 00 00 00", LAST, "C1 00 00 00 00 00 00 00",
      "80 00 20 00 04 00 04 05"}},
    {"fewer than announced", {DOWN, LAST, "C1 00 00 00 00 00 00 00", "80 00 20 00 10 00 07 06"}},
    {"no end", {DOWN, LAST, "40 00 10 00 00 00 00 00", "80 00 20 00 01 00 04 05"}},
    {"no start", {UP, "A2 01 01 00 00 00 00 00", "80 08 10 00 01 00 04 05"}},
    {"two starts", {UP, FIRST, "A3 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05"}},
    {"an end too early", {UP, FIRST, "A1 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05"}},
    {"a segment of an upload in one of blocks",
     {UP, FIRST, "60 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05"}},
    {"an end of nothing", {"C1 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05"}},
    {"a start of nothing", {"A3 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05"}},
    {"no object, up", {"A4 00 30 00 7F 00 00 00", "80 00 30 00 00 00 02 06"}},
    {"no object, down", {"C6 00 30 00 01 00 00 00", "80 00 30 00 00 00 02 06"}},
    {"no sub-index", {"C6 18 10 05 01 00 00 00", "80 18 10 05 11 00 09 06"}},
    {"no data", {"A4 03 10 01 7F 00 00 00", "80 03 10 01 24 00 00 08"}},
    {"read only", {"C6 08 10 00 05 00 00 00", "80 08 10 00 02 00 01 06"}},
    {"a text too long", {"C6 00 20 00 21 00 00 00", "80 00 20 00 12 00 07 06"}},
    {"a domain too long", {"C6 01 20 00 01 04 00 00", "80 01 20 00 12 00 07 06"}},
    {"a number too long", {"C6 17 10 00 03 00 00 00", "80 17 10 00 12 00 07 06"}},
    {"a number too short", {"C6 17 10 00 01 00 00 00", "80 17 10 00 13 00 07 06"}},
    {"a number too short at the end",
     {"C0 17 10 00 00 00 00 00", "A4 17 10 00 7F 00 00 00", "81 01 00 00 00 00 00 00",
      "A2 01 7F 00 00 00 00 00", "D9 00 00 00 00 00 00 00", "80 17 10 00 13 00 07 06"}},
    {"a number too high",
     {"C2 29 10 01 01 00 00 00", "A4 29 10 01 7F 00 00 00", "81 03 00 00 00 00 00 00",
      "A2 01 7F 00 00 00 00 00", "D9 00 00 00 00 00 00 00", "80 29 10 01 31 00 09 06"}},
};

TEST_ON(every_refusal_of_blocks_has_its_abort_code, start, bench)
{
    const size_t count = sizeof refusals / sizeof *refusals;
    struct boards_counters counters;

    for (size_t i = 0; i < count; i++) {
        for (int line = 0; line < 8 && refusals[i].line[line]; line += 2) {
            sdo(bench, 4, refusals[i].line[line], refusals[i].line[line + 1]);
        }
        bench_tick(bench); /* and nothing after it */
        assert_int_equal(bench_sent(bench, 0, REPLY), 0);
    }
    counters = bench_counters(bench);
    assert_int_equal(counters.unknown + counters.malformed, count);
    assert_int_equal(READ(0x1017, 0), 0);
}

/* 147 segments are more than a domain has; whether they were too many is seen at the end. */
TEST_ON(what_no_size_announced_is_held_within_the_object, board_bench, bench)
{
    for (unsigned segments = 147; segments <= 148; segments++) {
        start(bench);
        sdo(bench, 4, "C0 01 20 00 00 00 00 00", "A4 01 20 00 7F 00 00 00");
        for (unsigned i = 1; i <= segments; i++) {
            uint8_t number = (uint8_t)(i <= 127 ? i : i - 127);
            struct bus_frame frame = {
                .id = REQUEST, .len = 8, .data = {(uint8_t)(number | (i == 147 ? 0x80 : 0))}};

            frame.data[0] &= segments == 148 ? 0x7f : 0xff;
            boards_receive(bench->boards, bench->now_ns, 0, &frame);
            bench_tick(bench);
        }
        if (segments == 147) {
            bench_expect(bench, 0, REPLY, "A2 14 7F 00 00 00 00 00");
            sdo(bench, 4, "D1 00 00 00 00 00 00 00", "80 01 20 00 12 00 07 06");
        } else {
            bench_expect(bench, 0, REPLY, "80 01 20 00 12 00 07 06");
        }
    }
}

/* ---- ends ---- */

TEST_ON(an_abort_or_a_new_request_ends_a_block_transfer, start, bench)
{
    sdo(bench, 4, DOWN);
    say(bench, "01 31 32 33 34 35 36 37");
    say(bench, "80 00 20 00 00 00 00 08");
    sdo(bench, 4, "40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00");

    /* an upload of blocks of 127 is under way */
    sdo(bench, 4, "A4 08 10 00 7F 00 00 00", "C6 08 10 00 0F 00 00 00");
    sdo(bench, 4, FIRST);
    sdo(bench, 4, "40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00");
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, REPLY), 0);

    /* neither does a reset of communication leave one */
    sdo(bench, 4, DOWN);
    nmt(bench, CIA402_NMT_RESET_COMMUNICATION, 4);
    bench_tick(bench);
    sdo(bench, 4, "40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00");
}

TEST_ON(a_silent_client_has_its_block_transfer_aborted_after_a_second, board_bench, bench)
{
    static const char *const starts[][2] = {{DOWN}, {UP}};

    for (int i = 0; i < 2; i++) {
        start(bench);
        sdo(bench, 4, starts[i][0], starts[i][1]);
        for (int ms = 0; ms < 999; ms++) {
            bench_tick(bench);
            assert_int_equal(bench_sent(bench, 0, REPLY), 0);
        }
        bench_tick(bench);
        bench_expect(bench, 0, REPLY, i ? "80 08 10 00 00 00 04 05" : "80 00 20 00 00 00 04 05");
        sdo(bench, 4, "40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00");
    }
}

/* A stopped node has no SDO. */
TEST_ON(a_stopped_node_sends_no_segments, start, bench)
{
    sdo(bench, 4, "A4 08 10 00 7F 00 00 00", "C6 08 10 00 0F 00 00 00");
    sdo(bench, 4, FIRST);
    nmt(bench, CIA402_NMT_STOP, 4);
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, REPLY), 0);
}

/* ---- back in time ---- */

/* What a checkpoint holds: the boards' memory, and here the bench's time. */
struct kept {
    struct board_bench bench;
    unsigned char *memory;
};

static struct kept keep_moment(const struct board_bench *bench)
{
    struct kept kept = {.bench = *bench, .memory = malloc(bench->arena.used)};

    assert_non_null(kept.memory);
    arena_join(bench->arena.memory, bench->arena.used);
    memcpy(kept.memory, bench->arena.memory, bench->arena.used);
    return kept;
}

static void return_to_moment(struct board_bench *bench, struct kept *kept)
{
    *bench = kept->bench;
    memcpy(bench->arena.memory, kept->memory, bench->arena.used);
}

/* Whatever came of the transfer meanwhile, from the checkpoint on it ends as it would have. */
TEST_ON(a_block_transfer_goes_on_from_a_checkpoint, start, bench)
{
    struct kept kept;

    /* down, after the first of two segments: the other way it is aborted, and another text comes */
    sdo(bench, 4, DOWN);
    say(bench, "01 31 32 33 34 35 36 37");
    kept = keep_moment(bench);
    say(bench, "80 00 20 00 00 00 00 08");
    sdo(bench, 4, "C0 00 20 00 00 00 00 00", "A4 00 20 00 7F 00 00 00");
    sdo(bench, 4, "81 61 62 63 00 00 00 00", "A2 01 7F 00 00 00 00 00");
    sdo(bench, 4, "D1 00 00 00 00 00 00 00", "A1 00 00 00 00 00 00 00");
    return_to_moment(bench, &kept);
    sdo(bench, 4, "82 38 39 00 00 00 00 00", "A2 02 7F 00 00 00 00 00");
    sdo(bench, 4, "D5 C3 31 00 00 00 00 00", "A1 00 00 00 00 00 00 00");
    free(kept.memory);

    /* up, with one segment sent and one to come: twice the same, then the check value */
    sdo(bench, 4, "A4 00 20 00 7F 00 00 00", "C6 00 20 00 09 00 00 00");
    sdo(bench, 4, "A3 00 00 00 00 00 00 00", "01 31 32 33 34 35 36 37");
    kept = keep_moment(bench);
    for (int pass = 0; pass < 2; pass++) {
        bench_tick(bench);
        bench_expect(bench, 0, REPLY, "82 38 39 00 00 00 00 00");
        sdo(bench, 4, "A2 02 7F 00 00 00 00 00", "D5 C3 31 00 00 00 00 00");
        say(bench, "A1 00 00 00 00 00 00 00");
        if (pass == 0) {
            return_to_moment(bench, &kept);
        }
    }
    free(kept.memory);
}

/* ---- a client on a lossy line ---- */

/* The remainder of the long division of the data's bits, by its definition. */
static unsigned divide_bits(const uint8_t *data, unsigned size)
{
    unsigned remainder = 0;

    for (unsigned bit = 0; bit < 8 * size + 16; bit++) {
        unsigned in = bit < 8 * size ? data[bit / 8] >> (7 - bit % 8) & 1u : 0;

        remainder = remainder << 1 | in;
        remainder ^= remainder & 0x10000 ? 0x11021 : 0;
    }
    return remainder;
}

struct line {
    struct board_bench bench;
    struct random_stream random;
    unsigned loss; /* in 256 */
};

static bool line_loses(struct line *line)
{
    return random_bits(&line->random) >> 56 < line->loss;
}

/* Sends eight bytes, and has the answer, if there is one, in *answer. */
static bool line_ask(struct line *line, const uint8_t data[8], uint8_t answer[8])
{
    struct bus_frame frame = {.id = REQUEST, .len = 8};
    const struct bus_frame *reply;

    memcpy(frame.data, data, 8);
    boards_receive(line->bench.boards, line->bench.now_ns, 0, &frame);
    bench_tick(&line->bench);
    assert_true(bench_sent(&line->bench, 0, REPLY) <= 1);
    reply = bench_find(&line->bench, 0, REPLY);
    if (reply) {
        memcpy(answer, reply->data, 8);
    }
    return reply;
}

static void line_download(struct line *line, const uint8_t *data, unsigned size)
{
    uint8_t answer[8], request[8] = {0xc6, DOMAIN_INDEX & 0xff, DOMAIN_INDEX >> 8};
    unsigned done = 0, segments = size ? (size + 6) / 7 : 1, crc = divide_bits(data, size);

    put_u32_le(request + 4, size);
    assert_true(line_ask(line, request, answer));
    assert_int_equal(answer[0], 0xa4);
    assert_int_equal(answer[4], 127);
    while (done < segments) {
        unsigned count = segments - done < 127 ? segments - done : 127;

        for (unsigned i = 1; i <= count; i++) {
            unsigned from = 7 * (done + i - 1), left = size > from ? size - from : 0;
            bool last = done + i == segments;
            uint8_t segment[8] = {(uint8_t)(i | (last ? 0x80 : 0))};

            memcpy(segment + 1, data + from, left < 7 ? left : 7);
            if (i < count && line_loses(line)) {
                continue; /* the last of a block would be sent again after a time-out */
            }
            assert_int_equal(line_ask(line, segment, answer), i == count);
        }
        assert_int_equal(answer[0], 0xa2);
        assert_true(answer[1] <= count);
        done += answer[1];
    }
    memset(request, 0, sizeof request);
    request[0] = (uint8_t)(0xc1 | (7 * segments - size) << 2);
    put_u16_le(request + 1, (uint16_t)crc);
    assert_true(line_ask(line, request, answer));
    assert_int_equal(answer[0], 0xa1);
}

/* Takes what comes of a block in order; returns how many, and whether the last one was. */
static unsigned line_take_block(struct line *line, unsigned block, uint8_t answer[8], uint8_t *to,
                                bool *last)
{
    unsigned taken = 0;

    for (unsigned i = 1;; i++) {
        const struct bus_frame *reply;
        bool end = answer[0] & 0x80;

        assert_int_equal(answer[0] & 0x7f, i);
        assert_true(i <= block);
        if (taken == i - 1 && !line_loses(line)) {
            memcpy(to + 7 * taken, answer + 1, 7);
            taken++;
            *last = end;
        }
        if (end || i == block) {
            return taken;
        }
        bench_tick(&line->bench);
        reply = bench_find(&line->bench, 0, REPLY);
        assert_non_null(reply);
        memcpy(answer, reply->data, 8);
    }
}

static void line_upload(struct line *line, const uint8_t *data, unsigned size)
{
    unsigned block = 1 + (unsigned)(random_bits(&line->random) >> 57) % 127, done = 0;
    uint8_t request[8] = {0xa4, DOMAIN_INDEX & 0xff, DOMAIN_INDEX >> 8, 0, (uint8_t)block};
    uint8_t got[1100], answer[8], go_on[8] = {0xa3};
    struct bus_frame end = {.id = REQUEST, .len = 8, .data = {0xa1}};
    bool last = false;

    assert_true(line_ask(line, request, answer));
    assert_int_equal(answer[0], 0xc6);
    assert_int_equal(get_u32_le(answer + 4), size);
    while (!last) {
        unsigned taken;

        assert_true(line_ask(line, go_on, answer));
        assert_true(7 * (done + block) <= sizeof got + 7 * 127);
        taken = line_take_block(line, block, answer, got + 7 * done, &last);
        done += taken;
        block = 1 + (unsigned)(random_bits(&line->random) >> 57) % 127;
        memcpy(go_on, (uint8_t[]){0xa2, (uint8_t)taken, (uint8_t)block, 0}, 4);
    }
    assert_true(line_ask(line, go_on, answer));
    assert_int_equal(answer[0], 0xc1 | (7 * done - size) << 2);
    assert_int_equal(get_u16_le(answer + 1), divide_bits(data, size));
    assert_memory_equal(got, data, size);
    boards_receive(line->bench.boards, line->bench.now_ns, 0, &end);
    bench_tick(&line->bench);
    assert_int_equal(bench_sent(&line->bench, 0, REPLY), 0);
}

TEST(random_blocks_on_a_lossy_line_arrive)
{
    const char *wanted = getenv("CIA402_BLOCKS");
    long blocks = wanted ? atol(wanted) : 300;
    uint8_t data[1024];
    struct line line;

    start(&line.bench);
    line.random = random_named(1, "cia402 blocks");
    for (long i = 0; i < blocks; i++) {
        unsigned size = (unsigned)(random_bits(&line.random) >> 50) % 1025;

        size = i < 30 ? (unsigned)i : i == 30 ? 1024 : i == 31 ? 889 : i == 32 ? 890 : size;
        line.loss = i % 3 * 20;
        for (unsigned k = 0; k < size; k++) {
            data[k] = (uint8_t)(random_bits(&line.random) >> 56);
        }
        line_download(&line, data, size);
        line_upload(&line, data, size);
    }
    assert_int_equal(bench_counters(&line.bench).unknown + bench_counters(&line.bench).malformed,
                     0);
    bench_stop(&line.bench);
}

/* What was stored is there after a reset, what was not is not. */
TEST(a_domain_is_kept_when_it_was_stored)
{
    struct line line = {.loss = 0};

    start(&line.bench);
    line.random = random_named(1, "cia402 domain");
    line_download(&line, (const uint8_t *)"recipe of the day", 17);
    assert_int_equal(sdo_write(&line.bench, 0, 4, 0x1010, 1, 4, 0x65766173), 0);
    line_download(&line, (const uint8_t *)"another", 7);
    nmt(&line.bench, CIA402_NMT_RESET_NODE, 4);
    bench_ticks(&line.bench, 3);
    line_upload(&line, (const uint8_t *)"recipe of the day", 17);
    bench_stop(&line.bench);
}
