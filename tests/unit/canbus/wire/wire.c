/* SPDX-License-Identifier: Apache-2.0 */
/* The wire with healthy nodes: times, arbitration, queues, load, latency. */
#include "tests/unit/canbus/wire/wire_bench.h"

#include "base/array.h"

static struct wire_bench bench;

FIXTURE(tear_down)
{
    bench_close(&bench);
    return 0;
}

TEST_WITH(a_frame_arrives_at_the_end_of_its_eof, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    const struct wire_log *event;

    bench_open(&bench, (struct wire_config){0});
    wire_advance(bench.wire, 10 * US);
    assert_true(wire_transmit(bench.wire, 1, &frame));
    wire_advance(bench.wire, 10 * US + bench_duration(&frame, 1000000, 0) - 1);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 0);
    wire_advance(bench.wire, 10 * US + bench_duration(&frame, 1000000, 0));
    event = bench_event(&bench, WIRE_TRANSMIT, 0);
    assert_non_null(event);
    assert_int_equal(event->event.node, 1);
    assert_int_equal(event->event.receivers, 5);
    assert_int_equal(event->event.time_ns, 10 * US + bench_duration(&frame, 1000000, 0));
    assert_int_equal(event->frame.time_ns, event->event.time_ns);
    assert_memory_equal(event->frame.data, frame.data, 8);
    assert_non_null(bench_event(&bench, WIRE_CONFIRM, 0));
    assert_int_equal(bench_node(&bench, 1).confirmed, 1);
}

TEST_WITH(frames_follow_each_other_after_three_bits, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    int64_t length = bench_duration(&frame, 500000, 0);

    bench_open(&bench, (struct wire_config){.bitrate = 500000});
    for (int i = 0; i < 5; i++) {
        wire_transmit(bench.wire, 0, &frame);
    }
    wire_advance(bench.wire, 100 * MS);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, (size_t)i)->event.time_ns,
                         length + i * (length + 6 * US));
    }
}

TEST_WITH(fd_frames_go_at_two_rates, NULL, tear_down)
{
    struct bus_frame frame = {
        .id = 0x1ABCDEF0, .flags = FRAME_FD | FRAME_BRS | FRAME_EXTENDED, .len = 64};

    bench_open(&bench, (struct wire_config){.fd = true, .data_bitrate = 8000000});
    memset(frame.data, 0x0F, sizeof frame.data);
    wire_transmit(bench.wire, 0, &frame);
    wire_advance(bench.wire, MS);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 0)->event.time_ns,
                     bench_duration(&frame, 1000000, 8000000));
}

/* Frames without a gap at rates that do not divide 1 GHz end where all their bits end, the last of
 * thousands too, to the nearest nanosecond at each of the two rates. */
TEST_WITH(no_rounding_adds_up_over_frames_that_follow_each_other, NULL, tear_down)
{
    static const struct {
        int64_t bitrate, data_bitrate;
    } rates[] = {{83333, 0}, {33333, 0}, {666666, 0}, {800000, 0}, {666666, 1333333}, {95238, 0}};

    for (size_t i = 0; i < ARRAY_COUNT(rates); i++) {
        struct random_stream random = random_named(17, "rates");
        const int64_t rate = rates[i].bitrate, fast = rates[i].data_bitrate;
        int64_t slow_bits = 0, fast_bits = 0;

        bench_open(&bench, (struct wire_config){.bitrate = rate,
                                                .data_bitrate = fast,
                                                .fd = fast != 0,
                                                .events = 1 << WIRE_TRANSMIT});
        for (size_t n = 0; n < 10000; n++) {
            struct bus_frame frame =
                bench_frame((uint32_t)(random_bits(&random) % 2048), (uint8_t)(n % 9));
            long double exact_ns;
            unsigned nominal, data;

            frame.flags = fast ? FRAME_FD | FRAME_BRS : 0;
            reference_length(&frame, &nominal, &data);
            slow_bits += nominal;
            fast_bits += data;
            exact_ns = (long double)slow_bits * 1e9L / rate +
                       (fast ? (long double)fast_bits * 1e9L / fast : 0.0L);
            assert_true(wire_transmit(bench.wire, n % 2, &frame));
            while (bench.count == n) { /* the next is ready before this one's intermission ends */
                wire_advance(bench.wire, wire_now(bench.wire) + US);
            }
            if (fabsl((long double)bench.log[n].event.time_ns - exact_ns) >
                (fast ? 1.01L : 0.51L)) {
                fail_msg("at %lld bit/s frame %zu ends at %lld ns, not %.3Lf", (long long)rate, n,
                         (long long)bench.log[n].event.time_ns, exact_ns);
            }
            slow_bits += 3;
        }
        bench_close(&bench);
    }
    memset(&bench, 0, sizeof bench);
}

