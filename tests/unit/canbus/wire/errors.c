/* SPDX-License-Identifier: Apache-2.0 */
/* The wire with noise, faults and bad nodes: error flags, counters, states, recovery. */
#include "tests/unit/canbus/wire/wire_bench.h"

static struct wire_bench bench;

FIXTURE(tear_down)
{
    bench_close(&bench);
    memset(&bench, 0, sizeof bench);
    return 0;
}

static int inject(enum wire_fault_kind kind, int receiver, uint64_t count)
{
    int fault = wire_inject(bench.wire, &(struct wire_fault){.kind = kind,
                                                             .node = WIRE_ANY,
                                                             .receiver = receiver,
                                                             .count = count,
                                                             .delay_ns = 700 * US});

    assert_true(fault >= 0);
    return fault;
}

static void send(size_t node, uint32_t id)
{
    struct bus_frame frame = bench_frame(id, 8);

    assert_true(wire_transmit(bench.wire, node, &frame));
}

TEST_WITH(a_corrupted_frame_is_signaled_and_sent_again, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    int64_t length = bench_duration(&frame, 1000000, 0), again, flag_and_more;
    unsigned shortest = 99, longest = 0;

    for (uint64_t seed = 0; seed < 300; seed++) {
        const struct wire_log *error, *event;

        bench_open(&bench, (struct wire_config){.seed = seed});
        inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 1);
        send(0, 0x123);
        wire_advance(bench.wire, MS);
        error = bench_event(&bench, WIRE_BUS_ERROR, 0);
        event = bench_event(&bench, WIRE_TRANSMIT, 0);
        assert_int_equal(error->event.tec, 8);
        assert_int_equal(error->event.error, WIRE_BIT_ERROR);
        assert_int_equal(bench_events(&bench, WIRE_BUS_ERROR), 1);
        assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 1);
        again = event->event.time_ns - length;
        assert_int_equal(again, error->event.time_ns + 3 * US);
        /* Not before the control field, nor behind the CRC */
        flag_and_more = error->event.time_ns;
        assert_true(flag_and_more >= (14 + 6 + 8) * US);
        assert_true(flag_and_more <= length - 10 * US + (12 + 8) * US);
        assert_int_equal(flag_and_more % US, 0);
        shortest =
            (unsigned)(flag_and_more / US) < shortest ? (unsigned)(flag_and_more / US) : shortest;
        longest =
            (unsigned)(flag_and_more / US) > longest ? (unsigned)(flag_and_more / US) : longest;
        assert_int_equal(bench_node(&bench, 0).tec, 7);
        assert_int_equal(bench_node(&bench, 1).rec, 0);
        assert_int_equal(bench_node(&bench, 1).rec_peak, 1);
        assert_int_equal(bench_stats(&bench).errors[WIRE_BIT_ERROR], 1);
        bench_close(&bench);
    }
    assert_true(shortest < 50 && longest > 110);
    memset(&bench, 0, sizeof bench);
}

/* The reference for the length of superposed flags: every node by itself, bit by bit. */
TEST_WITH(overlapping_flags_last_six_to_twelve_bits, NULL, tear_down)
{
    struct bus_frame frame = {.id = 0x555, .len = 8};
    struct reference bits;
    unsigned seen[16] = {0};

    memset(frame.data, 0xA3, sizeof frame.data);
    reference_encode(&frame, &bits);
    for (uint64_t seed = 0; seed < 400; seed++) {
        int64_t end;
        bool found = false;

        bench_open(&bench, (struct wire_config){.seed = seed, .nodes = 2});
        inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 1);
        wire_transmit(bench.wire, 0, &frame);
        wire_advance(bench.wire, MS);
        end = bench_event(&bench, WIRE_BUS_ERROR, 0)->event.time_ns / US;
        /* Some bit must explain the end: up to it the frame, inverted there; then the sender's six
         * dominant bits; the receiver's six begin behind the sixth equal bit that it reads */
        for (int64_t at = 13; at < (int64_t)bits.delimiter && !found; at++) {
            int run = 1, last = !reference_value(bits.bit[at]);
            int64_t receiver = -1, stop;

            for (int64_t k = at - 1; k >= 0 && reference_value(bits.bit[k]) == last; k--) {
                run++;
            }
            for (int64_t k = at + 1; receiver < 0; k++) {
                if (run >= 6) {
                    receiver = k;
                }
                run = last == 0 ? run + 1 : 1;
                last = 0;
            }
            stop = (receiver > at + 1 ? receiver : at + 1) + 6;
            found = stop + 8 == end;
            if (found) {
                seen[stop - at - 1]++;
            }
        }
        assert_true(found);
        bench_close(&bench);
    }
    assert_true(seen[11] > 0 && seen[12] > 0);
    memset(&bench, 0, sizeof bench);
}

