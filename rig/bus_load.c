/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the worst-case load of a bus from the frames of its boards and its controller, each with
 * the maximum number of stuff bits. Suggests remedies if the periodic traffic exceeds the bit
 * rate. */
#include "base/array.h"
#include "boards/messages.h"
#include "canbus/wire/bits.h"
#include "rig/rig.h"

#include <stdio.h>
#include <string.h>

struct load_sum {
    const struct rig_bus *bus;
    double telemetry_bit_s, command_bit_s;
};

/* Adds the worst-case duration of a frame to its bus, in bit times of the nominal rate. Includes
 * the intermission. */
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

/* Returns the worst-case load of a bus in percent, for a given command period. */
static double bus_demand(const struct rig *rig, size_t bus, int64_t command_ns)
{
    double telemetry, commands;

    rig_bus_load(rig, bus, command_ns, &telemetry, &commands);
    return 100.0 * (telemetry + commands) / (double)rig->bus[bus].bitrate;
}

size_t rig_bus_capacity(const struct rig *rig, size_t bus, int64_t command_period_ns)
{
    struct rig changed = *rig;
    size_t axes = 0;

    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        if (board->bus == (int)bus && board->kind != BOARD_MOTOR) {
            return 0;
        }
        axes += board->bus == (int)bus ? load_axes(board) : 0;
    }
    changed.boards.tick_ns = command_period_ns;
    return axes ? (size_t)(100.0 * (double)axes / bus_demand(&changed, bus, command_period_ns)) : 0;
}

/* Returns the worst-case load in percent at another bit rate. For CAN FD, keeps the ratio of the
 * two rates. */
static double bus_demand_at(const struct rig *rig, size_t bus, int64_t bitrate)
{
    const struct rig_bus *of = &rig->bus[bus];
    struct rig changed = *rig;
    struct rig_bus buses[RIG_BUSES_MAX];

    memcpy(buses, rig->bus, rig->nbus * sizeof *buses);
    buses[bus].bitrate = bitrate;
    buses[bus].data_bitrate = of->data_bitrate * bitrate / of->bitrate;
    changed.bus = buses;
    return bus_demand(&changed, bus, rig->servo.command_period_ns);
}

/* Writes remedies: more buses, a longer command period, a higher bit rate. */
static void bus_advise(const struct rig *rig, size_t bus, double percent, char *text, size_t size)
{
    static const int64_t rates[] = {125000, 250000, 500000, 800000, 1000000};
    const int64_t period = rig->servo.command_period_ns;
    size_t used;
    int times = 2;

    snprintf(text, size, "split it over %d buses", (int)(percent / 100.0) + 1);
    /* Find the smallest multiple of the command period that fits */
    while (times <= 10 && bus_demand(rig, bus, period * times) > 100.0) {
        times++;
    }
    used = strlen(text);
    if (times <= 10) {
        snprintf(text + used, size - used, ", or command every %g ms (%.1f %%)",
                 (double)(period * times) * 1e-6, bus_demand(rig, bus, period * times));
    }
    /* Find the lowest standard bit rate that fits */
    for (size_t i = 0; i < ARRAY_COUNT(rates); i++) {
        double at = rates[i] > rig->bus[bus].bitrate ? bus_demand_at(rig, bus, rates[i]) : 1e9;

        used = strlen(text);
        if (at <= 100.0) {
            snprintf(text + used, size - used, ", or run it at %g kbit/s (%.1f %%)",
                     (double)rates[i] * 1e-3, at);
            return;
        }
    }
}

bool rig_bus_over_budget(const struct rig *rig, size_t bus, char *text, size_t size)
{
    const double percent = bus_demand(rig, bus, rig->servo.command_period_ns);
    char advice[256];

    if (percent <= 100.0) {
        return false;
    }
    bus_advise(rig, bus, percent, advice, sizeof advice);
    snprintf(text, size, "bus %s would be loaded to %.1f %% at the worst: %s", rig->bus[bus].name,
             percent, advice);
    return true;
}