TEST_WITH(arbitration_is_by_the_bits_of_the_identifier, NULL, tear_down)
{
    const struct bus_frame frames[] = {
        {.id = 0x124},
        {.id = 0x123u << 18, .flags = FRAME_EXTENDED},
        {.id = 0x123, .flags = FRAME_REMOTE},
        {.id = 0x123},
        {.id = 0x122, .flags = FRAME_REMOTE},
    };
    const uint32_t order[] = {0x122, 0x123, 0x123, 0x123u << 18, 0x124};

    bench_open(&bench, (struct wire_config){.nodes = 5});
    for (size_t i = 0; i < 5; i++) {
        wire_transmit(bench.wire, i, &frames[i]);
    }
    wire_advance(bench.wire, MS);
    for (size_t i = 0; i < 5; i++) {
        assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, i)->frame.id, order[i]);
    }
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->frame.flags, 0);
    assert_int_equal(bench_stats(&bench).arbitration_lost, 4 + 3 + 2 + 1);
    assert_int_equal(bench_node(&bench, 0).arbitration_lost, 4);
}

TEST_WITH(a_fifo_lets_urgent_frames_wait_and_mailboxes_do_not, NULL, tear_down)
{
    for (int fifo = 0; fifo < 2; fifo++) {
        struct bus_frame late = bench_frame(0x700, 8), urgent = bench_frame(0x001, 0);
        struct bus_frame other = bench_frame(0x300, 4);

        bench_open(&bench, (struct wire_config){.order = fifo ? WIRE_FIFO : WIRE_PRIORITY});
        wire_transmit(bench.wire, 0, &late);
        wire_transmit(bench.wire, 0, &urgent);
        wire_transmit(bench.wire, 1, &other);
        wire_advance(bench.wire, MS);
        assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 0)->frame.id, fifo ? 0x300 : 0x001);
        assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 2)->frame.id, fifo ? 0x001 : 0x700);
        bench_close(&bench);
    }
    memset(&bench, 0, sizeof bench);
}

TEST_WITH(full_queues_drop_the_newest_and_say_so, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){.queue = 4});
    for (uint32_t i = 0; i < 7; i++) {
        struct bus_frame frame = bench_frame(0x100, 8);

        frame.data[0] = (uint8_t)i;
        assert_int_equal(wire_transmit(bench.wire, 2, &frame), i < 4);
    }
    wire_transmit(bench.wire, 2, &(struct bus_frame){.id = 0x800});
    wire_transmit(bench.wire, 2, &(struct bus_frame){.flags = FRAME_FD});
    wire_advance(bench.wire, 10 * MS);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 4);
    for (size_t i = 0; i < 4; i++) {
        assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, i)->frame.data[0], i);
    }
    assert_int_equal(bench_node(&bench, 2).dropped[WIRE_DROP_QUEUE_FULL], 3);
    assert_int_equal(bench_node(&bench, 2).dropped[WIRE_DROP_INVALID], 2);
    assert_int_equal(bench_node(&bench, 2).queued_peak, 4);
    assert_int_equal(bench_node(&bench, 2).queued, 0);
    assert_int_equal(wire_dropped(bench.wire), 5);
}

/* ---- against a simulation without any cleverness ---- */

enum { BRUTE_NODES = 6, BRUTE_FRAMES = 3000 };

struct brute {
    struct bus_frame frame;
    size_t node;
    int64_t ready_ns, end_ns;
    bool sent;
};

/* Of all frames that are ready when the bus is free, the one whose bits are dominant first; among
 * equal ones of a node the first that came. */