/* The bit behind all flags and their delimiter when one receiver misreads a bit: every node by
 * itself, bit by bit. It finds six equal bits, else a wrong CRC behind the ACK field. */
static int64_t misread_end(const struct reference *bits, int64_t wrong)
{
    int64_t found = (int64_t)bits->delimiter + 2, sender = -1, other = -1, end;
    int run = 0, last = -1;

    for (int64_t i = 0; i < (int64_t)bits->delimiter; i++) {
        const int read = reference_value(bits->bit[i]) ^ (i == wrong);

        run = read == last ? run + 1 : 1;
        last = read;
        if (run == 6 && i >= wrong) {
            found = i;
            break;
        }
    }
    if (found > (int64_t)bits->delimiter) {
        return found + 1 + 7 + 8; /* all others answer to its first bit */
    }
    /* The sender sends on until it reads a recessive bit of its own as dominant; the other receiver
     * until it has read six dominant bits */
    run = 0;
    for (int64_t i = found; i >= 0 && !reference_value(bits->bit[i]); i--) {
        run++;
    }
    for (int64_t t = found + 1; sender < 0 || other < 0; t++) {
        other = other < 0 && run >= 6 ? t : other;
        sender = sender < 0 && reference_value(bits->bit[t]) ? t + 1 : sender;
        run++;
    }
    end = sender > other ? sender : other;
    return (end > found + 1 ? end : found + 1) + 6 + 8;
}

TEST_WITH(a_receivers_error_ends_where_each_node_by_itself_says, NULL, tear_down)
{
    struct bus_frame frame = {.id = 0x555, .len = 8};
    bool predicted[256] = {false}, seen[256] = {false};
    struct reference bits;

    memset(frame.data, 0xA3, sizeof frame.data);
    reference_encode(&frame, &bits);
    for (int64_t wrong = 13; wrong < (int64_t)bits.delimiter; wrong++) {
        predicted[misread_end(&bits, wrong)] = true;
    }
    for (uint64_t seed = 0; seed < 2000; seed++) {
        bench_open(&bench, (struct wire_config){.seed = seed});
        inject(WIRE_FAULT_CORRUPT_AT, 1, 1);
        wire_transmit(bench.wire, 0, &frame);
        wire_advance(bench.wire, MS);
        seen[bench_event(&bench, WIRE_BUS_ERROR, 0)->event.time_ns / US] = true;
        assert_int_equal(bench_node(&bench, 1).rec_peak, 9);
        assert_int_equal(bench_node(&bench, 2).rec_peak, 1);
        bench_close(&bench);
    }
    for (int end = 0; end < 256; end++) {
        if (predicted[end] != seen[end]) {
            fail_msg("an error that ends behind bit %d: predicted %d, seen %d", end, predicted[end],
                     seen[end]);
        }
    }
    memset(&bench, 0, sizeof bench);
}

