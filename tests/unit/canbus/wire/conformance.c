/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The wire against the cases of a conformance test of controllers, in the order of ISO 16845-1:
 * frames received, frames sent, error management, counters, each for classic and, where it differs,
 * for FD frames. Each case passes, fails, or is not applicable with the reason; the table is
 * printed. What errors.c and wire.c show in more depth is here once more, in its shortest form.
 */
#include "tests/unit/canbus/wire/wire_bench.h"

static struct wire_bench bench;

struct conformance_case {
    const char *name;
    bool (*run)(void);
    const char *not_applicable; /* why, when there is nothing to run */
};

/* ---- what the cases share ---- */

static void case_open(struct wire_config config)
{
    bench_open(&bench, config);
}

static void case_inject(enum wire_fault_kind kind, int node, int receiver, uint64_t count)
{
    const struct wire_fault fault = {
        .kind = kind, .node = node, .receiver = receiver, .count = count};

    assert_true(wire_inject(bench.wire, &fault) >= 0);
}

static void case_send(size_t node, uint32_t id)
{
    struct bus_frame frame = bench_frame(id, 8);

    assert_true(wire_transmit(bench.wire, node, &frame));
}

/* Runs for so long, and says how many frames have been carried in all. */
static size_t case_advance(int64_t ms)
{
    wire_advance(bench.wire, wire_now(bench.wire) + ms * MS);
    return bench_events(&bench, WIRE_TRANSMIT);
}

static bool frame_same(const struct bus_frame *a, const struct bus_frame *b)
{
    return a->id == b->id && a->len == b->len && !((a->flags ^ b->flags) & ~FRAME_ESI) &&
           !memcmp(a->data, b->data, a->len);
}

/* Sends a frame from node 0: it must come to all others as it is, at the time of its bits. */
static bool frame_arrives(const struct bus_frame *frame)
{
    int64_t began = wire_now(bench.wire);
    int64_t length = bench_duration(frame, 1000000, frame->flags & FRAME_FD ? 4000000 : 0);
    const struct wire_log *log;

    bench.count = 0;
    if (!wire_transmit(bench.wire, 0, frame) || case_advance(1) != 1) {
        return false;
    }
    log = bench_event(&bench, WIRE_TRANSMIT, 0);
    return frame_same(&log->frame, frame) && log->event.receivers == 6 &&
           log->event.time_ns - began == length;
}

/* A node's counters as the standard's cases reach them: errors of its own frames. */
static void case_raise_tec(uint64_t errors)
{
    case_inject(WIRE_FAULT_CORRUPT, 0, WIRE_ANY, errors);
    case_send(0, 0x100);
    case_advance(40);
}

/* ---- frames received ---- */

static bool every_standard_identifier_and_length(void)
{
    bool good = true;

    case_open((struct wire_config){0});
    for (uint32_t id = 0; id <= 0x7ff && good; id++) {
        struct bus_frame frame = bench_frame(id, (uint8_t)(id % 9));

        good = frame_arrives(&frame);
    }
    return good;
}

static bool extended_identifiers_and_every_length(void)
{
    struct random_stream random = random_named(1, "conformance");
    bool good = true;

    case_open((struct wire_config){0});
    for (int i = 0; i < 2000 && good; i++) {
        struct bus_frame frame = bench_frame(0, (uint8_t)(i % 9));

        frame.flags = FRAME_EXTENDED;
        frame.id = i < 29 ? 1u << i : (uint32_t)random_bits(&random) & 0x1fffffff;
        good = frame_arrives(&frame);
    }
    return good;
}

static bool remote_frames_of_both_formats(void)
{
    struct bus_frame standard = {.id = 0x2aa, .flags = FRAME_REMOTE};
    struct bus_frame extended = {.id = 0x12345678, .flags = FRAME_REMOTE | FRAME_EXTENDED};

    case_open((struct wire_config){0});
    return frame_arrives(&standard) && frame_arrives(&extended);
}

