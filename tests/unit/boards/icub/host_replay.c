/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a real iCub host (canLoader, then yarprobotinterface with canBusMotionControl and
 * canBusFtSensor) sent to a leg: host_replay.log, recorded on the host's side. Every frame is sent
 * at its time, and all that the boards say is judged by the message tables of the protocol, none of
 * it by our code: which answers, in which order, nothing else, and telemetry in its slots.
 */
#include "tests/unit/boards/board_bench.h"

#include "canbus/candump.h"

#define REPLAY_LOG HIL_SOURCE_DIR "/tests/unit/boards/icub/host_replay.log"

enum { REPLAY_FRAMES = 155, MOTORS = 3, ADDRESSES = 16, ANSWERS = 64 };

struct answer {
    uint32_t id;
    uint8_t len, data[8];
};

/* What a host knows of the bus, by its own commands and the protocol. */
struct replay {
    struct board_bench bench;
    struct answer expected[ANSWERS]; /* in this tick, in this order */
    size_t nexpected;
    uint8_t kept[ADDRESSES][256][8]; /* the last data of each command, by address and first byte */
    bool policy[ADDRESSES], sends[ADDRESSES];
    int64_t policy_ms[ADDRESSES], sends_ms[ADDRESSES], last_ms[ADDRESSES][16];
    int64_t status_ms[ADDRESSES];
    uint8_t mode;    /* of axis 0 of board 1, the only one that is switched on */
    int64_t mode_ms; /* since when */
    bool mode_told;  /* in STATUS */
    int reference;   /* PWM of that axis */
    unsigned text;   /* number of its next PRINT */
    char texts[256];
    unsigned judged, telemetry;
};

static int64_t now_ms(const struct replay *replay)
{
    return replay->bench.now_ns / 1000000;
}

/* ---- what the protocol asks of the boards ---- */

static struct answer *expect(struct replay *replay, uint32_t id, size_t len, const void *data)
{
    struct answer *answer = &replay->expected[replay->nexpected++];

    assert_true(replay->nexpected <= ANSWERS && len <= 8);
    *answer = (struct answer){.id = id, .len = (uint8_t)len};
    memcpy(answer->data, data, len);
    return answer;
}

static bool is_motor(unsigned address)
{
    return address >= 1 && address <= MOTORS;
}

static bool is_strain(unsigned address)
{
    return address == 0x0c || address == 0x0d;
}

static void expect_discovery(struct replay *replay)
{
    for (unsigned a = 1; a < ADDRESSES; a++) {
        if (is_motor(a)) { /* BLL, build 87: less makes a host warn */
            expect(replay, 0x700 | a << 4, 5, (const uint8_t[]){0xff, 4, 2, 0x51, 87});
        } else if (is_strain(a)) {
            expect(replay, 0x700 | a << 4, 5, (const uint8_t[]){0xff, 6, 3, 0, 5});
        }
    }
}

/* 32 characters in eight parts: at first the name of the board. */
static void expect_info(struct replay *replay, unsigned address)
{
    char name[33] = "";

    for (size_t i = 0; i < replay->bench.config.nboard; i++) {
        if (replay->bench.board[i].address == address) {
            snprintf(name, sizeof name, "%s", replay->bench.board[i].name);
        }
    }
    for (uint8_t part = 0; part < 8; part++) {
        struct answer *answer =
            expect(replay, 0x700 | address << 4, 6, (const uint8_t[]){0x0c, part, 0, 0, 0, 0});

        memcpy(answer->data + 2, name + 4 * part, 4);
    }
}

/* GET of a parameter of the position PID: what the SET before it, one code less, has brought. */
static void expect_parameter(struct replay *replay, unsigned address, uint8_t code, size_t len)
{
    struct answer *answer = expect(replay, address << 4, len, (const uint8_t[8]){code});

    memcpy(answer->data + 1, replay->kept[address][code - 1] + 1, len - 1);
}

static void judge_mode(struct replay *replay, unsigned address, uint8_t code, uint8_t mode)
{
    bool idle = mode == 0x00 || mode == 0x09;

    if (address != 1 || code != 0x09) {
        assert_true(idle); /* the host leaves the others off */
        return;
    }
    mode = idle ? 0x00 : mode;
    if (mode != replay->mode) {
        replay->mode = mode;
        replay->mode_ms = now_ms(replay);
        replay->mode_told = false;
        replay->reference = 0;
    }
}

