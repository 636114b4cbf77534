/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A small bench for the tests of the boards: two buses, three motor boards, a force-torque board
 * and a pseudo-STRAIN board, and sensors that a test sets by hand. No plant.
 *
 * bus 0: motor board 1 (joints 0, 1), motor board 2 (joint 2, spare axis), pseudo-STRAIN 0x0C
 * (joints 0, 1, 2), F/T board 0x0D (sensor 0); bus 1: motor board 1 (joints 3, 4).
 */
#ifndef TESTS_UNIT_BOARDS_BOARD_BENCH_H
#define TESTS_UNIT_BOARDS_BOARD_BENCH_H

#include "boards/board.h"
#include "boards/icub/protocol.h"
#include "boards/protocol_list.h"
#include "tests/test.h"

enum { BENCH_JOINTS = 5, BENCH_BUSES = 2, BENCH_BOARDS = 5, BENCH_FRAMES = 1024 };

#define TICKS_PER_RAD 10000.0
#define MOTOR_TICKS_PER_RAD 65000.0
#define SUPPLY_V 48.0

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

struct board_bench {
    struct arena arena;
    struct board_config board[BENCH_BOARDS];
    struct boards_config config;
    struct boards *boards;
    int64_t now_ns; /* virtual time */
    struct plant_sensors sensors;
    struct motor_sense sense[BENCH_JOINTS];
    struct ft_sense ft;
    struct plant_command command;
    struct motor_command motor[BENCH_JOINTS];
    struct bus_frame frame[BENCH_BUSES][BENCH_FRAMES]; /* of the last tick */
    size_t count[BENCH_BUSES];
};

/* Returns the current that joint j's law wants beyond the present one, A; the motor is at rest. */
static inline double bench_lacking_a(const struct board_bench *bench, int j)
{
    const struct current_law *law = &bench->motor[j].law;
    const double wanted_a = law->current_a +
                            law->stiffness_a_rad * (law->position_rad - law->reading_rad) +
                            law->damping_a_s_rad * law->speed_rad_s;

    assert_true(law->on);
    return fmax(fmin(wanted_a, law->limit_a), -law->limit_a) - bench->sense[j].current_a;
}

static inline struct board_axis_config bench_axis(int joint)
{
    return (struct board_axis_config){
        .joint = joint,
        .joint_ticks_per_rad = TICKS_PER_RAD,
        .motor_ticks_per_rad = MOTOR_TICKS_PER_RAD,
        .lower_rad = -2.0,
        .upper_rad = 2.5,
        .current_limit_a = 12.0,
        .torque_full_scale_nm = 55.0,
    };
}

static inline struct board_config bench_motor(const char *name, int bus, uint8_t address, int j0,
                                              int j1)
{
    return (struct board_config){
        .under_voltage_v = 24.0,
        .over_voltage_v = 60.0,
        .name = name,
        .kind = BOARD_MOTOR,
        .bus = bus,
        .address = address,
        .axis = {bench_axis(j0), bench_axis(j1)},
    };
}

/* The bench that has been started last and not stopped. */
static struct board_bench *bench_started;

static inline void bench_stop(struct board_bench *bench)
{
    arena_fini(&bench->arena);
    bench_started = NULL;
}

/* The configuration, which a test may change before bench_start. Stops the bench first if a case
 * before has started it. */
static inline void bench_configure(struct board_bench *bench)
{
    if (bench == bench_started) {
        bench_stop(bench);
    }
    memset(bench, 0, sizeof *bench);
    bench->board[0] = bench_motor("leg 1", 0, 1, 0, 1);
    bench->board[1] = bench_motor("leg 2", 0, 2, 2, -1);
    bench->board[2] = (struct board_config){
        .name = "leg torques",
        .kind = BOARD_TORQUE,
        .bus = 0,
        .address = 0x0c,
        .torque_joint = {0, 1, 2, -1, -1, -1},
        .full_scale = {55.0, 55.0, 55.0, 55.0, 55.0, 55.0},
        .period_ns = 4000000,
    };
    bench->board[3] = (struct board_config){
        .name = "ankle",
        .kind = BOARD_FT,
        .bus = 0,
        .address = 0x0d,
        .full_scale = {1500.0, 1500.0, 2000.0, 40.0, 40.0, 40.0},
        .period_ns = 5000000,
    };
    bench->board[4] = bench_motor("arm 1", 1, 1, 3, 4);
    bench->config = (struct boards_config){
        .nboard = BENCH_BOARDS,
        .board = bench->board,
        .nbus = BENCH_BUSES,
        .njoint = BENCH_JOINTS,
        .nft = 1,
        .tick_ns = 1000000,
    };
    bench->sensors = (struct plant_sensors){
        .supply_v = SUPPLY_V,
        .njoint = BENCH_JOINTS,
        .nft = 1,
        .motor = bench->sense,
        .ft = &bench->ft,
    };
    bench->command = (struct plant_command){.njoint = BENCH_JOINTS, .motor = bench->motor};
}

static inline void bench_start(struct board_bench *bench)
{
    struct error error;

    assert_ok(arena_init(&bench->arena, 64u << 20, &error));
    assert_no_error(boards_create(&bench->config, &bench->arena, &bench->boards, &error),
                    error.text);
    arena_seal(&bench->arena);
    bench_started = bench;
}

/* A bench whose configuration is as bench_configure makes it. */
static inline void bench_open(struct board_bench *bench)
{
    bench_configure(bench);
    bench_start(bench);
}

