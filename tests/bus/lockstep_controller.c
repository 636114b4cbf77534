/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A controller in lockstep that proves of every tick that nothing was lost and nothing changed its
 * place, in either direction, until the simulator says that it stops:
 *   lockstep_controller TICKS STRIDE INTERFACE...     (the first one carries the STEP)
 *
 * Each STEP asks for STRIDE ticks. Before it the number of the tick is written into a parameter of
 * board 1 of every bus and read back: the one answer must carry it. Of the telemetry, which it
 * switches on, the identifiers between two DONE frames must be the same ones in the same order
 * every four STEPs, as the boards have four slots; STATUS has a slower period of its own and is
 * counted only. Prints the frames of each bus and the ticks a second; ends with a message and 1
 * when anything is otherwise. Frames as in docs/controller.md.
 */
#include "canbus/port.h"

#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum {
    BUSES = 8,
    BATCH = 64,
    SLOTS = 4,
    PATTERN = 512, /* frames of a STEP */
    STRIDE_MAX = 250,
    WARM_UP = 2 * SLOTS, /* STEPs */
    PATIENCE_MS = 20000,
    STEP = 0x6f0,
    DONE = 0x6ff,
    HOST_TO_BOARD = 0x001, /* polling command, board 1 */
    BOARD_TO_HOST = 0x010,
    SET_MIN_POSITION = 0x40,
    GET_MIN_POSITION = 0x41,
    SET_BROADCAST_POLICY = 0x49,
    STATUS = 3, /* type of a periodic frame of class 1 */
    ADDITIONAL_STATUS = 12,
    STOPPING = 1 << 3, /* flag of DONE */
};

struct bus {
    const char *name;
    struct can_port *port;
    struct bus_frame waiting[BATCH];
    size_t at, count;
    uint32_t pattern[SLOTS][PATTERN];
    size_t length[SLOTS];
    uint64_t status;
};

static int fail(const struct bus *bus, uint32_t tick, const char *what, uint32_t id)
{
    fprintf(stderr, "lockstep_controller: %s, tick %" PRIu32 ": %s (identifier 0x%03" PRIx32 ")\n",
            bus->name, tick, what, id);
    return 1;
}

/* The next frame of a bus; NULL when none comes. */
static const struct bus_frame *next_frame(struct bus *bus)
{
    struct pollfd wait = {.fd = bus->port->ops->descriptor(bus->port), .events = POLLIN};

    while (bus->at == bus->count) {
        bus->at = 0;
        bus->count = can_receive(bus->port, bus->waiting, BATCH);
        if (!bus->count && poll(&wait, 1, PATIENCE_MS) != 1) {
            return NULL;
        }
    }
    return &bus->waiting[bus->at++];
}

static bool send(struct bus *bus, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct bus_frame frame = frame_make(id, len, data);

    return can_send(bus->port, &frame, 1) == 1;
}

static bool send_commands(struct bus *bus, uint32_t tick)
{
    uint8_t set[5] = {SET_MIN_POSITION};
    const uint8_t get[1] = {GET_MIN_POSITION};

    put_u32_le(set + 1, tick);
    return send(bus, HOST_TO_BOARD, sizeof set, set) && send(bus, HOST_TO_BOARD, sizeof get, get);
}

static bool send_step(struct bus *bus, uint32_t tick, uint32_t stride)
{
    uint8_t step[6] = {0};

    put_u32_le(step, tick);
    step[4] = (uint8_t)stride;
    return send(bus, STEP, sizeof step, step);
}

static bool is_status(const struct bus_frame *frame)
{
    return frame->id >> 8 == 1 &&
           ((frame->id & 0xf) == STATUS || (frame->id & 0xf) == ADDITIONAL_STATUS);
}

/* A periodic frame: the pattern of the slot is learned in the warm-up. */
static int judge_periodic(struct bus *bus, uint32_t tick, uint32_t step, size_t at, uint32_t id)
{
    const size_t slot = step % SLOTS;

    if (at == PATTERN) {
        return fail(bus, tick, "more frames than there can be", id);
    }
    if (step < WARM_UP) {
        bus->pattern[slot][at] = id;
        bus->length[slot] = at + 1;
    } else if (at >= bus->length[slot] || bus->pattern[slot][at] != id) {
        return fail(bus, tick, "not the frame that stands here every four STEPs", id);
    }
    return 0;
}