static void expect_motor_answer(struct replay *replay, unsigned address,
                                const struct bus_frame *frame)
{
    uint8_t code = frame->data[0], command = code & 0x7f;

    switch (command) {
    case 0x5b: { /* acknowledged when our major is the host's and our minor at least the host's */
        uint8_t ack = frame->data[1] == 1 && frame->data[2] <= 6;

        expect(replay, address << 4, 8, (const uint8_t[]){code, 4, 2, 0x51, 87, 1, 6, ack});
        break;
    }
    case 0x1f:
    case 0x21:
    case 0x23:
    case 0x25:
    case 0x27:
    case 0x29:
    case 0x2b:
        expect_parameter(replay, address, code, 3);
        break;
    case 0x5e:
        expect_parameter(replay, address, code, 5);
        break;
    case 0x73:
        expect(
            replay, address << 4, 3,
            (const uint8_t[]){code, (uint8_t)replay->reference, (uint8_t)(replay->reference >> 8)});
        break;

    /* SET is not answered */
    case 0x09:
        judge_mode(replay, address, code, frame->data[1]);
        break;
    case 0x49:
        assert_int_equal(frame->data[1], 0x7f);
        replay->policy_ms[address] =
            replay->policy[address] ? replay->policy_ms[address] : now_ms(replay);
        replay->policy[address] = true;
        break;
    case 0x72:
        replay->reference = (int16_t)get_u16_le(frame->data + 1);
        break;
    default:
        break;
    }
    memcpy(replay->kept[address][code], frame->data, 8);
}

static void expect_strain_answer(struct replay *replay, unsigned address,
                                 const struct bus_frame *frame)
{
    /* Full scales as configured, big-endian, as plain integers; serial numbers are free */
    static const uint16_t ft_scale[] = {2000, 2000, 2000, 40, 40, 40};
    uint16_t scale = address == 0x0d ? ft_scale[frame->data[1] % 6] : 55;
    char serial[9];

    switch (frame->data[0]) {
    case 0x1a:
        snprintf(serial, sizeof serial, "\x1aSIM00%02X", address);
        expect(replay, 0x200 | address << 4, 8, serial);
        break;
    case 0x1c: /* the loader states protocol 0.0 */
        expect(replay, 0x200 | address << 4, 8, (const uint8_t[]){0x1c, 6, 3, 0, 5, 1, 0, 0});
        break;
    case 0x18:
        expect(replay, 0x200 | address << 4, 4,
               (const uint8_t[]){0x18, frame->data[1], (uint8_t)(scale >> 8), (uint8_t)scale});
        break;
    case 0x07:
        assert_int_equal(frame->data[1], 0); /* calibrated, from now on */
        replay->sends[address] = true;
        replay->sends_ms[address] = now_ms(replay);
        break;
    default:
        assert_int_equal(frame->data[0], 0x08);
        assert_int_equal(frame->data[1], 5); /* ms */
        break;
    }
}

static void replay_frame(struct replay *replay, const struct bus_frame *frame)
{
    unsigned cls = frame->id >> 8, address = frame->id & 0xf;

    assert_int_equal(frame->id >> 4 & 0xf, 0); /* from the host */
    if (cls == 7 && frame->data[0] == 0xff) {
        assert_int_equal(address, 15);
        expect_discovery(replay);
    } else if (cls == 7) {
        assert_int_equal(frame->data[0], 0x0c);
        expect_info(replay, address);
    } else if (cls == 2) {
        assert_true(is_strain(address));
        expect_strain_answer(replay, address, frame);
    } else {
        assert_true(cls == 0 && is_motor(address));
        expect_motor_answer(replay, address, frame);
    }
    boards_receive(replay->bench.boards, replay->bench.now_ns, 0, frame);
    replay->judged++;
}

/* ---- what they say ---- */

static void judge_print(struct replay *replay, const struct bus_frame *frame)
{
    size_t used = strlen(replay->texts);
    unsigned part = frame->data[1] & 0xf;

    /* A host has room for texts 0 to 3, and drops others */
    assert_int_equal(frame->data[1] >> 4, replay->text % 4);
    snprintf(replay->texts + used, sizeof replay->texts - used, "%s%.*s", part ? "" : "|",
             frame->len - 2, (const char *)frame->data + 2);
    replay->text += frame->data[0] >> 7;
}

