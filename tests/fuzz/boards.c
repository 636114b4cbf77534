/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whatever arrives on the buses and whatever the sensors say, the boards neither crash nor
 * allocate, keep voltages within the supply, keep bridges off in idle and after faults, and account
 * for every frame. The sequences are random but the same every time.
 */
#include "base/hash.h"
#include "tests/unit/boards_rig.h"

#include <inttypes.h>

/* Allocations of the whole program, counted while armed: the linker sends them through here. */
static bool armed;
static unsigned allocations;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);

void *__wrap_malloc(size_t size)
{
    allocations += armed;
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    allocations += armed;
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *memory, size_t size)
{
    allocations += armed;
    return __real_realloc(memory, size);
}

/* SplitMix64 */
static uint64_t next(uint64_t *seed)
{
    uint64_t z = *seed += UINT64_C(0x9e3779b97f4a7c15);

    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

static struct bus_frame anything(uint64_t *seed)
{
    struct bus_frame frame = {.id = (uint32_t)next(seed), .flags = (uint8_t)next(seed)};
    uint64_t bytes = next(seed);

    frame.len = (uint8_t)next(seed);
    for (int i = 0; i < 8; i++) {
        frame.data[i] = (uint8_t)(bytes >> 8 * i);
    }
    return frame;
}

/* A frame that some board is likely to take: right address, a command that exists. */
static struct bus_frame likely(uint64_t *seed)
{
    static const uint32_t ids[] = {0x001, 0x002, 0x00f, 0x20c, 0x20d, 0x20f, 0x701,
                                   0x70d, 0x70f, 0x35a, 0x35b, 0x001, 0x001, 0x002};
    static const uint8_t modes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0x50, 0x60, 0xa0};
    struct bus_frame frame = anything(seed);
    uint64_t r = next(seed);

    frame.flags = 0;
    frame.id = ids[r % (sizeof ids / sizeof *ids)];
    frame.len = (uint8_t)(r >> 8 & 0xff) % 9;
    if (r >> 16 & 1) { /* often a mode or a voltage */
        frame.id = r >> 17 & 1 ? 0x001 : 0x002;
        frame.len = r >> 18 & 1 ? 2 : 3;
        frame.data[0] = (uint8_t)((frame.len == 2 ? 0x09 : 0x72) | (r >> 19 & 1) << 7);
        if (frame.len == 2) {
            frame.data[1] = modes[(r >> 20) % sizeof modes];
        }
    } else if (frame.id == 0x701 || frame.id == 0x70d) {
        /* seldom the bootloader, which takes 5 s */
        frame.data[0] = (r >> 24) % 20000 == 0 ? 0x00 : (r >> 24) % 20000 == 1 ? 0x02 : 0x0c;
    } else {
        frame.data[0] &= (uint8_t)(frame.id & 0x200 ? 0x3f : 0xff);
        frame.data[0] ^= (frame.data[0] & 0x7f) == 0x32; /* boards keep their addresses */
    }
    return frame;
}

static double wild(uint64_t *seed, double usual)
{
    static const double odd[] = {0.0, 1e300, -1e300, 1e-300};
    uint64_t r = next(seed);

    switch (r % 2000) {
    case 0:
        return (double)NAN;
    case 1:
        return (double)INFINITY;
    case 2:
        return odd[r >> 32 & 3];
    default:
        return usual * ((double)(r >> 11) * 0x1p-52 - 1.0);
    }
}

static void shake(struct rig *rig, uint64_t *seed)
{
    for (int i = 0; i < RIG_JOINTS; i++) {
        rig->sense[i].q = wild(seed, 2.0);
        rig->sense[i].qm = wild(seed, 2.0);
        rig->sense[i].current_a = wild(seed, 25.0);
        rig->sense[i].torque_nm = wild(seed, 60.0);
    }
    for (int i = 0; i < 3; i++) {
        rig->ft.force_n[i] = wild(seed, 2000.0);
        rig->ft.torque_nm[i] = wild(seed, 40.0);
    }
    rig->sensors.supply_v = next(seed) % 1000 ? SUPPLY_V : wild(seed, 60.0);
}