static int brute_next(const struct brute *frames, int64_t free_ns, int64_t *start_ns)
{
    int64_t first_ready = INT64_MAX;
    int best = -1;

    for (int i = 0; i < BRUTE_FRAMES; i++) {
        if (!frames[i].sent && frames[i].ready_ns < first_ready) {
            first_ready = frames[i].ready_ns;
        }
    }
    *start_ns = first_ready > free_ns ? first_ready : free_ns;
    for (int i = 0; i < BRUTE_FRAMES; i++) {
        struct reference a, b;

        if (frames[i].sent || frames[i].ready_ns > *start_ns) {
            continue;
        }
        if (best < 0) {
            best = i;
            continue;
        }
        reference_fields(&frames[i].frame, &a);
        reference_fields(&frames[best].frame, &b);
        for (int k = 0; k < 33; k++) {
            if (a.bit[k] != b.bit[k]) {
                best = a.bit[k] < b.bit[k] ? i : best;
                break;
            }
            /* A standard frame has won with a dominant IDE */
            if (k == 13 && a.bit[k] == '0') {
                break;
            }
        }
    }
    return best;
}

TEST_WITH(everything_happens_as_in_a_brute_force_simulation, NULL, tear_down)
{
    struct brute *frames = test_calloc(BRUTE_FRAMES, sizeof *frames);
    struct random_stream random = random_named(7, "brute");
    int64_t time = 0, free_ns = 0, start_ns;
    size_t sent = 0;

    bench_open(&bench, (struct wire_config){.nodes = BRUTE_NODES, .queue = 4096});
    for (int i = 0; i < BRUTE_FRAMES; i++) {
        struct brute *b = &frames[i];

        time += random_uniform(&random) < 0.5 ? 0 : (int64_t)(random_uniform(&random) * 200 * US);
        b->node = random_bits(&random) % BRUTE_NODES;
        b->ready_ns = time;
        /* No identifier on two nodes */
        b->frame = bench_frame((uint32_t)(random_bits(&random) % 80 * 8 + b->node),
                               (uint8_t)(random_bits(&random) % 9));
        if (random_bits(&random) % 4 == 0) {
            b->frame.id <<= 18;
            b->frame.flags |= FRAME_EXTENDED;
        }
        b->frame.data[7] = (uint8_t)i;
        wire_advance(bench.wire, time);
        assert_true(wire_transmit(bench.wire, b->node, &b->frame));
    }
    wire_advance(bench.wire, time + 1000 * MS);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT) > 0, 1);
    for (size_t i = 0; i < bench.count; i++) {
        const struct wire_log *event = &bench.log[i];
        int next;

        if (event->event.kind != WIRE_TRANSMIT) {
            continue;
        }
        next = brute_next(frames, free_ns, &start_ns);
        assert_true(next >= 0);
        frames[next].sent = true;
        frames[next].end_ns = start_ns + bench_duration(&frames[next].frame, 1000000, 0);
        free_ns = frames[next].end_ns + 3 * US;
        assert_int_equal(event->frame.id, frames[next].frame.id);
        assert_memory_equal(event->frame.data, frames[next].frame.data, 8);
        assert_int_equal(event->event.time_ns, frames[next].end_ns);
        sent++;
    }
    assert_int_equal(sent, BRUTE_FRAMES);
    test_free(frames);
}

/* ---- response times ---- */

enum { STREAMS = 8 };

struct stream {
    uint32_t id;
    uint8_t len;
    int64_t period_ns;
};

/* Davis, Burns, Bril, Lukkien 2007: queueing delay behind the longest lower frame and everything
 * higher, solved by iteration; deadlines within the periods. */
static int64_t response_bound(const struct stream *streams, int of)
{
    int64_t blocking = 0, own = (55 + 10 * streams[of].len) * US, delay, before;

    for (int k = of + 1; k < STREAMS; k++) {
        int64_t length = (55 + 10 * streams[k].len) * US;

        blocking = length > blocking ? length : blocking;
    }
    delay = blocking > own ? blocking : own;
    do {
        before = delay;
        delay = blocking > own ? blocking : own;
        for (int k = 0; k < of; k++) {
            delay += ((before + US) / streams[k].period_ns +
                      ((before + US) % streams[k].period_ns != 0)) *
                     (55 + 10 * streams[k].len) * US;
        }
    } while (delay != before);
    return delay + own;
}

