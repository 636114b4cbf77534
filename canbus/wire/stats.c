/* SPDX-License-Identifier: Apache-2.0 */
/* Statistics of the wire, with the load by time window. */
#include "canbus/wire/private.h"

const char *wire_error_name(enum wire_error error)
{
    static const char *const names[WIRE_ERRORS] = {
        [WIRE_BIT_ERROR] = "bit", [WIRE_STUFF_ERROR] = "stuff", [WIRE_FORM_ERROR] = "form",
        [WIRE_CRC_ERROR] = "crc", [WIRE_ACK_ERROR] = "ack",
    };

    return names[error];
}

const char *wire_drop_name(enum wire_drop drop)
{
    static const char *const names[WIRE_DROPS] = {
        [WIRE_DROP_QUEUE_FULL] = "queue full",
        [WIRE_DROP_BUS_OFF] = "bus-off",
        [WIRE_DROP_INVALID] = "invalid",
        [WIRE_DROP_LATE_FULL] = "too many late",
    };

    return names[drop];
}

/* ---- load ---- */

/* Closes the windows of the load that end up to time_ns; windows without traffic have a load of
 * 0. */
static void wire_close_windows(struct wire_load *load, int64_t window_ns, int64_t time_ns)
{
    int64_t skipped;

    if (time_ns < load->window_begin_ns + window_ns) {
        return;
    }
    load->last = (double)load->window_busy_ns / (double)window_ns;
    load->peak = load->last > load->peak ? load->last : load->peak;
    load->window_begin_ns += window_ns;
    load->window_busy_ns = 0;
    skipped = (time_ns - load->window_begin_ns) / window_ns;
    if (skipped > 0) {
        load->last = 0.0;
        load->window_begin_ns += skipped * window_ns;
    }
}

/* Adds a busy time to the load, window by window. from_ns must not be before the end of the last
 * busy time. */
void wire_load_add(struct wire_load *load, int64_t window_ns, int64_t from_ns, int64_t to_ns)
{
    wire_close_windows(load, window_ns, from_ns);
    while (to_ns > load->window_begin_ns + window_ns) {
        int64_t border = load->window_begin_ns + window_ns;

        load->window_busy_ns += border - from_ns;
        from_ns = border;
        wire_close_windows(load, window_ns, border);
    }
    load->window_busy_ns += to_ns - from_ns;
}

/* ---- reading ---- */

/* Copies the statistics, including the busy time of the present frame up to now. */
void wire_stats(const struct wire *wire, struct wire_stats *stats)
{
    struct wire_load load = wire->load;
    int64_t begin = wire->flight.busy ? wire->flight.start_ns : wire->idle_ns, excess = 0;

    *stats = wire->stats;
    stats->time_ns = wire->now_ns;
    if (wire->flight.busy) {
        excess = begin - wire->now_ns;
        wire_load_add(&load, wire->config.window_ns, begin, wire->now_ns);
    } else if (begin > wire->now_ns) {
        excess = begin - wire->now_ns; /* part of the intermission */
    } else {
        wire_close_windows(&load, wire->config.window_ns, wire->now_ns);
    }
    stats->busy_ns -= excess;
    stats->load_mean = wire->now_ns > 0 ? (double)stats->busy_ns / (double)wire->now_ns : 0.0;
    stats->load_now = load.last;
    stats->load_peak = load.peak;
}

uint64_t wire_dropped(const struct wire *wire)
{
    uint64_t total = 0;

    for (int drop = 0; drop < WIRE_DROPS; drop++) {
        total += wire->stats.dropped[drop];
    }
    return total;
}

bool wire_has_errors(const struct wire *wire)
{
    return (wire->counting | wire->off) != 0;
}

void wire_node_stats(const struct wire *wire, size_t node, struct wire_node_stats *stats)
{
    *stats = wire->node[node].stats;
}