/* sampled: the supply that the boards had read when they gave their command. */
static void check_command(const struct rig *rig, double sampled)
{
    double supply = isfinite(sampled) && sampled > 0.0 ? sampled : 0.0;

    for (int i = 0; i < RIG_JOINTS; i++) {
        const struct motor_command *motor = &rig->motor[i];

        assert_true(fabs(motor->voltage_v) <= supply);
        assert_true(motor->bridge_on || motor->voltage_v == 0.0);
    }
}

/* flags: of bus 0 */
static uint64_t check_frames(const struct rig *rig, unsigned flags, uint64_t hash)
{
    for (size_t bus = 0; bus < RIG_BUSES; bus++) {
        for (size_t i = 0; i < rig->count[bus]; i++) {
            const struct bus_frame *frame = &rig->frame[bus][i];

            assert_true(frame->id <= 0x7ff && frame->flags == (bus == 0 ? flags : 0));
            assert_true(frame->len <= (frame->flags ? 64 : 8));
            hash = hash_bytes(hash, &frame->id, sizeof frame->id);
            hash = hash_bytes(hash, frame->data, frame->len);
        }
    }
    return hash;
}

/* Bus 0 with other boards than iCub ones; bus 1 keeps its own. */
static void change_personality(struct rig *rig, const struct boards_bus_config *bus)
{
    rig->config.bus = bus;
    if (bus->personality == BOARD_COMPACT) {
        rig->config.nboard = 4; /* torques need no board */
        rig->board[2] = rig->board[4];
    }
    for (int i = 0; i < RIG_BOARDS; i++) {
        rig->board[i].axis[0].gear = 100.0;
        rig->board[i].axis[2].joint = rig->board[i].axis[3].joint = -1;
        rig->board[i].transmit_at_start = rig->board[i].period_ns <= 4000000;
        rig->board[i].axis[0].winding_ohm = 0.7;
    }
    rig->board[0].boot_ns = 3000000;
}

/* What a host of these boards would send, more or less. */
static struct bus_frame likely_of(enum board_personality personality, uint64_t *seed)
{
    static const uint32_t foc[] = {0x001, 0x002, 0x001, 0x10f, 0x10f, 0x10f, 0x701, 0x20d};
    static const uint8_t foc_codes[] = {0x5b, 0x77, 0x48, 0x65, 0x69, 0x7d, 0x09,
                                        0x09, 0x72, 0x17, 0x02, 0x01, 0x79, 0x07};
    static const uint8_t modes[] = {0x50, 0x06, 0x0a, 0x0b, 0x01, 0x00, 0x09};
    static const uint32_t compact[] = {0x020, 0x040, 0x040, 0x041, 0x681, 0x682, 0x68d, 0x7e0};
    struct bus_frame frame = anything(seed);
    uint64_t r = next(seed);

    frame.flags = 0;
    frame.len = r >> 40 & 7 ? 8 : (uint8_t)(r >> 44 & 7);
    if (personality == BOARD_COMPACT) {
        frame.id = compact[r & 7];
        frame.flags = r >> 10 & 1 ? FRAME_FD : 0;
        frame.len = frame.id == 0x020 ? 5 : frame.id >= 0x7e0 ? 0 : frame.len;
        if (frame.id == 0x020) {
            frame.data[0] &= 3;
        } else if (frame.id >= 0x680 && frame.id < 0x6a0) {
            frame.data[0] &= 0xbf; /* seldom a restart */
            frame.data[0] ^= (frame.data[0] & 0x7f) == 7 && r >> 20 & 0xff ? 0x20 : 0;
            frame.data[1] &= 7;
            frame.len = frame.data[0] & 0x80 ? 6 : 2;
        }
        return frame;
    }
    frame.id = foc[r & 7];
    if (frame.id < 0x100) {
        static const uint8_t lengths[] = {3, 7, 8, 8, 8, 8, 2, 2, 3, 5, 6, 2, 3, 1};
        size_t code = (r >> 8) % sizeof foc_codes;

        frame.data[0] = foc_codes[code];
        frame.len = r >> 48 & 15 ? lengths[code] : frame.len;
        if (frame.data[0] == 0x5b && r >> 52 & 7) {
            frame.data[1] = 1;
            frame.data[2] = 6;
        } else if (frame.data[0] == 0x09) {
            frame.data[1] = modes[(r >> 20) % sizeof modes];
        } else if (frame.data[0] == 0x48) {
            frame.data[5] |= 0x20; /* some peak */
            frame.data[5] &= 0x7f;
        }
    } else if (frame.id == 0x701) {
        frame.data[0] = (r >> 24) % 20000 == 0 ? 0x00 : 0x0c;
    }
    return frame;
}