TEST_WITH(latencies_stay_within_the_response_time_analysis, NULL, tear_down)
{
    const struct stream streams[STREAMS] = {
        {0x010, 3, 1 * MS}, {0x020, 3, 1 * MS}, {0x0F0, 8, 2 * MS}, {0x100, 8, 2 * MS},
        {0x110, 8, 4 * MS}, {0x200, 6, 5 * MS}, {0x300, 8, 5 * MS}, {0x7F0, 8, 10 * MS}};
    struct random_stream random = random_named(8, "streams");
    int64_t worst_of_lowest = 0, bound;

    for (int round = 0; round < 20; round++) {
        int64_t due[STREAMS], sent_ns[STREAMS][512], worst_ns[STREAMS] = {0}, worst = 0;
        size_t sent[STREAMS] = {0}, came[STREAMS] = {0};

        bench_open(&bench, (struct wire_config){.nodes = STREAMS, .events = 1 << WIRE_CONFIRM});
        for (int i = 0; i < STREAMS; i++) {
            due[i] = round ? (int64_t)(random_uniform(&random) * (double)streams[i].period_ns) : 0;
        }
        for (;;) {
            struct bus_frame frame;
            int next = 0;

            for (int i = 1; i < STREAMS; i++) {
                next = due[i] < due[next] ? i : next;
            }
            if (due[next] >= 500 * MS) {
                break;
            }
            wire_advance(bench.wire, due[next]);
            frame = bench_frame(streams[next].id, streams[next].len);
            for (int k = 0; k < frame.len; k++) {
                frame.data[k] = random_bits(&random) & 1 ? 0x00 : 0x3C;
            }
            wire_transmit(bench.wire, (size_t)next, &frame);
            sent_ns[next][sent[next]++] = due[next];
            due[next] += streams[next].period_ns;
        }
        for (size_t i = 0; i < bench.count; i++) {
            const size_t node = bench.log[i].event.node;
            const int64_t latency = bench.log[i].event.time_ns - sent_ns[node][came[node]++];

            assert_true(latency >= 47 * US && latency <= response_bound(streams, (int)node));
            worst_ns[node] = latency > worst_ns[node] ? latency : worst_ns[node];
            worst = latency > worst ? latency : worst;
        }
        /* The statistics have the longest of all, and whose it is */
        assert_int_equal(bench_stats(&bench).latency_max_ns, worst);
        for (size_t i = 0; i < STREAMS; i++) {
            assert_true(streams[i].id != bench_stats(&bench).latency_max_id ||
                        worst_ns[i] == worst);
        }
        worst_of_lowest = worst_ns[7] > worst_of_lowest ? worst_ns[7] : worst_of_lowest;
        bench_close(&bench);
    }
    bound = response_bound(streams, STREAMS - 1);
    print_message("lowest priority: worst latency %lld us, bound %lld us\n",
                  (long long)(worst_of_lowest / US), (long long)(bound / US));
    /* The bound is worth something: simultaneous release comes near it */
    assert_true(worst_of_lowest > bound * 7 / 10);
    memset(&bench, 0, sizeof bench);
}

/* ---- load ---- */

TEST_WITH(load_is_the_time_of_the_bits_and_the_intermission, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    int64_t busy = bench_duration(&frame, 1000000, 0) + 3 * US;
    struct wire_stats stats;

    bench_open(&bench, (struct wire_config){.window_ns = 10 * MS});
    /* 40 ms with 5 frames a millisecond, 40 ms with none */
    for (int64_t tick = 0; tick < 80; tick++) {
        wire_advance(bench.wire, tick * MS);
        for (int i = 0; i < (tick < 40 ? 5 : 0); i++) {
            wire_transmit(bench.wire, 0, &frame);
        }
        if (tick == 35) {
            stats = bench_stats(&bench);
            assert_int_equal(stats.busy_ns, 35 * 5 * busy);
            assert_true(stats.load_now == (double)(50 * busy) / (double)(10 * MS));
        }
    }
    wire_advance(bench.wire, 80 * MS);
    stats = bench_stats(&bench);
    assert_int_equal(stats.frames, 200);
    assert_int_equal(stats.busy_ns, 200 * busy);
    assert_true(stats.load_mean == (double)(200 * busy) / (double)(80 * MS));
    assert_true(stats.load_peak == (double)(50 * busy) / (double)(10 * MS));
    assert_true(stats.load_now == 0.0);
}