/* The bits of an FD frame behind its rate switch are short, also before an error. */
TEST_WITH(an_error_in_an_fd_frame_ends_before_the_frame_would, NULL, tear_down)
{
    struct bus_frame frame = {.id = 0x123, .flags = FRAME_FD | FRAME_BRS, .len = 64};
    int64_t earliest = INT64_MAX, latest = 0;

    for (uint64_t seed = 0; seed < 200; seed++) {
        int64_t end;

        bench_open(&bench, (struct wire_config){.seed = seed, .fd = true, .data_bitrate = 4000000});
        inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 1);
        wire_transmit(bench.wire, 0, &frame);
        wire_advance(bench.wire, MS);
        end = bench_event(&bench, WIRE_BUS_ERROR, 0)->event.time_ns;
        earliest = end < earliest ? end : earliest;
        latest = end > latest ? end : latest;
        bench_close(&bench);
    }
    /* Error flags and delimiter are 14 to 20 bits at the nominal rate; EOF and more are 10 */
    assert_in_range(latest, bench_duration(&frame, 1000000, 4000000) - 12 * US,
                    bench_duration(&frame, 1000000, 4000000) + 10 * US);
    assert_in_range(earliest, (14 + 14) * US, (20 + 20) * US);
    memset(&bench, 0, sizeof bench);
}

TEST_WITH(a_node_alone_gets_passive_but_never_bus_off, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    int64_t to_ack = bench_duration(&frame, 1000000, 0) - 8 * US, expected = 0;

    bench_open(&bench, (struct wire_config){.nodes = 1});
    send(0, 0x123);
    wire_advance(bench.wire, 100 * MS);
    for (size_t i = 0; i < 40; i++) {
        const struct wire_log *error = bench_event(&bench, WIRE_BUS_ERROR, i);

        expected += to_ack + (6 + 8) * US;
        assert_int_equal(error->event.error, WIRE_ACK_ERROR);
        assert_int_equal(error->event.time_ns, expected);
        assert_int_equal(error->event.tec, i < 16 ? 8 * (i + 1) : 128);
        expected += i < 15 ? 3 * US : 11 * US; /* suspend transmission */
    }
    assert_int_equal(bench_events(&bench, WIRE_STATUS), 2);
    assert_int_equal(bench_event(&bench, WIRE_STATUS, 0)->event.state, WIRE_ERROR_WARNING);
    assert_int_equal(bench_event(&bench, WIRE_STATUS, 0)->event.tec, 96);
    assert_int_equal(bench_event(&bench, WIRE_STATUS, 1)->event.state, WIRE_ERROR_PASSIVE);
    assert_int_equal(bench_node(&bench, 0).bus_offs, 0);
}

TEST_WITH(errors_without_end_lead_to_bus_off_after_32, NULL, tear_down)
{
    int fault;
    const struct wire_log *off;

    bench_open(&bench, (struct wire_config){.restart_delay_ns = -1});
    fault = inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 0);
    send(0, 0x123);
    send(0, 0x124);
    wire_advance(bench.wire, 100 * MS);
    assert_int_equal(bench_events(&bench, WIRE_BUS_ERROR), 32);
    assert_int_equal(bench_node(&bench, 0).tec, 256);
    assert_int_equal(bench_node(&bench, 1).rec, 32);
    assert_int_equal(bench_node(&bench, 0).dropped[WIRE_DROP_BUS_OFF], 2);
    off = bench_event(&bench, WIRE_STATUS, 2);
    assert_int_equal(off->event.state, WIRE_BUS_OFF);
    assert_false(wire_transmit(bench.wire, 0, &(struct bus_frame){.id = 1}));
    /* bus-off is for ever */
    wire_advance(bench.wire, 1000 * MS);
    assert_int_equal(bench_node(&bench, 0).state, WIRE_BUS_OFF);
    assert_int_equal(wire_heal(bench.wire, fault), 32);
}

TEST_WITH(recovery_begins_with_the_recessive_bits_of_the_error_frame, NULL, tear_down)
{
    const struct wire_log *off, *on;

    bench_open(&bench, (struct wire_config){0});
    inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 32);
    send(0, 0x123);
    wire_advance(bench.wire, 100 * MS);
    off = bench_event(&bench, WIRE_STATUS, 2);
    on = bench_event(&bench, WIRE_STATUS, 3);
    assert_int_equal(off->event.state, WIRE_BUS_OFF);
    assert_int_equal(on->event.state, WIRE_ERROR_ACTIVE);
    /* bus-off is told at the end of the delimiter, but counting begins then too */
    assert_int_equal(on->event.time_ns - off->event.time_ns, 128 * 11 * US);
}

