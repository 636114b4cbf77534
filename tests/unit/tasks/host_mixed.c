/* SPDX-License-Identifier: Apache-2.0 */
/* A host with another protocol on each of its buses, and anything at all on them. */
#include "boards/protocol_list.h"
#include "tests/protocol_file.h"
#include "tests/unit/tasks/host_bench.h"

static struct error error;

enum { ICUB, FOC, COMPACT };

static void play_icub(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (frame->id == 0x70f) {
        say(bench, bus, 0x710, 5, (const uint8_t[]){0xff, 4, 3, 0, 1});
    } else if (frame->id == 0x001 && frame->data[0] == 0x5b) {
        say(bench, bus, 0x010, 8, (const uint8_t[]){0x5b, 4, 3, 0, 1, 1, 6, 1});
    } else if (frame->id == 0x001 && frame->data[0] == 0x09) {
        uint8_t mode = frame->data[1] == 0x50 ? 0x50 : 0;

        say(bench, bus, 0x113, 8, (const uint8_t[]){0, mode, 0, 0xb0, 0, 0, 0, 0});
        say(bench, bus, 0x111, 8, (const uint8_t[8]){0, 4});
        say(bench, bus, 0x11a, 8, (const uint8_t[8]){0, 4});
    }
}

static void play_foc(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (frame->id == 0x70f) {
        say(bench, bus, 0x710, 5, (const uint8_t[]){0xff, 8, 3, 0, 1});
    } else if (frame->id == 0x001 && frame->data[0] == 0x5b) {
        say(bench, bus, 0x010, 8, (const uint8_t[]){0x5b, 8, 3, 0, 1, 1, 6, 1});
    } else if (frame->id == 0x10f) {
        say(bench, bus, 0x110, 8, (const uint8_t[8]){0});
        say(bench, bus, 0x113, 8, (const uint8_t[8]){0x50});
    }
}

static void play_compact(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (frame->id == 0x7e0) {
        say(bench, bus, 0x7c1, 8, (const uint8_t[]){2, 1, 0, 1, 1, 0, 12, 0});
    } else if (frame->id == 0x681) {
        say(bench, bus, 0x6a1, 7, (const uint8_t[7]){0x85});
    } else if (frame->id == 0x020) {
        say(bench, bus, 0x200, 8, (const uint8_t[8]){frame->data[0]});
        say(bench, bus, 0x100, 8, (const uint8_t[8]){0});
    }
}

static inline void set_up(struct bench *bench)
{
    static const char *const joint[] = {"one", "two", "three"};
    static struct host_axis axis[3];
    static struct host_bus bus[] = {
        {.protocol = "icub"}, {.protocol = "foc"}, {.protocol = "compact"}};
    struct host_config config = {
        .nbus = 3,
        .bus = bus,
        .naxis = 3,
        .axis = axis,
        .supply_v = 48,
        .period_ns = 1000000,
    };

    bus[COMPACT].described = protocol_file("compact");
    for (int k = 0; k < 3; k++) {
        axis[k] = (struct host_axis){.joint = joint[k],
                                     .bus = k,
                                     .address = 1,
                                     .joint_ticks_per_rad = 100,
                                     .motor_ticks_per_rad = 1000,
                                     .drive = {.gear = 100, .spring_nm_rad = 100},
                                     .torque_address = -1};
    }
    bench->play[ICUB] = play_icub;
    bench->play[FOC] = play_foc;
    bench->play[COMPACT] = play_compact;
    bench_open(bench, &config);
}

BENCH(set_up, struct bench, bench_close)

TEST_ON(each_bus_is_spoken_to_in_its_own_way, set_up, bench)
{
    reach_ready(bench);

    assert_true(host_healthy(bench->host));
    for (size_t i = 0; i < 3; i++) {
        host_set_voltage(bench->host, i, 12);
    }
    bench->nseen = 0;
    one_period(bench);
    assert_int_equal(bench->nseen, 3);
    assert_true(was_sent(bench, ICUB, 0x001, 3, (const uint8_t[]){0x72, 0x4d, 0x01}));
    assert_true(was_sent(bench, FOC, 0x10f, 8, (const uint8_t[8]){0x40, 0x1f}));
    assert_true(was_sent(bench, COMPACT, 0x040, 2, (const uint8_t[]){0x70, 0x17}));
}

