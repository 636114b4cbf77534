/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A small rig for the tests of the boards: two buses, three motor boards, a force-torque board and
 * a pseudo-STRAIN board, and sensors that a test sets by hand. No plant.
 *
 * bus 0: motor board 1 (joints 0, 1), motor board 2 (joint 2, spare axis), pseudo-STRAIN 0x0C
 * (joints 0, 1, 2), F/T board 0x0D (sensor 0); bus 1: motor board 1 (joints 3, 4).
 */
#ifndef TESTS_UNIT_BOARDS_BOARDS_RIG_H
#define TESTS_UNIT_BOARDS_BOARDS_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "boards/board.h"
#include "boards/icub/protocol.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RIG_JOINTS = 5, RIG_BUSES = 2, RIG_BOARDS = 5, RIG_FRAMES = 1024 };

#define TICKS_PER_RAD 10000.0
#define MOTOR_TICKS_PER_RAD 65000.0
#define SUPPLY_V 48.0

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

struct rig {
    struct arena arena;
    struct board_config board[RIG_BOARDS];
    struct boards_config config;
    struct boards *boards;
    struct plant_sensors sensors;
    struct motor_sense sense[RIG_JOINTS];
    struct ft_sense ft;
    struct plant_command command;
    struct motor_command motor[RIG_JOINTS];
    struct bus_frame frame[RIG_BUSES][RIG_FRAMES]; /* of the last tick */
    size_t count[RIG_BUSES];
};

static inline struct board_axis_config rig_axis(int joint)
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

static inline struct board_config rig_motor(const char *name, int bus, uint8_t address, int j0,
                                            int j1)
{
    return (struct board_config){
        .name = name,
        .kind = BOARD_MOTOR,
        .bus = bus,
        .address = address,
        .axis = {rig_axis(j0), rig_axis(j1)},
    };
}

/* The configuration, which a test may change before rig_start. */
static inline void rig_configure(struct rig *rig)
{
    memset(rig, 0, sizeof *rig);
    rig->board[0] = rig_motor("leg 1", 0, 1, 0, 1);
    rig->board[1] = rig_motor("leg 2", 0, 2, 2, -1);
    rig->board[2] = (struct board_config){
        .name = "leg torques",
        .kind = BOARD_TORQUE,
        .bus = 0,
        .address = 0x0c,
        .torque_joint = {0, 1, 2, -1, -1, -1},
        .full_scale = {55.0, 55.0, 55.0, 55.0, 55.0, 55.0},
        .period_ns = 4000000,
    };
    rig->board[3] = (struct board_config){
        .name = "ankle",
        .kind = BOARD_FT,
        .bus = 0,
        .address = 0x0d,
        .full_scale = {1500.0, 1500.0, 2000.0, 40.0, 40.0, 40.0},
        .period_ns = 5000000,
    };
    rig->board[4] = rig_motor("arm 1", 1, 1, 3, 4);
    rig->config = (struct boards_config){
        .nboard = RIG_BOARDS,
        .board = rig->board,
        .nbus = RIG_BUSES,
        .njoint = RIG_JOINTS,
        .nft = 1,
        .tick_ns = 1000000,
    };
    rig->sensors = (struct plant_sensors){
        .supply_v = SUPPLY_V,
        .njoint = RIG_JOINTS,
        .nft = 1,
        .motor = rig->sense,
        .ft = &rig->ft,
    };
    rig->command = (struct plant_command){.njoint = RIG_JOINTS, .motor = rig->motor};
}

static inline void rig_start(struct rig *rig)
{
    struct error error;

    assert_int_equal(arena_init(&rig->arena, 64u << 20, &error), ERROR_NONE);
    if (boards_create(&rig->config, &rig->arena, &rig->boards, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(arena_seal(&rig->arena, false, &error), ERROR_NONE);
}

static inline void rig_stop(struct rig *rig)
{
    arena_fini(&rig->arena);
}

/* "72 4D 01" -> three bytes */
static inline uint8_t rig_bytes(const char *hex, uint8_t *data)
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

/* A classic frame arrives. */
static inline void rig_send(struct rig *rig, size_t bus, uint32_t id, const char *hex)
{
    struct bus_frame frame = {.id = id};

    frame.len = rig_bytes(hex, frame.data);
    boards_receive(rig->boards, bus, &frame);
}

/* The boards have their step, the (missing) plant moves, the boards send. */
static inline void rig_tick(struct rig *rig)
{
    boards_control(rig->boards, &rig->sensors, &rig->command);
    rig->sensors.time_ns += rig->config.tick_ns;
    for (size_t bus = 0; bus < RIG_BUSES; bus++) {
        assert_true(boards_transmit_max(rig->boards, bus) <= RIG_FRAMES);
        rig->count[bus] =
            boards_transmit(rig->boards, bus, &rig->sensors, rig->frame[bus], RIG_FRAMES);
        assert_true(rig->count[bus] <= boards_transmit_max(rig->boards, bus));
    }
}

static inline void rig_ticks(struct rig *rig, int count)
{
    while (count-- > 0) {
        rig_tick(rig);
    }
}

/* How many frames with this id were sent in the last tick. */
static inline size_t rig_sent(const struct rig *rig, size_t bus, uint32_t id)
{
    size_t sent = 0;

    for (size_t i = 0; i < rig->count[bus]; i++) {
        sent += rig->frame[bus][i].id == id;
    }
    return sent;
}

static inline const struct bus_frame *rig_find(const struct rig *rig, size_t bus, uint32_t id)
{
    for (size_t i = 0; i < rig->count[bus]; i++) {
        if (rig->frame[bus][i].id == id) {
            return &rig->frame[bus][i];
        }
    }
    return NULL;
}

static inline void rig_expect_frame(const struct bus_frame *frame, uint32_t id, const char *hex)
{
    uint8_t data[64];
    uint8_t len = rig_bytes(hex, data);

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
static inline void rig_expect(const struct rig *rig, size_t bus, uint32_t id, const char *hex)
{
    if (rig_sent(rig, bus, id) != 1) {
        fail_msg("%zu frames with id 0x%03x, not 1", rig_sent(rig, bus, id), (unsigned)id);
    }
    rig_expect_frame(rig_find(rig, bus, id), id, hex);
}

/* Sends a request to board 1 on bus 0 and checks the one reply of the next tick. */
static inline void rig_ask(struct rig *rig, const char *request, const char *reply)
{
    rig_send(rig, 0, 0x001, request);
    rig_tick(rig);
    rig_expect(rig, 0, 0x010, reply);
}

static inline struct boards_counters rig_counters(const struct rig *rig)
{
    struct boards_counters counters;

    boards_counters(rig->boards, &counters);
    return counters;
}

/* The next event of this kind, skipping others; false when there is none. */
static inline bool rig_event(struct rig *rig, enum board_event_kind kind, struct board_event *event)
{
    while (boards_next_event(rig->boards, event)) {
        if (event->kind == kind) {
            return true;
        }
    }
    return false;
}

#endif