/* Back to back, each frame ends with 1 + 7 + 3 recessive bits: one occurrence of eleven. */
TEST_WITH(on_a_full_bus_recovery_takes_128_frames, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x100, 8);
    uint64_t frames;

    bench_open(&bench, (struct wire_config){.queue = 1024});
    wire_force_bus_off(bench.wire, 2);
    assert_int_equal(bench_node(&bench, 2).state, WIRE_BUS_OFF);
    for (int i = 0; i < 400; i++) {
        wire_transmit(bench.wire, 0, &frame);
    }
    for (int64_t t = 0; bench_node(&bench, 2).state == WIRE_BUS_OFF; t += 10 * US) {
        wire_advance(bench.wire, t);
        assert_true(t < 400 * 140 * US);
    }
    frames = bench_stats(&bench).frames;
    assert_true(frames >= 127 && frames <= 129);
}

TEST_WITH(restart_waits_for_the_delay, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){.restart_delay_ns = 100 * MS});
    wire_advance(bench.wire, MS);
    wire_force_bus_off(bench.wire, 1);
    wire_advance(bench.wire, 101 * MS + 128 * 11 * US - 1);
    assert_int_equal(bench_node(&bench, 1).state, WIRE_BUS_OFF);
    wire_advance(bench.wire, 101 * MS + 128 * 11 * US);
    assert_int_equal(bench_node(&bench, 1).state, WIRE_ERROR_ACTIVE);
}

TEST_WITH(counters_fall_by_one_with_every_good_frame, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){.queue = 1024});
    inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 20);
    send(0, 0x123);
    wire_advance(bench.wire, 5 * MS);
    /* 20 errors and the frame's success */
    assert_int_equal(bench_node(&bench, 0).tec, 159);
    assert_int_equal(bench_node(&bench, 0).state, WIRE_ERROR_PASSIVE);
    assert_int_equal(bench_node(&bench, 1).rec, 19);
    for (int i = 0; i < 31; i++) {
        send(0, 0x123);
    }
    wire_advance(bench.wire, 20 * MS);
    assert_int_equal(bench_node(&bench, 0).tec, 128);
    assert_int_equal(bench_node(&bench, 0).state, WIRE_ERROR_PASSIVE);
    send(0, 0x123);
    wire_advance(bench.wire, 21 * MS);
    assert_int_equal(bench_node(&bench, 0).state, WIRE_ERROR_WARNING);
    assert_int_equal(bench_node(&bench, 1).rec, 0);
}

TEST_WITH(a_passive_sender_lets_others_go_first, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x010, 8), low = bench_frame(0x700, 8);
    int64_t length = bench_duration(&frame, 1000000, 0), begin;

    bench_open(&bench, (struct wire_config){0});
    inject(WIRE_FAULT_CORRUPT, WIRE_ANY, 20);
    send(0, 0x010);
    wire_advance(bench.wire, 10 * MS);
    assert_int_equal(bench_node(&bench, 0).state, WIRE_ERROR_PASSIVE);
    begin = bench.count;
    /* Alone: 8 bits more between two frames */
    send(0, 0x010);
    send(0, 0x010);
    wire_advance(bench.wire, 20 * MS);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 2)->event.time_ns -
                         bench_event(&bench, WIRE_TRANSMIT, 1)->event.time_ns,
                     length + 11 * US);
    /* With company: the lower priority slips in */
    send(0, 0x010);
    send(0, 0x010);
    wire_transmit(bench.wire, 1, &low);
    wire_advance(bench.wire, 30 * MS);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 3)->frame.id, 0x010);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 4)->frame.id, 0x700);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 5)->frame.id, 0x010);
    assert_true(bench.count > (size_t)begin);
}

