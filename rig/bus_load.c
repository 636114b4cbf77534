/* SPDX-License-Identifier: Apache-2.0 */
/* Worst-case bus load of a rig's boards and controller: every frame as long as bit stuffing can
 * make it. */
#include "boards/messages.h"
#include "canbus/wire/bits.h"
#include "rig/rig.h"

struct load_sum {
    const struct rig_bus *bus;
    double telemetry_bit_s, command_bit_s;
};

/* Adds the bit times of the nominal rate that a frame takes of its bus at the worst, the
 * intermission included. */
static void load_add_frame(void *context, const struct load_frame *frame)
{
    struct load_sum *sum = context;
    struct wire_length length = wire_worst_length(frame->flags, frame->length);
    double bits;

    length.nominal = (uint16_t)(length.nominal + WIRE_INTERMISSION_BITS);
    bits = (double)wire_length_ns(length, sum->bus->bitrate, sum->bus->data_bitrate) * 1e-9 *
           (double)sum->bus->bitrate;
    *(frame->from_host ? &sum->command_bit_s : &sum->telemetry_bit_s) += bits / frame->period_s;
}

double rig_bus_bits(const struct rig_bus *bus, const struct can_counters *counters)
{
    double fast = (double)counters->fast_bits;
    double ratio = bus->data_bitrate ? (double)bus->bitrate / (double)bus->data_bitrate : 1.0;

    return (double)(counters->rx_bits + counters->tx_bits) - fast + fast * ratio;
}

void rig_bus_load(const struct rig *rig, size_t bus, int64_t command_period_ns,
                  double *telemetry_bit_s, double *command_bit_s)
{
    struct load_sum sum = {.bus = &rig->bus[bus]};

    boards_load(&rig->boards, (int)bus, (double)command_period_ns * 1e-9, load_add_frame, &sum);
    *telemetry_bit_s = sum.telemetry_bit_s;
    *command_bit_s = sum.command_bit_s;
}