static bool fd_frames_of_every_length_with_and_without_switch(void)
{
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    bool good = true;

    case_open((struct wire_config){.fd = true, .data_bitrate = 4000000});
    for (size_t i = 0; i < 4 * sizeof lengths && good; i++) {
        struct bus_frame frame = {.id = 0x155, .len = lengths[i / 4], .flags = FRAME_FD};

        frame.flags |= (uint8_t)(i & 1 ? FRAME_BRS : 0) | (uint8_t)(i & 2 ? FRAME_EXTENDED : 0);
        memset(frame.data, i % 3 ? 0x0f : 0xff, frame.len);
        good = frame_arrives(&frame);
    }
    return good;
}

static bool fd_frames_are_refused_on_a_classic_bus(void)
{
    struct bus_frame frame = {.id = 0x155, .len = 12, .flags = FRAME_FD};

    case_open((struct wire_config){0});
    return !wire_transmit(bench.wire, 0, &frame) &&
           bench_node(&bench, 0).dropped[WIRE_DROP_INVALID] == 1 && case_advance(1) == 0;
}

static bool a_frame_right_behind_the_intermission(void)
{
    struct bus_frame frame = bench_frame(0x123, 8);

    case_open((struct wire_config){0});
    case_send(0, 0x123);
    case_send(1, 0x124);
    return case_advance(1) == 2 &&
           bench_event(&bench, WIRE_TRANSMIT, 1)->event.time_ns -
                   bench_event(&bench, WIRE_TRANSMIT, 0)->event.time_ns ==
               3 * US +
                   bench_duration(
                       &(struct bus_frame){.id = 0x124, .len = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}},
                       1000000, 0) &&
           frame_same(&bench_event(&bench, WIRE_TRANSMIT, 0)->frame, &frame);
}

/* Whatever bit a receiver alone reads wrong (a stuff, CRC or form error to it): it says so, the
 * frame is destroyed for all and comes once, whole, when it is sent again. */
static bool a_receivers_error_destroys_the_frame_for_all(void)
{
    bool good = true;

    for (uint64_t seed = 0; seed < 300 && good; seed++) {
        const struct wire_log *log;

        case_open((struct wire_config){.seed = seed});
        case_inject(WIRE_FAULT_CORRUPT_AT, WIRE_ANY, 2, 1);
        case_send(0, 0x123);
        good = case_advance(1) == 1 && bench_events(&bench, WIRE_BUS_ERROR) == 1;
        log = bench_event(&bench, WIRE_TRANSMIT, 0);
        good = good && log->event.receivers == 6 && bench_node(&bench, 2).rec == 8 &&
               bench_node(&bench, 1).rec == 0 && bench_node(&bench, 0).tec == 7;
        bench_close(&bench);
    }
    case_open((struct wire_config){0});
    return good;
}

static bool a_passive_receivers_error_disturbs_nobody(void)
{
    case_open((struct wire_config){0});
    case_inject(WIRE_FAULT_CORRUPT_AT, WIRE_ANY, 2, 0);
    for (int i = 0; i < 4; i++) {
        case_send(0, 0x123);
    }
    case_advance(20);
    return bench_node(&bench, 2).state == WIRE_ERROR_PASSIVE &&
           bench_event(&bench, WIRE_TRANSMIT, 3)->event.receivers == 2 &&
           bench_node(&bench, 0).confirmed == 4;
}

static const struct conformance_case received[] = {
    {"standard identifiers, data lengths", every_standard_identifier_and_length, NULL},
    {"extended identifiers, data lengths", extended_identifiers_and_every_length, NULL},
    {"remote frames", remote_frames_of_both_formats, NULL},
    {"FD: every length, with and without bit rate switch",
     fd_frames_of_every_length_with_and_without_switch, NULL},
    {"FD frame at a classic controller", fd_frames_are_refused_on_a_classic_bus, NULL},
    {"frame right behind the intermission", a_frame_right_behind_the_intermission, NULL},
    {"stuff, CRC and form errors, error active", a_receivers_error_destroys_the_frame_for_all,
     NULL},
    {"stuff, CRC and form errors, error passive", a_passive_receivers_error_disturbs_nobody, NULL},
    {"classic DLC 9 to 15", NULL, "a frame has a length, not a DLC"},
    {"reserved bits, SRR and RRS of either value", NULL, "senders have none but nominal ones"},
    {"SOF at the third bit of the intermission", NULL, "nodes have one clock"},
    {"glitches, idle detection, resynchronisation", NULL, "there are no samples below a bit"},
    {"overload frames", NULL, "no controller of today sends them; not modelled"},
};

