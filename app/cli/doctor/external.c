/* SPDX-License-Identifier: Apache-2.0 */
/* Listens for the external boards of a rig on their buses. */
#include "app/cli/doctor/private.h"

#include "sim/external.h"

#include <inttypes.h>

/* Frames that are read from a bus at a time, and the time between two readings. */
enum { RECEIVE_BATCH = 64 };

static const int64_t LISTEN_STEP_NS = CLOCK_MS;

/* Reads what has come on a bus; frames beyond one batch wait for the next reading. */
static void doctor_read_bus(struct external *external, struct can_port *port, size_t bus,
                            int64_t now_ns)
{
    struct bus_frame frames[RECEIVE_BATCH];
    size_t count = can_receive(port, frames, RECEIVE_BATCH);

    for (size_t i = 0; i < count; i++) {
        external_receive(external, now_ns, bus, &frames[i]);
    }
}

/* Judges a board by when it was last heard: never, longer ago than its time-out, or in time. */
static void doctor_judge_board(struct doctor *d, const struct external *external, size_t index,
                               int64_t now_ns)
{
    static const char fix[] = "switch it on, check cable and address; one that sends when it is "
                              "told to needs its controller";
    const struct board_config *board = &d->config->rig->boards.board[index];
    const struct rig_bus *bus = &d->config->rig->bus[board->bus];
    int64_t heard_ns = external_heard_ns(external, index);
    double age_ms = 1e-6 * (double)(now_ns - heard_ns);

    if (heard_ns < 0) {
        doctor_add_finding(d, DOCTOR_WARN, "external", fix,
                           "board %s on %s is silent: not heard in %.3g s", board->name,
                           bus->interface, 1e-9 * (double)d->config->listen_ns);
    } else if (now_ns - heard_ns > board->external_timeout_ns) {
        doctor_add_finding(d, DOCTOR_WARN, "external", fix,
                           "board %s on %s is silent: last heard %.0f ms ago, its time-out is "
                           "%.0f ms",
                           board->name, bus->interface, age_ms,
                           1e-6 * (double)board->external_timeout_ns);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "external", "", "board %s on %s is heard, %.0f ms ago",
                           board->name, bus->interface, age_ms);
    }
}

void doctor_examine_external(struct doctor *d)
{
    const struct doctor_config *config = d->config;
    struct external *external = NULL;
    struct error error;
    int64_t start, now;

    if (!config->port || config->listen_ns <= 0) {
        return;
    }
    if (external_create(config->rig, NULL, NULL, config->arena, &external, &error)) {
        doctor_add_finding(d, DOCTOR_WARN, "external", "", "cannot listen: %s", error.text);
        return;
    }
    if (!external) {
        return;
    }

    /* Time counts from 0, as in the loop */
    start = now = clock_now(config->clock);
    while (now - start < config->listen_ns) {
        clock_sleep_until(config->clock, now + LISTEN_STEP_NS);
        now = clock_now(config->clock);
        for (size_t b = 0; b < config->rig->nbus; b++) {
            if (config->port[b]) {
                doctor_read_bus(external, config->port[b], b, now - start);
            }
        }
    }
    for (size_t i = 0; i < config->rig->boards.nboard; i++) {
        const struct board_config *board = &config->rig->boards.board[i];

        if (board->external && config->port[board->bus]) {
            doctor_judge_board(d, external, i, now - start);
        }
    }
}