TEST_WITH(a_receiver_that_errs_alone_counts_nine, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){0});
    inject(WIRE_FAULT_CORRUPT_AT, 2, 1);
    send(0, 0x123);
    wire_advance(bench.wire, MS);
    assert_int_equal(bench_node(&bench, 0).tec, 7);
    assert_int_equal(bench_node(&bench, 1).rec_peak, 1);
    assert_int_equal(bench_node(&bench, 2).rec_peak, 9);
    assert_int_equal(bench_node(&bench, 2).rec, 8);
    /* After 15 of them it is passive, and only misses frames */
    inject(WIRE_FAULT_CORRUPT_AT, 2, 0);
    for (int i = 0; i < 10; i++) {
        send(0, 0x123);
    }
    wire_advance(bench.wire, 30 * MS);
    assert_int_equal(bench_node(&bench, 2).state, WIRE_ERROR_PASSIVE);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 9)->event.receivers, 2);
    assert_int_equal(bench_node(&bench, 0).confirmed, 11);
    assert_true(bench_node(&bench, 0).tec_peak < 128);
}

TEST_WITH(loss_hides_a_frame_from_one_receiver, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){0});
    inject(WIRE_FAULT_LOSS, 1, 1);
    send(0, 0x123);
    send(0, 0x124);
    wire_advance(bench.wire, MS);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 0)->event.receivers, 4);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->event.receivers, 6);
    assert_int_equal(bench_events(&bench, WIRE_BUS_ERROR), 0);
    assert_int_equal(bench_node(&bench, 0).confirmed, 2);
}

TEST_WITH(late_frames_come_late_and_others_overtake_them, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){0});
    inject(WIRE_FAULT_LATE, WIRE_ANY, 1);
    send(0, 0x123);
    send(0, 0x124);
    wire_advance(bench.wire, 2 * MS);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 2);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 0)->frame.id, 0x124);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->frame.id, 0x123);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->event.time_ns,
                     bench_event(&bench, WIRE_CONFIRM, 0)->event.time_ns + 700 * US);
}

TEST_WITH(a_duplicate_is_received_twice_and_counts_as_an_error, NULL, tear_down)
{
    struct bus_frame frame = bench_frame(0x123, 8);
    int64_t length = bench_duration(&frame, 1000000, 0);

    bench_open(&bench, (struct wire_config){0});
    inject(WIRE_FAULT_DUPLICATE, WIRE_ANY, 1);
    send(0, 0x123);
    wire_advance(bench.wire, MS);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 2);
    assert_int_equal(bench_events(&bench, WIRE_CONFIRM), 1);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->event.time_ns -
                         bench_event(&bench, WIRE_TRANSMIT, 0)->event.time_ns,
                     length + (7 + 8 + 3) * US);
    assert_int_equal(bench_node(&bench, 0).tec, 7);
    assert_int_equal(bench_node(&bench, 1).rec_peak, 0);
}

TEST_WITH(two_nodes_with_one_identifier_climb_until_one_gives_way, NULL, tear_down)
{
    struct bus_frame a = bench_frame(0x123, 8), b = bench_frame(0x123, 8);
    size_t first;

    b.data[3] = 0xFF;
    bench_open(&bench, (struct wire_config){0});
    wire_transmit(bench.wire, 0, &a);
    wire_transmit(bench.wire, 1, &b);
    wire_advance(bench.wire, 20 * MS);
    /* 16 collisions make both passive; then the flag of who sends recessive disturbs nobody */
    assert_int_equal(bench_events(&bench, WIRE_BUS_ERROR), 2 * 16 + 1);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 2);
    first = bench_event(&bench, WIRE_TRANSMIT, 0)->event.node;
    assert_int_equal(first, 0); /* 0x04 against 0xFF: dominant first */
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->event.node, 1);
    assert_int_equal(bench_node(&bench, 0).tec, 127);
    assert_int_equal(bench_node(&bench, 1).tec, 135);
    assert_int_equal(bench_node(&bench, 2).rec_peak, 16);
}