/* ---- frames sent ---- */

/* Each bit of the identifier decides, and the loser becomes a receiver and sends next. */
static bool arbitration_at_every_bit(void)
{
    bool good = true;

    for (int bit = 0; bit < 29 && good; bit++) {
        struct bus_frame low = bench_frame(0x15555555 & ~(1u << bit), 8);
        struct bus_frame high = low;

        low.flags = high.flags = FRAME_EXTENDED;
        high.id |= 1u << bit;
        case_open((struct wire_config){0});
        wire_transmit(bench.wire, 0, &high);
        wire_transmit(bench.wire, 1, &low);
        good = case_advance(1) == 2 && bench_event(&bench, WIRE_TRANSMIT, 0)->frame.id == low.id &&
               bench_event(&bench, WIRE_TRANSMIT, 0)->event.receivers == 5 &&
               bench_event(&bench, WIRE_TRANSMIT, 1)->frame.id == high.id &&
               bench_node(&bench, 0).arbitration_lost == 1 && bench_node(&bench, 0).tec == 0;
        bench_close(&bench);
    }
    case_open((struct wire_config){0});
    return good;
}

static bool sends_before(struct bus_frame first, struct bus_frame second)
{
    bool good;

    case_open((struct wire_config){0});
    wire_transmit(bench.wire, 0, &second);
    wire_transmit(bench.wire, 1, &first);
    good = case_advance(1) == 2 && bench_event(&bench, WIRE_TRANSMIT, 0)->event.node == 1;
    bench_close(&bench);
    return good;
}

static bool formats_at_arbitration(void)
{
    struct bus_frame data = bench_frame(0x123, 8), remote = {.id = 0x123, .flags = FRAME_REMOTE};
    struct bus_frame extended = bench_frame(0x123u << 18, 8), both = extended;
    bool good;

    extended.flags = FRAME_EXTENDED;
    both.flags = FRAME_EXTENDED | FRAME_REMOTE;
    both.len = 0;
    good = sends_before(data, remote) && sends_before(data, extended) &&
           sends_before(remote, extended) && sends_before(extended, both);
    case_open((struct wire_config){0});
    return good;
}

static bool no_acknowledgement(void)
{
    case_open((struct wire_config){.nodes = 1});
    case_send(0, 0x123);
    return case_advance(100) == 0 && bench_node(&bench, 0).tec == 128 &&
           bench_node(&bench, 0).state == WIRE_ERROR_PASSIVE &&
           bench_event(&bench, WIRE_BUS_ERROR, 0)->event.error == WIRE_ACK_ERROR;
}

static bool bit_error_while_sending(void)
{
    case_open((struct wire_config){0});
    case_inject(WIRE_FAULT_CORRUPT, 0, WIRE_ANY, 1);
    case_send(0, 0x123);
    return case_advance(1) == 1 && bench_node(&bench, 0).tec == 7 &&
           bench_event(&bench, WIRE_BUS_ERROR, 0)->event.error == WIRE_BIT_ERROR &&
           bench_event(&bench, WIRE_BUS_ERROR, 0)->event.tec == 8;
}

static bool last_bit_of_eof_missed_by_the_sender(void)
{
    case_open((struct wire_config){0});
    case_inject(WIRE_FAULT_DUPLICATE, 0, WIRE_ANY, 1);
    case_send(0, 0x123);
    return case_advance(1) == 2 && bench_node(&bench, 0).confirmed == 1 &&
           bench_node(&bench, 0).tec == 7;
}