/* "72 4D 01" -> three bytes */
static inline uint8_t bench_bytes(const char *hex, uint8_t *data)
{
    uint8_t len = 0;
    char *end;

    for (unsigned long value = strtoul(hex, &end, 16); end != hex; value = strtoul(hex, &end, 16)) {
        assert_true(len < 64 && value <= 0xff);
        data[len++] = (uint8_t)value;
        hex = end;
    }
    return len;
}

/* Classic frames arrive; ';' separates their bytes. */
static inline void bench_send(struct board_bench *bench, size_t bus, uint32_t id, const char *hex)
{
    while (hex) {
        struct bus_frame frame = {.id = id};

        frame.len = bench_bytes(hex, frame.data);
        boards_receive(bench->boards, bench->now_ns, bus, &frame);
        hex = strchr(hex, ';');
        hex += hex != NULL;
    }
}

/* The first half of a tick. Before the very first the boards see what the test has set. */
static inline void bench_control(struct board_bench *bench)
{
    if (bench->now_ns == 0) {
        boards_sample(bench->boards, 0, &bench->sensors);
    }
    boards_control(bench->boards, bench->now_ns, &bench->command);
    bench->now_ns += bench->config.tick_ns;
    bench->sensors.time_ns = bench->now_ns;
}

/* The second half, after the (missing) plant has moved. */
static inline void bench_transmit(struct board_bench *bench)
{
    boards_sample(bench->boards, bench->now_ns, &bench->sensors);
    for (size_t bus = 0; bus < BENCH_BUSES; bus++) {
        assert_true(boards_transmit_max(bench->boards, bus) <= BENCH_FRAMES);
        bench->count[bus] =
            boards_transmit(bench->boards, bench->now_ns, bus, bench->frame[bus], BENCH_FRAMES);
        assert_true(bench->count[bus] <= boards_transmit_max(bench->boards, bus));
    }
}

static inline void bench_tick(struct board_bench *bench)
{
    bench_control(bench);
    bench_transmit(bench);
}

static inline void bench_ticks(struct board_bench *bench, int count)
{
    while (count-- > 0) {
        bench_tick(bench);
    }
}

/* Frames arrive, and a tick follows. */
static inline void bench_say(struct board_bench *bench, size_t bus, uint32_t id, const char *hex)
{
    bench_send(bench, bus, id, hex);
    bench_tick(bench);
}

/* How many frames with this id were sent in the last tick. */
static inline size_t bench_sent(const struct board_bench *bench, size_t bus, uint32_t id)
{
    size_t sent = 0;

    for (size_t i = 0; i < bench->count[bus]; i++) {
        sent += bench->frame[bus][i].id == id;
    }
    return sent;
}

static inline const struct bus_frame *bench_find(const struct board_bench *bench, size_t bus,
                                                 uint32_t id)
{
    for (size_t i = 0; i < bench->count[bus]; i++) {
        if (bench->frame[bus][i].id == id) {
            return &bench->frame[bus][i];
        }
    }
    return NULL;
}

static inline void bench_expect_frame(const struct bus_frame *frame, uint32_t id, const char *hex)
{
    uint8_t data[64];
    uint8_t len = bench_bytes(hex, data);

    assert_non_null(frame);
    assert_int_equal(frame->id, id);
    assert_int_equal(frame->flags, 0);
    assert_int_equal(frame->len, len);
    assert_memory_equal(frame->data, data, len);
    for (size_t i = len; i < sizeof frame->data; i++) {
        assert_int_equal(frame->data[i], 0);
    }
}

/* Exactly one frame with this id was sent in the last tick, and it reads so. */
static inline void bench_expect(const struct board_bench *bench, size_t bus, uint32_t id,
                                const char *hex)
{
    if (bench_sent(bench, bus, id) != 1) {
        fail_msg("%zu frames with id 0x%03x, not 1", bench_sent(bench, bus, id), (unsigned)id);
    }
    bench_expect_frame(bench_find(bench, bus, id), id, hex);
}

/* Sends a request to board 1 on bus 0 and checks the one reply of the next tick. */
static inline void bench_ask(struct board_bench *bench, const char *request, const char *reply)
{
    bench_say(bench, 0, 0x001, request);
    bench_expect(bench, 0, 0x010, reply);
}

static inline struct boards_counters bench_counters(const struct board_bench *bench)
{
    struct boards_counters counters;

    boards_counters(bench->boards, &counters);
    return counters;
}

/* The next event of this kind, skipping others; false when there is none. */
static inline bool bench_event(struct board_bench *bench, enum board_event_kind kind,
                               struct board_event *event)
{
    while (boards_next_event(bench->boards, event)) {
        if (event->kind == kind) {
            return true;
        }
    }
    return false;
}

enum { BENCH_STATUS = 0x113 }; /* of motor board 1 on bus 0 */

/* The STATUS of board 1 within the next slots; NULL: none. */
static inline const struct bus_frame *bench_next_status(struct board_bench *bench)
{
    for (int t = 0; t < ICUB_SLOTS; t++) {
        bench_tick(bench);
        if (bench_sent(bench, 0, BENCH_STATUS)) {
            return bench_find(bench, 0, BENCH_STATUS);
        }
    }
    return NULL;
}

CLOSED_BENCH(board_bench, struct board_bench, bench_stop)

BENCH(bench_open, struct board_bench, bench_stop)

BENCH(bench_configure, struct board_bench, bench_stop)

#endif