/* What the host believes of its joints is a number and a state that there is. */
static void expect_sane(const struct bench *bench)
{
    for (size_t i = 0; i < 3; i++) {
        const struct host_joint *joint = host_joint(bench->host, i);

        assert_true(isfinite(joint->joint_rad) && isfinite(joint->motor_rad));
        assert_true(isfinite(joint->current_a) && isfinite(joint->torque_nm));
        assert_in_range(joint->motor, HOST_MOTOR_UNKNOWN, HOST_MOTOR_FAULT);
        assert_true(joint->motor_time_ns >= -1 && joint->motor_time_ns <= bench->now_ns);
    }
    assert_true(strlen(host_message(bench->host)) < 256);
}

/* What it has sent are frames of its own: valid ones, and none in the name of a board. */
static void expect_own_frames(const struct bench *bench)
{
    for (size_t i = 0; i < bench->nseen; i++) {
        const struct bus_frame *frame = &bench->seen[i];
        bool icub = bench->seen_bus[i] != COMPACT;

        assert_true(frame->len <= 8 && frame->id <= 0x7ff && frame->flags == 0);
        if (icub) { /* from address 0: bits 4 to 7 */
            assert_true(frame->id == 0x10f || (frame->id & 0xf0) == 0);
        }
    }
}

/* Random frames, then true ones, which count as if nothing had been. */
TEST_ON(no_frame_can_harm_the_host, set_up, bench)
{
    uint64_t random = 88172645463325252u;

    for (int i = 0; i < 300000; i++) {
        struct bus_frame frame = {0};

        for (int k = 0; k < 9; k++) { /* xorshift64 */
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            if (k < 8) {
                memcpy(frame.data + 8 * k, &random, 8);
            }
        }
        frame.id = (uint32_t)random & 0x7ff;
        frame.len = (uint8_t)((random >> 16) % 9);
        say_frame(bench, (int)((random >> 32) % 3), &frame);
        if (i % 100 == 0) {
            enum host_phase phase = host_start_up(bench->host);

            assert_in_range(phase, HOST_DISCOVERING, HOST_FAILED);
            host_set_voltage(bench->host, 1, 1);
            one_period(bench);
            expect_own_frames(bench);
            expect_sane(bench);
            bench->nseen = 0;
            host_healthy(bench->host);
        }
    }

    /* 10000 and 20000 of 100 and 1000 ticks/rad; voltage mode without a fault */
    say(bench, ICUB, 0x111, 8, (const uint8_t[8]){0x10, 0x27});
    say(bench, ICUB, 0x11a, 8, (const uint8_t[8]){0x20, 0x4e});
    say(bench, ICUB, 0x113, 8, (const uint8_t[8]){0, 0x50, 0, 0xb0});
    say(bench, FOC, 0x110, 8, (const uint8_t[8]){0});
    say(bench, FOC, 0x113, 8, (const uint8_t[8]){0x50});
    say(bench, COMPACT, 0x100, 8, (const uint8_t[8]){0});
    assert_true(host_receive(bench->host, ++bench->now_ns));
    assert_near(host_joint(bench->host, 0)->joint_rad, 100.0, 1e-12);
    assert_near(host_joint(bench->host, 0)->motor_rad, 20.0, 1e-12);
    assert_int_equal(host_joint(bench->host, 0)->motor_time_ns, bench->now_ns);
    assert_int_equal(host_joint(bench->host, 0)->motor, HOST_MOTOR_ON);
    assert_int_equal(host_joint(bench->host, 0)->fault, 0);
    assert_near(host_joint(bench->host, 1)->motor_rad, 0.0, 0.0);
    assert_int_equal(host_joint(bench->host, 1)->motor, HOST_MOTOR_ON);
    assert_near(host_joint(bench->host, 2)->motor_rad, 0.0, 0.0);
    assert_near(host_joint(bench->host, 2)->joint_rad, 0.0, 0.0);

    /* Motor boards of icub leave the torque to a board of its own */
    assert_false(host_joint(bench->host, 0)->torque_told);
    assert_true(host_joint(bench->host, 1)->torque_told);
    assert_true(host_joint(bench->host, 2)->torque_told);
}