/* Eight bits more than three between two frames of a passive node, and others may go first. */
static bool suspend_transmission(void)
{
    struct bus_frame frame = bench_frame(0x100, 8);
    int64_t length = bench_duration(&frame, 1000000, 0);

    case_open((struct wire_config){0});
    case_raise_tec(20);
    bench.count = 0;
    case_send(0, 0x100);
    case_send(0, 0x100);
    return bench_node(&bench, 0).state == WIRE_ERROR_PASSIVE && case_advance(1) == 2 &&
           bench_event(&bench, WIRE_TRANSMIT, 1)->event.time_ns -
                   bench_event(&bench, WIRE_TRANSMIT, 0)->event.time_ns ==
               length + 11 * US;
}

static bool esi_tells_a_passive_sender(void)
{
    struct bus_frame frame = {.id = 0x100, .len = 12, .flags = FRAME_FD | FRAME_ESI};
    bool active, passive;

    case_open((struct wire_config){.fd = true});
    wire_transmit(bench.wire, 0, &frame);
    case_advance(1);
    active = !(bench_event(&bench, WIRE_TRANSMIT, 0)->frame.flags & FRAME_ESI);
    case_raise_tec(20);
    bench.count = 0;
    frame.flags = FRAME_FD;
    wire_transmit(bench.wire, 0, &frame);
    case_advance(1);
    passive = bench_event(&bench, WIRE_TRANSMIT, 0)->frame.flags & FRAME_ESI;
    return active && passive;
}

static const struct conformance_case sent[] = {
    {"arbitration at every bit of the identifier", arbitration_at_every_bit, NULL},
    {"arbitration between formats", formats_at_arbitration, NULL},
    {"no acknowledgement", no_acknowledgement, NULL},
    {"bit error", bit_error_while_sending, NULL},
    {"error at the last bit of EOF: sent again", last_bit_of_eof_missed_by_the_sender, NULL},
    {"suspend transmission of a passive node", suspend_transmission, NULL},
    {"FD: ESI of an active and a passive node", esi_tells_a_passive_sender, NULL},
    {"stuff error during the arbitration", NULL, "faults hit behind the arbitration field"},
    {"transmitter delay compensation", NULL, "there are no samples below a bit"},
};

/* ---- error flags, counters, states ---- */

static bool flags_of_six_to_twelve_bits(void)
{
    bool good = true;

    for (uint64_t seed = 0; seed < 200 && good; seed++) {
        int64_t from_flag;

        case_open((struct wire_config){.seed = seed});
        case_inject(WIRE_FAULT_CORRUPT, 0, WIRE_ANY, 1);
        case_send(0, 0x123);
        good = case_advance(1) == 1;
        /* Flags and delimiter end here; the frame is sent again three bits later */
        from_flag = bench_event(&bench, WIRE_BUS_ERROR, 0)->event.time_ns;
        good = good && from_flag % US == 0 && from_flag >= (14 + 6 + 8) * US;
        bench_close(&bench);
    }
    case_open((struct wire_config){0});
    return good;
}

static bool tec_rises_by_eight_and_falls_by_one(void)
{
    case_open((struct wire_config){0});
    case_raise_tec(3);
    if (bench_node(&bench, 0).tec_peak != 24 || bench_node(&bench, 0).tec != 23) {
        return false;
    }
    for (int i = 0; i < 30; i++) {
        case_send(0, 0x100);
    }
    case_advance(20);
    return bench_node(&bench, 0).tec == 0; /* and no further */
}

static bool rec_rises_by_one_and_by_nine_for_the_first(void)
{
    case_open((struct wire_config){0});
    case_inject(WIRE_FAULT_CORRUPT_AT, 0, 2, 1);
    case_send(0, 0x123);
    case_advance(1);
    return bench_node(&bench, 1).rec_peak == 1 && bench_node(&bench, 2).rec_peak == 9;
}

/* A good frame puts a REC above 127 to 119 to 127. */
static bool rec_of_a_passive_receiver_falls_at_once(void)
{
    case_open((struct wire_config){0});
    case_inject(WIRE_FAULT_CORRUPT_AT, 0, 2, 18);
    for (int i = 0; i < 4; i++) {
        case_send(0, 0x123);
    }
    case_advance(20);
    if (bench_node(&bench, 2).rec_peak < 128) {
        return false;
    }
    case_send(0, 0x123);
    case_send(0, 0x123);
    case_advance(1);
    return bench_node(&bench, 2).rec <= 127 && bench_node(&bench, 2).rec >= 117 &&
           bench_node(&bench, 2).state == WIRE_ERROR_WARNING;
}