/* The frames of one STEP up to DONE. */
static int judge_step(struct bus *bus, uint32_t tick, uint32_t stride)
{
    const uint32_t step = tick / stride;
    size_t periodic = 0, answers = 0;
    const struct bus_frame *frame;

    while ((frame = next_frame(bus)) && frame->id != DONE) {
        if (frame->id == BOARD_TO_HOST && frame->data[0] == GET_MIN_POSITION) {
            answers++;
            if (get_u32_le(frame->data + 1) != tick) {
                return fail(bus, tick, "the answer carries another tick", frame->id);
            }
        } else if (is_status(frame)) {
            bus->status++;
        } else if (judge_periodic(bus, tick, step, periodic++, frame->id)) {
            return 1;
        }
    }
    if (!frame) {
        return fail(bus, tick, "no DONE came", DONE);
    }
    if (get_u32_le(frame->data) != tick + stride) {
        return fail(bus, tick, "DONE of another tick", DONE);
    }
    if (answers != 1 || (step >= WARM_UP && periodic != bus->length[step % SLOTS])) {
        return fail(bus, tick, "frames are missing before DONE", DONE);
    }
    return 0;
}

/* The last frame of all. */
static int judge_end(struct bus *bus, uint32_t tick)
{
    const struct bus_frame *frame = next_frame(bus);

    if (!frame || frame->id != DONE || get_u32_le(frame->data) != tick ||
        !(frame->data[4] & STOPPING)) {
        return fail(bus, tick, "not the DONE that says that the simulator stops",
                    frame ? frame->id : 0);
    }
    return 0;
}

static int run(struct bus *buses, size_t nbus, uint32_t ticks, uint32_t stride)
{
    for (size_t b = 0; b < nbus; b++) {
        /* Of board 1: POSITION, PID_VAL, CURRENT, VELOCITY */
        const uint8_t policy[5] = {SET_BROADCAST_POLICY, 0x7f};

        if (!send(&buses[b], HOST_TO_BOARD, sizeof policy, policy)) {
            return fail(&buses[b], 0, "the policy was not sent", HOST_TO_BOARD);
        }
    }
    for (uint32_t tick = 0; tick < ticks; tick += stride) {
        for (size_t b = 0; b < nbus; b++) {
            if (!send_commands(&buses[b], tick)) {
                return fail(&buses[b], tick, "commands were not sent", HOST_TO_BOARD);
            }
        }
        if (!send_step(&buses[0], tick, stride)) {
            return fail(&buses[0], tick, "STEP was not sent", STEP);
        }
        for (size_t b = 0; b < nbus; b++) {
            if (judge_step(&buses[b], tick, stride)) {
                return 1;
            }
        }
    }
    for (size_t b = 0; b < nbus; b++) {
        if (judge_end(&buses[b], ticks)) {
            return 1;
        }
    }
    return 0;
}

static double now_s(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv)
{
    static struct bus buses[BUSES];
    const size_t nbus = argc > 3 ? (size_t)argc - 3 : 0;
    const uint32_t ticks = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 0;
    const uint32_t stride = argc > 2 ? (uint32_t)strtoul(argv[2], NULL, 10) : 0;
    struct arena arena;
    struct error error;
    double begin;
    int status;

    if (!nbus || nbus > BUSES || !stride || stride > STRIDE_MAX || !ticks || ticks % stride ||
        arena_init(&arena, (size_t)64 << 20, &error)) {
        fprintf(stderr, "usage: lockstep_controller TICKS STRIDE INTERFACE...\n");
        return 2;
    }
    for (size_t b = 0; b < nbus; b++) {
        const struct socketcan_config config = {.interface = argv[3 + b]};

        buses[b].name = argv[3 + b];
        if (socketcan_open(&config, &arena, &buses[b].port, &error)) {
            fprintf(stderr, "lockstep_controller: %s\n", error.text);
            return 2;
        }
    }
    begin = now_s();
    status = run(buses, nbus, ticks, stride);
    if (!status) {
        printf("%" PRIu32 " ticks, %.0f a second\n", ticks, ticks / (now_s() - begin));
    }
    for (size_t b = 0; b < nbus; b++) {
        const struct can_counters *c = &buses[b].port->counters;

        printf("%s sent %" PRIu64 " received %" PRIu64 " status %" PRIu64 " lost %" PRIu64 "\n",
               buses[b].name, c->tx_frames, c->rx_frames, buses[b].status,
               c->tx_dropped + c->rx_dropped);
        status |= c->tx_dropped + c->rx_dropped > 0;
        buses[b].port->ops->close(buses[b].port);
    }
    arena_fini(&arena);
    return status;
}