TEST_WITH(equal_frames_at_one_moment_are_one_frame, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){0});
    send(0, 0x123);
    send(1, 0x123);
    wire_advance(bench.wire, MS);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 1);
    assert_int_equal(bench_events(&bench, WIRE_CONFIRM), 2);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 0)->event.receivers, 4);
    assert_int_equal(bench_stats(&bench).frames, 1);
}

TEST_WITH(a_foreign_node_collides_until_it_is_bus_off, NULL, tear_down)
{
    int fault;

    bench_open(&bench, (struct wire_config){.restart_delay_ns = -1, .queue = 1024});
    fault = inject(WIRE_FAULT_COLLISION, WIRE_ANY, 0);
    for (int i = 0; i < 600; i++) {
        send(0, 0x123);
    }
    wire_advance(bench.wire, 200 * MS);
    assert_true(wire_heal(bench.wire, fault) >= 16);
    assert_true(bench_node(&bench, 0).tec_peak >= 128);
    assert_true(bench_node(&bench, 0).errors >= 16);
    assert_true(bench_node(&bench, 0).confirmed > 0);
}

TEST_WITH(an_unplugged_node_hears_nothing_and_sends_when_it_is_back, NULL, tear_down)
{
    bench_open(&bench, (struct wire_config){0});
    wire_connect(bench.wire, 2, false);
    send(0, 0x100);
    send(2, 0x001);
    wire_advance(bench.wire, 20 * MS);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 0)->event.receivers, 2);
    assert_int_equal(bench_events(&bench, WIRE_TRANSMIT), 1);
    assert_int_equal(bench_node(&bench, 2).tec, 128);
    assert_int_equal(bench_node(&bench, 2).errors, 16);
    wire_connect(bench.wire, 2, true);
    wire_advance(bench.wire, 21 * MS);
    assert_int_equal(bench_event(&bench, WIRE_TRANSMIT, 1)->frame.id, 0x001);
    assert_int_equal(bench_node(&bench, 2).state, WIRE_ERROR_WARNING);
}

TEST_WITH(faults_keep_to_their_window_identifier_and_sender, NULL, tear_down)
{
    const struct wire_fault fault = {.kind = WIRE_FAULT_CORRUPT,
                                     .node = 1,
                                     .receiver = WIRE_ANY,
                                     .id = 0x120,
                                     .id_mask = 0x7F0,
                                     .from_ns = 10 * MS,
                                     .until_ns = 20 * MS};
    int number;

    bench_open(&bench, (struct wire_config){.queue = 256, .restart_delay_ns = 0});
    number = wire_inject(bench.wire, &fault);
    for (int64_t tick = 0; tick < 30; tick++) {
        wire_advance(bench.wire, tick * MS);
        send(0, 0x121);
        for (uint32_t id = 0x122; id <= 0x131; id += 15) {
            struct bus_frame frame = bench_frame(id, 8);

            if (id == 0x131 || tick % 10 == 5) {
                wire_transmit(bench.wire, 1, &frame);
            }
        }
    }
    wire_advance(bench.wire, 200 * MS);
    assert_true(wire_heal(bench.wire, number) >= 32);
    for (size_t i = 0; bench_event(&bench, WIRE_BUS_ERROR, i); i++) {
        const struct wire_log *error = bench_event(&bench, WIRE_BUS_ERROR, i);

        assert_int_equal(error->frame.id, 0x122);
        assert_int_equal(error->event.node, 1);
        assert_true(error->event.time_ns >= 15 * MS && error->event.time_ns < 21 * MS);
    }
    assert_int_equal(wire_inject(bench.wire, &(struct wire_fault){.node = 3}), -1);
    assert_int_equal(wire_inject(bench.wire, &(struct wire_fault){.node = 0, .receiver = -2}), -1);
    for (int i = 0; i < WIRE_FAULTS_MAX; i++) {
        assert_int_equal(wire_inject(bench.wire, &fault), i);
    }
    assert_int_equal(wire_inject(bench.wire, &fault), -1);
    wire_heal(bench.wire, 3);
    assert_int_equal(wire_inject(bench.wire, &fault), 3);
}
