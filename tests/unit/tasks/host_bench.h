/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A host on local buses whose boards the test plays, frame by frame, from the protocols' documents
 * and not from the headers that host and boards share.
 */
#ifndef TESTS_UNIT_TASKS_HOST_BENCH_H
#define TESTS_UNIT_TASKS_HOST_BENCH_H

#include "canbus/port.h"
#include "tasks/host.h"

#include "tests/physics/near.h"
#include "tests/test.h"

enum { BENCH_BUSES = 3, BENCH_SEEN = 2048 };

struct bench;

/* What the boards of a bus do about a frame of the host. */
typedef void bench_play(struct bench *bench, int bus, const struct bus_frame *frame);

struct bench {
    struct arena arena;
    struct local_bus *bus[BENCH_BUSES];
    struct can_port *host_port[BENCH_BUSES], *board_port[BENCH_BUSES];
    struct host_config config;
    struct host *host;
    bench_play *play[BENCH_BUSES];
    int64_t now_ns;
    struct bus_frame seen[BENCH_SEEN]; /* everything that the host sent */
    int seen_bus[BENCH_SEEN];
    size_t nseen;
    bool mute; /* one of the boards does not answer; which is the player's choice */
    /* 1 + number of a frame that is lost on the way, of the host's or of the boards'; 0 = none */
    size_t lose_sent, lose_said, nsaid;
};

static inline void bench_open(struct bench *bench, const struct host_config *config)
{
    static const char *const names[BENCH_BUSES] = {"can0", "can1", "can2"};
    struct error error;

    assert_ok(arena_init(&bench->arena, 32u << 20, &error));
    for (size_t b = 0; b < config->nbus; b++) {
        const struct local_bus_config bus = {
            .name = names[b], .max_nodes = 4, .inbox = 256, .fd = config->bus && config->bus[b].fd};

        assert_int_equal(local_bus_create(&bus, &bench->arena, &bench->bus[b], &error), 0);
        assert_int_equal(local_bus_join(bench->bus[b], 1, NULL, 0, &bench->host_port[b], &error),
                         0);
        assert_int_equal(local_bus_join(bench->bus[b], 1, NULL, 0, &bench->board_port[b], &error),
                         0);
    }
    bench->config = *config;
    bench->config.port = bench->host_port;
    assert_no_error(host_create(&bench->config, &bench->arena, &bench->host, &error), error.text);
}

static inline void bench_close(struct bench *bench)
{
    for (size_t b = 0; b < bench->config.nbus; b++) {
        bench->host_port[b]->ops->close(bench->host_port[b]);
        bench->board_port[b]->ops->close(bench->board_port[b]);
        local_bus_destroy(bench->bus[b]);
    }
    arena_fini(&bench->arena);
}

/* a board sends */
static inline void say_frame(struct bench *bench, int bus, const struct bus_frame *frame)
{
    if (++bench->nsaid != bench->lose_said) {
        assert_int_equal(can_send(bench->board_port[bus], frame, 1), 1);
    }
}

static inline void say(struct bench *bench, int bus, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct bus_frame frame = frame_make(id, len, data);

    say_frame(bench, bus, &frame);
}

static inline void say_fd(struct bench *bench, int bus, uint32_t id, uint8_t len,
                          const uint8_t *data)
{
    struct bus_frame frame = {.id = id, .flags = FRAME_FD | FRAME_BRS, .len = len};

    memcpy(frame.data, data, len);
    say_frame(bench, bus, &frame);
}

/* the boards' side of one period */
static inline void play_boards(struct bench *bench)
{
    struct bus_frame frame;

    for (size_t b = 0; b < bench->config.nbus; b++) {
        while (can_receive(bench->board_port[b], &frame, 1) == 1) {
            assert_true(bench->nseen < BENCH_SEEN);
            bench->seen_bus[bench->nseen] = (int)b;
            bench->seen[bench->nseen++] = frame;
            if (bench->nseen != bench->lose_sent) {
                bench->play[b](bench, (int)b, &frame);
            }
        }
    }
}

static inline void one_period(struct bench *bench)
{
    host_send(bench->host);
    play_boards(bench);
    bench->now_ns += bench->config.period_ns;
    assert_true(host_receive(bench->host, bench->now_ns));
}

static inline enum host_phase start_up(struct bench *bench, int periods)
{
    enum host_phase phase = HOST_DISCOVERING;

    host_receive(bench->host, bench->now_ns);
    for (int i = 0; i < periods && phase != HOST_READY && phase != HOST_FAILED; i++) {
        phase = host_start_up(bench->host);
        one_period(bench);
    }
    return phase;
}

/* Closes the bench and opens it anew. */
static inline void reopen(struct bench *bench, void (*set_up)(struct bench *bench))
{
    bench_close(bench);
    memset(bench, 0, sizeof *bench);
    set_up(bench);
}

static inline void reach_ready(struct bench *bench)
{
    assert_int_equal(start_up(bench, 1000), HOST_READY);
}

/* Starts the host up as often as there are frames in a start-up, each time with another of them
 * lost on its way; set_up opens a bench anew. */
static inline void check_start_up_without_each_frame(struct bench *bench,
                                                     void (*set_up)(struct bench *bench))
{
    size_t sent, said;

    assert_int_equal(start_up(bench, 100), HOST_READY);
    sent = bench->nseen;
    said = bench->nsaid;
    for (size_t i = 1; i <= sent + said; i++) {
        reopen(bench, set_up);
        bench->lose_sent = i <= sent ? i : 0;
        bench->lose_said = i <= sent ? 0 : i - sent;
        if (start_up(bench, 1500) != HOST_READY) {
            fail_msg("without frame %zu of the %s: %s", i <= sent ? i : i - sent,
                     i <= sent ? "host" : "boards", host_message(bench->host));
        }
    }
}

/* index of the first such frame from the given one on, or -1 */
static inline int find_sent(const struct bench *bench, int from, int bus, uint32_t id, uint8_t len,
                            const uint8_t *data)
{
    for (size_t i = (size_t)from; i < bench->nseen; i++) {
        const struct bus_frame *frame = &bench->seen[i];

        if (bench->seen_bus[i] == bus && frame->id == id && frame->len == len &&
            (len == 0 || memcmp(frame->data, data, len) == 0)) {
            return (int)i;
        }
    }
    return -1;
}

static inline bool was_sent(const struct bench *bench, int bus, uint32_t id, uint8_t len,
                            const uint8_t *data)
{
    return find_sent(bench, 0, bus, id, len, data) >= 0;
}

static inline size_t count_sent(const struct bench *bench, uint32_t id)
{
    size_t count = 0;

    for (size_t i = 0; i < bench->nseen; i++) {
        count += bench->seen[i].id == id;
    }
    return count;
}

#endif
