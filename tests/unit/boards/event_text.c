/* SPDX-License-Identifier: Apache-2.0 */
/* Events of boards as lines of a log, and the ring that they pass through. */
#include "tests/unit/boards/board_bench.h"

#include <pthread.h>
#include <stdatomic.h>

TEST_ON(events_read_as_sentences, bench_open, bench)
{
    char text[256];
    struct board_event event;

    bench_ticks(bench, 1500);
    bench_send(bench, 0, 0x001, "89 50");
    assert_true(bench_event(bench, BOARD_EVENT_MODE, &event));
    assert_int_equal(event.a, 0x00);
    assert_int_equal(event.b, 0x50);
    board_event_format(bench->boards, &event, text, sizeof text);
    assert_string_equal(text, "1.500000 s: leg 1 (bus 0, address 1): axis 1 from idle to voltage "
                              "mode");
    bench->sense[1].current_a = 99.0;
    bench_ticks(bench, 2);
    assert_true(bench_event(bench, BOARD_EVENT_FAULT, &event));
    board_event_format(bench->boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "axis 1 has a fault: over-current"));
    assert_true(boards_fault(bench->boards));
    bench_send(bench, 0, 0x001, "89 09");
    assert_false(boards_fault(bench->boards));
    bench_send(bench, 1, 0x001, "6B");
    assert_true(bench_event(bench, BOARD_EVENT_UNKNOWN, &event));
    board_event_format(bench->boards, &event, text, sizeof text);
    assert_non_null(strstr(text, "arm 1 (bus 1, address 1): unknown command 0x6b (id 0x001)"));
}

TEST_ON(every_kind_of_event_has_its_sentence, bench_open, bench)
{
    static const struct {
        struct board_event event;
        const char *text;
    } cases[] = {
        {{.kind = BOARD_EVENT_MODE, .axis = 1, .a = 0x01, .b = 0x02},
         "axis 1 from position to velocity mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x03, .b = 0x04},
         "axis 0 from torque to impedance position mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x05, .b = 0x06},
         "axis 0 from impedance velocity to current mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x07, .b = 0x08},
         "axis 0 from mixed to direct position mode"},
        {{.kind = BOARD_EVENT_MODE, .a = 0x60, .b = 0xa0},
         "axis 0 from calibration to hardware fault mode"},
        {{.kind = BOARD_EVENT_FAULT, .a = 0x21},
         "axis 0 has a fault: under-voltage, absolute encoder"},
        {{.kind = BOARD_EVENT_TIMEOUT, .a = 0x50},
         "axis 0: the voltage command timed out, reference set to 0"},
        {{.kind = BOARD_EVENT_SOURCE_LOST, .a = 12},
         "axis 0: torque source 12 timed out, motor switched off"},
        {{.kind = BOARD_EVENT_LIMIT, .a = (uint32_t)-5},
         "axis 0 is beyond its position limit at -5 ticks, voltage set to 0"},
        {{.kind = BOARD_EVENT_MALFORMED, .a = 0x001, .b = 0x72},
         "wrong length or value in command 0x72 (id 0x001)"},
        {{.kind = BOARD_EVENT_ADDRESS, .a = 1, .b = 5}, "address changed from 1 to 5"},
        {{.kind = BOARD_EVENT_RESTART, .a = 1}, "bootloader entered"},
        {{.kind = BOARD_EVENT_FIRMWARE, .a = 18, .b = 0x12ab},
         "firmware received, 18 bytes, "
         "CRC-32 000012ab"},
        {{.kind = BOARD_EVENT_RESTART, .a = 0}, "application started"},
        {{.kind = BOARD_EVENT_OVERFLOW, .a = 3}, "frames lost, 3 so far"},
        {{.kind = BOARD_EVENT_OVER_HEATED, .axis = 1, .a = 705},
         "axis 1 is too hot: 70.5 degree C"},
    };
    char text[256];

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *what;

        board_event_format(bench->boards, &cases[i].event, text, sizeof text);
        what = strstr(text, "): ");
        assert_non_null(what);
        assert_string_equal(what + 3, cases[i].text);
    }
    board_event_format(bench->boards, &cases[0].event, text, 10); /* cut, not overrun */
    assert_int_equal(strlen(text), 9);
}

TEST_ON(events_that_nobody_reads_are_counted_as_lost, bench_open, bench)
{
    struct board_event event;
    int read = 0;

    for (int i = 0; i < 3000; i++) {
        bench_send(bench, 0, 0x001, "6B");
    }
    while (boards_next_event(bench->boards, &event)) {
        read++;
    }
    assert_true(read > 0);
    assert_int_equal((uint64_t)read + bench_counters(bench).events_lost, 3000);
}

struct reader {
    struct boards *boards;
    atomic_bool done;
    uint64_t read;
    bool in_order;
};

static void *read_events(void *argument)
{
    struct reader *reader = argument;
    struct board_event event;
    uint32_t last = 0;
    bool done;

    do {
        done = atomic_load(&reader->done);
        while (boards_next_event(reader->boards, &event)) {
            char text[256];

            board_event_format(reader->boards, &event, text, sizeof text);
            reader->in_order &= event.kind != BOARD_EVENT_UNKNOWN || event.b >= last;
            last = event.kind == BOARD_EVENT_UNKNOWN ? event.b : last;
            reader->read++;
        }
    } while (!done);
    return NULL;
}

TEST_ON(another_thread_reads_events_while_the_loop_runs, bench_open, bench)
{
    static const uint8_t unknown[] = {0x00, 0x01, 0x02, 0x35, 0x36, 0x38, 0x3b, 0x6b, 0x7b, 0x7f};
    struct reader reader = {.in_order = true};
    pthread_t thread;

    reader.boards = bench->boards;
    assert_int_equal(pthread_create(&thread, NULL, read_events, &reader), 0);
    for (int i = 0; i < 10000; i++) {
        struct bus_frame frame = {.id = 0x001, .len = 1, .data = {unknown[i / 1000]}};

        boards_receive(bench->boards, bench->now_ns, 0, &frame);
        bench_tick(bench);
    }
    atomic_store(&reader.done, true);
    pthread_join(thread, NULL);
    assert_true(reader.in_order);
    assert_int_equal(reader.read + bench_counters(bench).events_lost, 10000);
}