static bool states_at_96_128_and_256(void)
{
    static const enum wire_state states[] = {WIRE_ERROR_WARNING, WIRE_ERROR_PASSIVE, WIRE_BUS_OFF};
    static const unsigned limits[] = {96, 128, 256};
    bool good = true;

    case_open((struct wire_config){.restart_delay_ns = -1});
    case_inject(WIRE_FAULT_CORRUPT, 0, WIRE_ANY, 0);
    case_send(0, 0x100);
    case_advance(40);
    for (size_t i = 0; i < 3; i++) {
        const struct wire_log *log = bench_event(&bench, WIRE_STATUS, i);

        good = good && log && log->event.state == states[i] && log->event.tec == limits[i];
    }
    return good && bench_events(&bench, WIRE_BUS_ERROR) == 32;
}

static bool bus_off_ends_after_128_times_eleven_bits(void)
{
    case_open((struct wire_config){0});
    wire_force_bus_off(bench.wire, 0);
    wire_advance(bench.wire, INT64_C(128) * 11 * US - 1);
    if (bench_node(&bench, 0).state != WIRE_BUS_OFF) {
        return false;
    }
    wire_advance(bench.wire, INT64_C(128) * 11 * US);
    return bench_node(&bench, 0).state == WIRE_ERROR_ACTIVE && bench_node(&bench, 0).tec == 0 &&
           bench_node(&bench, 0).rec == 0;
}

static bool bus_off_neither_sends_nor_acknowledges(void)
{
    case_open((struct wire_config){.nodes = 2, .restart_delay_ns = -1});
    wire_force_bus_off(bench.wire, 1);
    case_send(0, 0x100);
    return case_advance(10) == 0 && bench_node(&bench, 0).state == WIRE_ERROR_PASSIVE &&
           !wire_transmit(bench.wire, 1, &(struct bus_frame){.id = 1});
}

static const struct conformance_case errors[] = {
    {"error flags and delimiter", flags_of_six_to_twelve_bits, NULL},
    {"TEC + 8, - 1, not below 0", tec_rises_by_eight_and_falls_by_one, NULL},
    {"REC + 1, + 8 more for the first to err", rec_rises_by_one_and_by_nine_for_the_first, NULL},
    {"REC above 127 falls with a good frame", rec_of_a_passive_receiver_falls_at_once, NULL},
    {"warning at 96, passive at 128, bus-off at 256", states_at_96_128_and_256, NULL},
    {"bus-off ends after 128 x 11 recessive bits", bus_off_ends_after_128_times_eleven_bits, NULL},
    {"bus-off neither sends nor acknowledges", bus_off_neither_sends_nor_acknowledges, NULL},
    {"dominant bits behind an error flag, + 8 each eight", NULL, "a stuck line is not modelled"},
    {"error in an error or overload flag", NULL, "faults hit frames only"},
};

/* ---- the table ---- */

static void conformance_run(const char *part, const struct conformance_case *cases, size_t count)
{
    size_t failed = 0;

    for (size_t i = 0; i < count; i++) {
        const char *verdict = "not applicable: ", *why = cases[i].not_applicable;

        if (cases[i].run) {
            bool good = cases[i].run();

            bench_close(&bench);
            memset(&bench, 0, sizeof bench);
            failed += !good;
            verdict = good ? "passed" : "FAILED";
            why = "";
        }
        print_message("# %-10s %-52s %s%s\n", part, cases[i].name, verdict, why);
    }
    assert_int_equal(failed, 0);
}

TEST(frames_received)
{
    conformance_run("receive", received, sizeof received / sizeof *received);
}

TEST(frames_sent)
{
    conformance_run("send", sent, sizeof sent / sizeof *sent);
}

TEST(errors_counters_and_states)
{
    conformance_run("errors", errors, sizeof errors / sizeof *errors);
}