static void judge_status(struct replay *replay, unsigned address, const struct bus_frame *frame)
{
    const uint8_t expected[8] = {0, address == 1 ? replay->mode : 0};
    bool changed = address == 1 && !replay->mode_told;

    /* Slot 2, and only with a change or every 5 s */
    assert_int_equal(now_ms(replay) % 4, 3);
    assert_memory_equal(frame->data, expected, 8);
    assert_true(changed || now_ms(replay) - replay->status_ms[address] >= 5000);
    replay->status_ms[address] = changed ? replay->status_ms[address] : now_ms(replay);
    replay->mode_told = replay->mode_told || address == 1;
}

static void judge_motor_telemetry(struct replay *replay, unsigned address,
                                  const struct bus_frame *frame)
{
    static const int slot[] = {[1] = 0, [2] = 1, [3] = 2, [4] = 3, [7] = 3, [12] = 2};
    unsigned type = frame->id & 0xf;
    int64_t *last = &replay->last_ms[address][type];
    const struct motor_sense *sense = &replay->bench.sense[2 * (address - 1)];

    assert_true(replay->policy[address]); /* silence before */
    if (type == 6) {
        judge_print(replay, frame);
        return;
    }
    assert_true(type == 1 || type == 2 || type == 3 || type == 4 || type == 7 || type == 12);
    assert_int_equal((now_ms(replay) - 1) % 4, slot[type]);
    if (type == 3) {
        assert_int_equal(frame->len, 8);
        judge_status(replay, address, frame);
    } else if (type != 12) {
        int pwm = address == 1 && replay->mode == 0x50 ? replay->reference : 0;

        /* Every 4 ms without a gap */
        assert_true(now_ms(replay) - (*last ? *last : replay->policy_ms[address]) <= 4);
        assert_int_equal(frame->len, 8);
        if (type == 1) {
            assert_int_equal(get_i32_le(frame->data), sense[0].q * TICKS_PER_RAD);
        } else if (type == 2) {
            assert_int_equal((int16_t)get_u16_le(frame->data), pwm);
            assert_int_equal((int16_t)get_u16_le(frame->data + 4), pwm);
            assert_int_equal(get_u16_le(frame->data + 2), 0);
            assert_int_equal(get_u16_le(frame->data + 6), 0);
        } else if (type == 4) {
            assert_int_equal((int16_t)get_u16_le(frame->data), 250 * (int)address);
        } else {
            assert_int_equal(get_i32_le(frame->data), 0); /* it does not move */
        }
    }
    *last = now_ms(replay);
    replay->telemetry++;
}

/* fx = 500 N of 2000, tz = -10 N m of 40; joint 0 has 27.5 N m of 55. */
static void judge_strain_telemetry(struct replay *replay, unsigned address,
                                   const struct bus_frame *frame)
{
    unsigned type = frame->id & 0xf;
    int64_t *last = &replay->last_ms[address][type];
    bool ft = address == 0x0d;

    assert_true(replay->sends[address]);
    assert_true(type == 0xa || type == 0xb);
    assert_int_equal(frame->len, 6);
    assert_true(now_ms(replay) - (*last ? *last : replay->sends_ms[address]) <= 5);
    if (*last) {
        assert_int_equal(now_ms(replay) - *last, 5);
    }
    assert_int_equal(get_u16_le(frame->data), type == 0xb ? 0x8000 : ft ? 0xa000 : 0xc000);
    assert_int_equal(get_u16_le(frame->data + 4), type == 0xb && ft ? 0x6000 : 0x8000);
    *last = now_ms(replay);
    replay->telemetry++;
}

static void judge_answer(struct replay *replay, size_t *answered, const struct bus_frame *frame)
{
    const struct answer *expected = &replay->expected[*answered];

    if (*answered == replay->nexpected) {
        fail_msg("frame %u: answer 0x%03x %02x too many", replay->judged, (unsigned)frame->id,
                 frame->data[0]);
    }
    if (frame->id != expected->id || frame->len != expected->len ||
        memcmp(frame->data, expected->data, frame->len) != 0) {
        fail_msg("frame %u: answer 0x%03x %02x %02x %02x of %d bytes, not 0x%03x %02x %02x %02x "
                 "of %d",
                 replay->judged, (unsigned)frame->id, frame->data[0], frame->data[1],
                 frame->data[2], frame->len, (unsigned)expected->id, expected->data[0],
                 expected->data[1], expected->data[2], expected->len);
    }
    ++*answered;
}