/* One run; returns the hash of everything that the boards sent and commanded. bus NULL: iCub boards
 * everywhere. */
static uint64_t run(const struct boards_bus_config *bus, uint64_t seed, int ticks,
                    int frames_a_tick, struct boards_counters *counters)
{
    static struct rig rig;
    uint64_t hash = HASH_START, received = 0;
    double supply = SUPPLY_V, sampled;
    struct board_event event;

    rig_configure(&rig);
    rig.board[0].command_timeout_ns = rig.board[1].command_timeout_ns = 2000000;
    rig.board[1].discovery_stops_motors = true;
    if (bus) {
        change_personality(&rig, bus);
    }
    rig_start(&rig);
    armed = true;
    for (int t = 0; t < ticks; t++) {
        bool quiet = t / 16 % 4 == 3; /* time for references to go stale */

        for (int f = 0; f < frames_a_tick && !quiet; f++) {
            struct bus_frame frame = f % 4 == 0 ? anything(&seed)
                                     : bus      ? likely_of(bus->personality, &seed)
                                                : likely(&seed);

            boards_receive(rig.boards, next(&seed) % 5 == 0, &frame);
            received++;
        }
        sampled = supply; /* read at the end of the tick before */
        supply = rig.sensors.supply_v;
        rig_tick(&rig);
        check_command(&rig, sampled);
        hash = hash_bytes(hash, rig.motor, sizeof rig.motor);
        hash = check_frames(&rig, bus && bus->fd ? FRAME_FD | FRAME_BRS : 0, hash);
        shake(&rig, &seed);
        while (boards_next_event(rig.boards, &event)) {
            char text[256];

            hash = hash_bytes(hash, &event.kind, sizeof event.kind);
            if (t % 64 == 0) {
                board_event_format(rig.boards, &event, text, sizeof text);
                assert_true(strlen(text) > 10);
            }
        }
    }
    armed = false;
    *counters = rig_counters(&rig);
    assert_int_equal(counters->frames + counters->foreign, received);
    assert_true(counters->unknown + counters->malformed <= counters->frames);
    assert_int_equal(counters->events_lost, 0);
    rig_stop(&rig);
    return hash;
}

/* Many short runs: in a long one random limits and gains soon leave nothing that moves. */
static void millions_of_frames_do_no_harm(void **state)
{
    struct boards_counters counters, sum = {0};

    (void)state;
    allocations = 0;
    for (uint64_t seed = 1; seed <= 200; seed++) {
        run(NULL, seed, 400, 64, &counters);
        sum.frames += counters.frames;
        sum.foreign += counters.foreign;
        sum.unknown += counters.unknown;
        sum.malformed += counters.malformed;
        sum.trips += counters.trips;
        sum.timeouts += counters.timeouts;
    }
    assert_int_equal(allocations, 0);
    print_message("# %" PRIu64 " frames for boards, %" PRIu64 " foreign, %" PRIu64
                  " unknown, %" PRIu64 " malformed, %" PRIu64 " trips, %" PRIu64 " time-outs\n",
                  sum.frames, sum.foreign, sum.unknown, sum.malformed, sum.trips, sum.timeouts);
    /* every kind of accident has happened */
    assert_true(sum.frames > 1000000);
    assert_true(sum.foreign > 1000000);
    assert_true(sum.unknown > 1000);
    assert_true(sum.malformed > 1000);
    assert_true(sum.trips > 100);
    assert_true(sum.timeouts > 10);
}