TEST_WITH(an_overloaded_bus_is_full_and_its_queue_says_so, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    struct wire_stats stats;

    bench_open(&bench, (struct wire_config){.queue = 32});
    for (int64_t tick = 0; tick < 1000; tick++) {
        wire_advance(bench.wire, tick * MS);
        for (int i = 0; i < 12; i++) {
            wire_transmit(bench.wire, 0, &frame);
        }
    }
    wire_advance(bench.wire, 1000 * MS);
    stats = bench_stats(&bench);
    assert_true(stats.load_mean > 0.9999 && stats.load_mean <= 1.0);
    assert_int_equal(stats.queued_peak, 32);
    assert_true(stats.dropped[WIRE_DROP_QUEUE_FULL] > 2000);
    assert_int_equal(stats.frames + stats.dropped[WIRE_DROP_QUEUE_FULL] + stats.queued, 12000);
}

TEST_WITH(equal_calls_give_equal_events_however_time_is_cut, NULL, tear_down)
{
    struct wire_log *first = test_calloc(4096, sizeof *first);
    size_t count = 0;

    for (int round = 0; round < 2; round++) {
        struct random_stream random = random_named(9, "cut");

        bench_open(&bench, (struct wire_config){.nodes = 4, .seed = 5});
        wire_inject(bench.wire, &(struct wire_fault){.kind = WIRE_FAULT_CORRUPT,
                                                     .node = WIRE_ANY,
                                                     .receiver = WIRE_ANY,
                                                     .probability = 0.05});
        for (int64_t tick = 0; tick < 200; tick++) {
            for (int i = 0; i < 4; i++) {
                struct bus_frame frame = bench_frame((uint32_t)(random_bits(&random) % 2048), 8);

                wire_transmit(bench.wire, (size_t)i, &frame);
            }
            for (int64_t cut = 1; cut < 7 && round; cut++) {
                wire_advance(bench.wire, tick * MS + cut * 137 * US);
            }
            wire_advance(bench.wire, (tick + 1) * MS);
        }
        if (!round) {
            count = bench.count;
            assert_true(count > 1000 && count < 4096);
            memcpy(first, bench.log, count * sizeof *first);
        } else {
            assert_int_equal(bench.count, count);
            for (size_t i = 0; i < count; i++) {
                assert_int_equal(first[i].event.time_ns, bench.log[i].event.time_ns);
                assert_int_equal(first[i].event.kind, bench.log[i].event.kind);
                assert_int_equal(first[i].frame.id, bench.log[i].frame.id);
                assert_int_equal(first[i].event.tec, bench.log[i].event.tec);
            }
        }
        bench_close(&bench);
    }
    test_free(first);
    memset(&bench, 0, sizeof bench);
}

TEST(impossible_configurations_are_refused_with_a_reason)
{
    static const struct {
        struct wire_config config;
        const char *message;
    } cases[] = {
        {{.bitrate = 1000000, .nodes = 0, .queue = 1}, "found 0 nodes"},
        {{.bitrate = 1000000, .nodes = 64, .queue = 1}, "expected 1 to 63"},
        {{.bitrate = 1000000, .nodes = 1, .queue = 0}, "queue of 0"},
        {{.bitrate = 999, .nodes = 1, .queue = 1}, "bit rate of 999"},
        {{.bitrate = 500000, .data_bitrate = 250000, .nodes = 1, .queue = 1},
         "expected the nominal"},
    };
    struct arena arena;
    struct error error;
    struct wire *wire;

    assert_ok(arena_init(&arena, 1 << 20, &error));
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        assert_int_equal(wire_create(&cases[i].config, &arena, &wire, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, cases[i].message));
    }
    arena_fini(&arena);
    /* Every size of arena that is too small is survived */
    for (size_t size = 1 << 12; size < 1 << 17; size += 1 << 12) {
        const struct wire_config config = {.bitrate = 1000000, .nodes = 60, .queue = 64};

        assert_ok(arena_init(&arena, size, &error));
        assert_int_equal(wire_create(&config, &arena, &wire, &error), ERROR_MEMORY);
        arena_fini(&arena);
    }
}
