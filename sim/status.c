/* SPDX-License-Identifier: Apache-2.0 */
/* Publishes the status of a simulator once a tick, for other threads. */
#include "sim/simulator_private.h"

/* Copies counters and states of the buses, and the boards' counters. */
static void status_fill_buses(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;

    boards_counters(simulator->boards, &simulator->status.boards);
    boards_last_malformed(simulator->boards, &simulator->status.malformed);
    for (size_t b = 0; b < rig->nbus; b++) {
        const struct can_port *port = simulator->ports.port[b];
        const struct can_counters *counters = &port->counters;

        simulator->status.bus[b] = (struct bus_status){
            .rx_frames = counters->rx_frames,
            .tx_frames = counters->tx_frames,
            .rx_dropped = counters->rx_dropped,
            .tx_dropped = counters->tx_dropped,
            .bits = (uint64_t)rig_bus_bits(&rig->bus[b], counters),
            .state = port->state,
        };
    }
}

/* Copies poses, joint angles, contact forces and the state of the clamp. */
static void status_fill_plant(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);
    const struct contact_wrench *wrench = plant_contact_wrenches(simulator->plant);
    size_t count;

    if (rig->robot->floating) {
        memcpy(simulator->status.base, plant_values(simulator->plant, &count),
               sizeof simulator->status.base);
    }
    for (size_t j = 0; j < rig->robot->njoint; j++) {
        simulator->status.q[j] = sensors->motor[j].q;
    }
    simulator->status.clamped = plant_is_clamped(simulator->plant);
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        simulator->status.force_z[c] = wrench[c].force[2];
    }
    for (size_t i = 0; i < rig->nfree && i < SIMULATOR_FREE_MAX; i++) {
        plant_free_pose(simulator->plant, i, simulator->status.free[i]);
    }
}

/* Copies the time when each external board was last heard, and the silent boards. */
static void status_fill_external(struct simulator *simulator)
{
    const struct boards_config *boards = &simulator->config.rig->boards;
    size_t count = 0;

    simulator->status.external_silent = 0;
    for (size_t i = 0; i < boards->nboard && count < SIMULATOR_EXTERNAL_MAX; i++) {
        struct board_state state;

        if (boards->board[i].external) {
            boards_state(simulator->boards, i, &state);
            simulator->status.external_heard_ns[count] = state.heard_ns;
            simulator->status.external_silent |= (uint64_t)state.silent << count++;
        }
    }
}

/* Copies the active faults, one bit each. */
static void status_fill_faults(struct simulator *simulator)
{
    uint64_t *word = simulator->status.fault;

    memset(word, 0, sizeof simulator->status.fault);
    for (size_t i = 0; i < faults_count(simulator->faults); i++) {
        word[i / 64] |= (uint64_t)faults_at(simulator->faults, i)->active << i % 64;
    }
}

/* Excludes the end of an array with `used` elements from the published status. */
#define LEAVE_OUT_END(simulator, array, used)                                                      \
    snapshot_leave_out((simulator)->published,                                                     \
                       offsetof(struct simulator_status, array) +                                  \
                           (used) * sizeof *(simulator)->status.array,                             \
                       offsetof(struct simulator_status, array) + sizeof(simulator)->status.array)

void simulator_leave_out_unused(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;

    LEAVE_OUT_END(simulator, q, rig->robot->njoint);
    LEAVE_OUT_END(simulator, force_z, rig->contact.nbody);
    LEAVE_OUT_END(simulator, free,
                  rig->nfree < SIMULATOR_FREE_MAX ? rig->nfree : SIMULATOR_FREE_MAX);
    LEAVE_OUT_END(simulator, bus, rig->nbus);
    if (!simulator->external) {
        LEAVE_OUT_END(simulator, external_heard_ns, 0);
    }
}

void simulator_fill_start(struct simulator *simulator)
{
    status_fill_faults(simulator);
    status_fill_buses(simulator);
    status_fill_plant(simulator);
    if (simulator->external) {
        status_fill_external(simulator);
    }
}

void simulator_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    struct simulator *simulator = context;

    simulator->status.time_ns = now_ns;

    /* Copies the loop's counters */
    struct simulator_status *status = &simulator->status;

    status->tick = stats->ticks;
    status->start_ns = stats->start_ns;
    status->elapsed_ns = clock_now(simulator->time) - stats->start_ns;
    status->overruns = stats->overrun_total;
    memcpy(status->overruns_by, stats->overruns, sizeof status->overruns_by);
    status->late_ticks = stats->late_ticks;
    status->lost_ticks = stats->lost_ticks;
    status->pauses = stats->pauses;
    status->pause_ticks = stats->pause_ticks;
    status->events_lost = stats->events_lost;
    status->lockstep = stats->lockstep;
    status_fill_faults(simulator);
    status_fill_buses(simulator);
    status_fill_plant(simulator);
    if (simulator->external) {
        status_fill_external(simulator);
    }
    snapshot_write(simulator->published, &simulator->status);

    /* Publishes a view of the last tick if one is wanted */
    simulator->view_stale = true;
    simulator_renew_view(simulator);
}