/* What boards speak has a host, but nothing else has. */
TEST(a_bus_whose_protocol_has_no_host_is_refused)
{
    static struct described_protocol described;
    const struct protocol *protocol;
    struct host_bus bus = {.described = &described};
    const struct host_config config = {
        .nbus = 1, .bus = &bus, .supply_v = 48, .period_ns = 1000000};
    struct arena arena CLOSED_BY(arena_fini);
    struct host *host;

    assert_ok(arena_init(&arena, 1 << 20, &error));
    for (size_t i = 0; (protocol = protocol_at(i)); i++) {
        bus.protocol = protocol->name;
        if (host_create(&config, &arena, &host, &error)) {
            fail_msg("%s: %s", protocol->name, error.text);
        }
    }
    bus.protocol = "nobody";
    assert_int_equal(host_create(&config, &arena, &host, &error), ERROR_INPUT);
    assert_string_equal(error.text, "host: bus 0 speaks nobody, which no host knows");
}

/* ---- described boards that report unasked ---- */

/* Board 1 reports its state every millisecond, asked or not. */
static uint8_t told_state;

static void play_status(struct bench *bench, int bus, const struct bus_frame *frame)
{
    told_state = frame->id == 0x101 && !bench->mute ? frame->data[0] : told_state;
    say(bench, bus, 0x301, 8, (const uint8_t[8]){told_state});
}

static inline void set_up_status(struct bench *bench)
{
    static const char text[] =
        "name: my\nstates:\n  - {name: idle, law: \"off\"}\n  - {name: run, value: 1, law: "
        "voltage}\nframes:\n  - {name: HELLO, from: host, id: 0x10, reply: STATUS}\n"
        "  - {name: SWITCH, from: host, id: 0x100, by: address, fields: [{name: state, bits: 8, "
        "target: state}]}\n"
        "  - {name: SET, from: host, id: 0x200, by: address, fields: [{name: voltage, bits: 16, "
        "target: voltage}]}\n"
        "  - {name: STATUS, from: board, id: 0x300, by: address, period_s: 0.001, fields: [{name: "
        "state, bits: 8, source: state}, {name: position, bits: 32, source: motor_position}, "
        "{name: spare, bits: 24}]}\n"
        "host: {discover: [HELLO], \"off\": [SWITCH], \"on\": [SWITCH], command: [SET]}\n";
    static struct arena arena;
    static struct host_axis axis = {.joint = "one",
                                    .address = 1,
                                    .joint_ticks_per_rad = 100,
                                    .motor_ticks_per_rad = 1000,
                                    .torque_address = -1};
    static struct host_bus bus = {.protocol = "described"};
    const struct host_config config = {
        .nbus = 1, .bus = &bus, .naxis = 1, .axis = &axis, .supply_v = 48, .period_ns = 1000000};

    if (!arena.memory) {
        assert_ok(arena_init(&arena, 1 << 20, &error));
        assert_no_error(described_read_text("my.yaml", text, sizeof text - 1, false, &arena,
                                            &bus.described, &error),
                        error.text);
    }
    told_state = 0;
    bench->play[0] = play_status;
    bench_open(bench, &config);
}

BENCH(set_up_status, struct bench, bench_close)

/* The boards of a running bench were heard, and one is on, before the host sends its first frame:
 * it is asked, switched off and on all the same. */
TEST_ON(a_host_joins_boards_that_report_unasked, set_up_status, bench)
{
    int off, on;

    told_state = 1;
    for (int i = 0; i < 3; i++) {
        say(bench, 0, 0x301, 8, (const uint8_t[8]){told_state});
    }
    assert_int_equal(start_up(bench, 100), HOST_READY);
    assert_true(was_sent(bench, 0, 0x010, 0, NULL));
    off = find_sent(bench, 0, 0, 0x101, 1, (const uint8_t[]){0});
    on = find_sent(bench, 0, 0, 0x101, 1, (const uint8_t[]){1});
    assert_true(off >= 0 && on > off);
}

TEST_ON(a_board_that_stays_off_is_told_with_the_frames_sent, set_up_status, bench)
{
    size_t sent = 0;

    bench->mute = true;
    say(bench, 0, 0x301, 8, (const uint8_t[8]){0});
    assert_int_equal(start_up(bench, 3000), HOST_FAILED);
    assert_int_equal(sscanf(host_message(bench->host),
                            "joint one does not switch its motor on: its board still reports "
                            "another state (%zu frames sent",
                            &sent),
                     1);
    assert_in_range(sent, bench->nseen - 2, bench->nseen);
}
