/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A wire in virtual time that carries whatever the input says: the length of every frame is that of
 * a naive encoder written from the standard's text, and on a bus with faults nothing is lost
 * without being counted, time does not go back, and frames arrive no sooner than their bits take.
 */
#include "canbus/wire/wire.h"

#include "canbus/wire/bits.h"
#include "tests/fuzz/fuzz.h"
#include "tests/unit/canbus/wire/wire_reference.h"
#include "tests/unit/canbus/wire/wire_force.h"

#include <inttypes.h>

enum { NODES = 4, QUEUE = 8, MEMORY = 4 << 20 };

static struct wire_tables tables;

static void check_bits(const struct bus_frame *frame)
{
    struct wire_length length, worst;
    struct reference reference;
    struct wire_bits bits;
    unsigned nominal, data;

    if (!frame_valid(frame) || frame->flags & FRAME_ERROR) {
        fuzz_tally.refused++;
        return;
    }
    fuzz_tally.taken++;
    length = wire_frame_length(&tables, frame);
    reference_length(frame, &nominal, &data);
    fuzz_require(length.nominal == nominal && length.data == data, "%u + %u bits, not %u + %u",
                 length.nominal, length.data, nominal, data);
    worst = wire_worst_length(frame->flags, frame->len);
    fuzz_require(nominal + data <= (unsigned)worst.nominal + worst.data, "longer than the longest");
    fuzz_require(frame_bits(frame) <= nominal + data + WIRE_INTERMISSION_BITS,
                 "shorter than plain");

    wire_frame_encode(frame, &bits);
    reference_encode(frame, &reference);
    fuzz_require(bits.count == reference.count, "%zu bits, not %zu", bits.count, reference.count);
    for (size_t i = 0; i < bits.count; i++) {
        fuzz_require(bits.bit[i] == reference_value(reference.bit[i]), "bit %zu", i);
    }
    fuzz_require(bits.control < bits.crc_end && bits.crc_end < bits.ack && bits.ack < bits.count &&
                     bits.fast <= bits.slow && bits.slow <= bits.count,
                 "parts out of order");
}

struct traffic {
    int64_t time_ns;
    uint64_t confirmed;
};

static void on_event(void *context, const struct wire_event *event)
{
    struct traffic *traffic = context;

    fuzz_require(event->time_ns >= traffic->time_ns, "time goes back");
    fuzz_require(event->node <= NODES && event->kind <= WIRE_STATUS, "an event of nobody");
    fuzz_require(!event->frame || frame_valid(event->frame), "an illegal frame was carried");
    traffic->time_ns = event->time_ns;
    traffic->confirmed += event->kind == WIRE_CONFIRM && event->node < NODES;
}

static struct wire_fault fault_of(struct fuzz_bytes *bytes, int64_t now_ns)
{
    struct wire_fault fault = {
        .kind = (enum wire_fault_kind)(fuzz_u8(bytes) % (WIRE_FAULT_COLLISION + 1)),
        .node = (int8_t)fuzz_u8(bytes),
        .receiver = (int8_t)fuzz_u8(bytes),
        .id = fuzz_u16(bytes),
        .id_mask = fuzz_u16(bytes),
        .probability = fuzz_u8(bytes) / 200.0,
        .count = fuzz_u8(bytes),
        .delay_ns = (int64_t)fuzz_u16(bytes) * 100,
    };

    fault.from_ns = now_ns + (int64_t)fuzz_u8(bytes) * 1000;
    fault.until_ns = fuzz_u8(bytes) & 1 ? fault.from_ns + (int64_t)fuzz_u16(bytes) * 1000 : 0;
    return fault;
}

static void check_totals(const struct wire *wire, const struct traffic *traffic, uint64_t offered)
{
    uint64_t confirmed = 0, queued = 0, dropped = 0;
    struct wire_node_stats node;
    struct wire_stats stats;

    wire_stats(wire, &stats);
    for (size_t i = 0; i < NODES; i++) {
        wire_node_stats(wire, i, &node);
        fuzz_require(node.queued <= QUEUE && node.queued_peak <= QUEUE, "%zu queued", node.queued);
        fuzz_require((node.state == WIRE_BUS_OFF) || (node.tec < 256), "TEC %u", node.tec);
        confirmed += node.confirmed;
        queued += node.queued;
        /* LATE_FULL counts frames that were confirmed to their sender */
        dropped += node.dropped[WIRE_DROP_QUEUE_FULL] + node.dropped[WIRE_DROP_BUS_OFF] +
                   node.dropped[WIRE_DROP_INVALID];
    }
    fuzz_require(confirmed == traffic->confirmed, "%" PRIu64 " confirmed, told of %" PRIu64,
                 confirmed, traffic->confirmed);
    /* The foreign node of collisions has at most one */
    fuzz_require(stats.queued - queued <= 1, "%zu queued, not %" PRIu64, stats.queued, queued);
    fuzz_require(offered == confirmed + queued + dropped,
                 "%" PRIu64 " offered, %" PRIu64 " confirmed, %" PRIu64 " queued, %" PRIu64
                 " dropped",
                 offered, confirmed, queued, dropped);
    fuzz_require(stats.busy_ns >= 0 && stats.load_mean >= 0.0 && stats.load_mean <= 1.001 &&
                     stats.load_peak <= 1.001,
                 "load %g, peak %g", stats.load_mean, stats.load_peak);
}

static void run_bus(struct fuzz_bytes *bytes)
{
    struct traffic traffic = {0};
    struct wire_config config = {
        .bitrate = 1000000,
        .data_bitrate = 4000000,
        .fd = fuzz_u8(bytes) & 1,
        .nodes = NODES,
        .queue = QUEUE,
        .order = fuzz_u8(bytes) & 1 ? WIRE_FIFO : WIRE_PRIORITY,
        .restart_delay_ns = fuzz_u8(bytes) & 1 ? -1 : 1000000,
        .seed = 1,
        .notify = on_event,
        .context = &traffic,
    };
    struct error error;
    struct wire *wire;
    uint64_t offered = 0;
    int64_t now_ns = 0;

    fuzz_require(wire_create(&config, fuzz_arena(MEMORY), &wire, &error) == ERROR_NONE, "%s",
                 error.text);
    while (bytes->left > 0) {
        const uint8_t what = fuzz_u8(bytes);
        const size_t node = what >> 4 & 3;
        struct bus_frame frame;
        struct wire_fault fault;

        switch (what & 0xf) {
        case 0:
            fault = fault_of(bytes, now_ns);
            wire_inject(wire, &fault);
            break;
        case 1:
            wire_heal(wire, fuzz_u8(bytes) % WIRE_FAULTS_MAX);
            break;
        case 2:
            wire_connect(wire, node, what >> 6 & 1);
            break;
        case 4:
            wire_force_bus_off(wire, node);
            break;
        case 6:
        case 7:
        case 8:
            now_ns += (int64_t)fuzz_u16(bytes) * 50;
            wire_advance(wire, now_ns);
            fuzz_require(wire_now(wire) == now_ns, "%" PRId64, wire_now(wire));
            break;
        default:
            fuzz_frame(bytes, &frame);
            check_bits(&frame);
            wire_transmit(wire, node, &frame);
            offered++;
        }
    }
    wire_advance(wire, now_ns + 10000000);
    check_totals(wire, &traffic, offered);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes bytes = {data, size};

    wire_tables_make(&tables);
    run_bus(&bytes);
    return 0;
}