static void replay_tick(struct replay *replay)
{
    struct board_bench *bench = &replay->bench;
    size_t answered = 0;

    bench_tick(bench);
    for (size_t i = 0; i < bench->count[0]; i++) {
        const struct bus_frame *frame = &bench->frame[0][i];
        unsigned cls = frame->id >> 8, address = frame->id >> 4 & 0xf;

        if (cls == 1) {
            assert_true(is_motor(address));
            judge_motor_telemetry(replay, address, frame);
        } else if (cls == 3) {
            assert_true(is_strain(address));
            judge_strain_telemetry(replay, address, frame);
        } else {
            judge_answer(replay, &answered, frame);
        }
    }

    /* Nothing is missing: answers within the tick, the mode within the next slot 2 */
    if (answered != replay->nexpected) {
        fail_msg("frame %u: %zu of %zu answers", replay->judged, answered, replay->nexpected);
    }
    replay->nexpected = 0;
    assert_true(replay->mode_told || now_ms(replay) - replay->mode_ms < 4);
    for (unsigned a = 1; a <= MOTORS; a++) {
        assert_true(!replay->policy[a] || !replay->last_ms[a][1] ||
                    now_ms(replay) - replay->last_ms[a][1] < 4);
    }
    assert_int_equal(bench->motor[0].bridge_on, replay->mode == 0x50);
    assert_near(bench->motor[0].voltage_v,
                replay->mode == 0x50 ? SUPPLY_V * replay->reference / 1333 : 0.0, 1e-12);
    assert_false(bench->motor[1].bridge_on);
}

/* ---- the leg, and the log ---- */

static void open_leg(struct replay *replay)
{
    struct board_bench *bench = &replay->bench;

    memset(replay, 0, sizeof *replay);
    replay->mode_told = true;
    bench_configure(bench);
    bench->board[1] = bench_motor("leg 2", 0, 2, 2, 3);
    bench->board[4] = bench_motor("leg 3", 0, 3, 4, -1);
    memcpy(bench->board[3].full_scale, (const double[]){2000, 2000, 2000, 40, 40, 40},
           sizeof bench->board[3].full_scale);
    for (size_t i = 0; i < BENCH_BOARDS; i++) {
        bench->board[i].strict = true;
        bench->board[i].command_timeout_ns = 100000000;
    }
    for (int j = 0; j < BENCH_JOINTS; j++) {
        bench->sense[j].q = 0.1 * (j + 1);
        bench->sense[j].current_a = 0.25 * (j / 2 + 1);
    }
    bench->sense[0].torque_nm = 27.5;
    bench->ft.force_n[0] = 500.0;
    bench->ft.torque_nm[2] = -10.0;
    bench_start(bench);
}

TEST(every_answer_to_a_real_host_is_the_protocols)
{
    static struct replay replay;
    struct candump_reader reader;
    struct bus_frame frame;
    struct error error;
    int64_t first_ns = -1;
    char bus[16];
    bool end = false;

    open_leg(&replay);
    assert_no_error(candump_open(&reader, REPLAY_LOG, &error), error.text);
    for (;;) {
        assert_no_error(candump_next(&reader, &frame, bus, &end, &error), error.text);
        if (end) {
            break;
        }
        first_ns = first_ns < 0 ? frame.time_ns : first_ns;
        while (now_ms(&replay) < (frame.time_ns - first_ns) / 1000000) {
            replay_tick(&replay);
        }
        replay_frame(&replay, &frame);
    }
    candump_close(&reader);
    for (int i = 0; i < 100; i++) {
        replay_tick(&replay);
    }

    /* All of it was heard, known and well-formed, and the boards told what they did */
    assert_int_equal(replay.judged, REPLAY_FRAMES);
    assert_int_equal(bench_counters(&replay.bench).frames, REPLAY_FRAMES);
    assert_int_equal(bench_counters(&replay.bench).unknown, 0);
    assert_int_equal(bench_counters(&replay.bench).malformed, 0);
    assert_int_equal(bench_counters(&replay.bench).foreign, 0);
    assert_int_equal(bench_counters(&replay.bench).overflows, 0);
    assert_int_equal(replay.mode, 0x00);
    assert_string_equal(replay.texts, "|CMODE SET:80|PWM ENA:0|PWM DIS:0");
    assert_true(replay.telemetry > 3 * 4 * 10000 / 4);
    bench_stop(&replay.bench);
}