static void the_same_frames_give_the_same_answers(void **state)
{
    struct boards_counters first, second;
    uint64_t hash = run(NULL, 7, 3000, 20, &first);

    (void)state;
    assert_true(hash == run(NULL, 7, 3000, 20, &second));
    assert_memory_equal(&first, &second, sizeof first);
    assert_true(hash != run(NULL, 8, 3000, 20, &second));
}

static void other_personalities_come_to_no_harm_either(void **state)
{
    static const struct boards_bus_config buses[][RIG_BUSES] = {
        {{BOARD_FOC, false}, {BOARD_ICUB, false}},
        {{BOARD_COMPACT, false}, {BOARD_ICUB, false}},
        {{BOARD_COMPACT, true}, {BOARD_ICUB, false}}};

    (void)state;
    allocations = 0;
    for (int p = 0; p < 3; p++) {
        struct boards_counters counters, again, sum = {0};

        for (uint64_t seed = 1; seed <= 60; seed++) {
            uint64_t hash = run(buses[p], seed, 400, 40, &counters);

            sum.frames += counters.frames;
            sum.malformed += counters.malformed;
            sum.unknown += counters.unknown;
            sum.trips += counters.trips;
            sum.timeouts += counters.timeouts;
            if (seed % 20 == 0) {
                assert_true(hash == run(buses[p], seed, 400, 40, &again));
                assert_memory_equal(&counters, &again, sizeof again);
            }
        }
        print_message("# personality %d: %" PRIu64 " frames, %" PRIu64 " unknown, %" PRIu64
                      " malformed, %" PRIu64 " trips, %" PRIu64 " time-outs\n",
                      p, sum.frames, sum.unknown, sum.malformed, sum.trips, sum.timeouts);
        assert_true(sum.frames > 100000 && sum.malformed > 1000 && sum.unknown > 100);
        assert_true(sum.trips > 10);
        assert_true(p == 0 || sum.timeouts > 10); /* no silence is 50 ms long */
    }
    assert_int_equal(allocations, 0);
}

/* Bridges stay off after every way into idle and into a fault, whatever else is said. */
static void idle_and_fault_mean_bridge_off(void **state)
{
    static struct rig rig;
    uint64_t seed = 11;

    (void)state;
    rig_configure(&rig);
    rig_start(&rig);
    for (int round = 0; round < 20000; round++) {
        struct bus_frame frame;
        bool fault = next(&seed) & 1;

        for (int i = 0; i < 6; i++) {
            frame = likely(&seed);
            if ((frame.id & 0x700) == 0) { /* no bootloader, no other address */
                frame.data[0] = (frame.data[0] & 0x7f) == 0x32 ? 0x72 : frame.data[0];
                frame.id = 0x001;
                boards_receive(rig.boards, 0, &frame);
            }
        }
        rig_send(&rig, 0, 0x001, "09 09");
        if (fault) {
            rig_send(&rig, 0, 0x001, "48 E8 03 00 00");
            rig_send(&rig, 0, 0x001, "09 50");
            rig.sense[0].current_a = 5.0;
            rig_ticks(&rig, 2);
            rig_send(&rig, 0, 0x001, "09 00");
            rig_send(&rig, 0, 0x001, "09 01");
        }
        rig_send(&rig, 0, 0x001, "72 35 05");
        rig_tick(&rig);
        assert_false(rig.motor[0].bridge_on);
        assert_true(rig.motor[0].voltage_v == 0.0);
        rig.sense[0].current_a = 0.0;
    }
    rig_stop(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(millions_of_frames_do_no_harm),
        cmocka_unit_test(other_personalities_come_to_no_harm_either),
        cmocka_unit_test(the_same_frames_give_the_same_answers),
        cmocka_unit_test(idle_and_fault_mean_bridge_off),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
