/* SPDX-License-Identifier: Apache-2.0 */
/* What the loop drives: boards, plant and sensors, tick by tick. */
#include "canbus/wire/wire.h"
#include "sim/private.h"

#include <stdio.h>
#include <string.h>

/* A settled robot's rotors are held by brakes, which let go so long after the last motor is on: time
 * for a controller's first voltages to raise the currents. */
#define BRAKE_NS INT64_C(20000000)

/* Windows of faults open and close. Before the wait, for in lockstep frames are received while the
 * loop waits, through ports that faults disturb. */
static void machine_begin(void *context, int64_t now_ns)
{
    const struct simulator *simulator = context;

    injection_step(simulator->injection, now_ns);
}

/* The observer sees the tick before, then an inline task takes its step. */
static bool machine_controller(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;
    const struct simulator_observer *observer = simulator->config.observer;
    bool goes_on = observer && simulator->config.clock == LOOP_CLOCK_FREE;

    if (observer) {
        observer->step(observer->context, now_ns);
    }
    if (simulator->task_inline && simulator->controller->now.status == TASK_RUNNING) {
        /* In lockstep the clock's time: the task needs it to notice that a STEP got lost */
        controller_step(simulator->controller, simulator->config.clock == LOOP_CLOCK_LOCKSTEP
                                                   ? clock_now(simulator->time)
                                                   : now_ns);
    }
    return goes_on || !simulator->task_inline || simulator->controller->now.status == TASK_RUNNING;
}

static void machine_receive(void *context, int64_t now_ns, size_t bus,
                            const struct bus_frame *frame)
{
    struct simulator *simulator = context;

    boards_receive(simulator->boards, now_ns, bus, frame);
}

static bool all_motors_on(const struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_command *command = plant_command(simulator->plant);

    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        for (int k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
            int joint = board->axis[k].joint;

            if (joint >= 0 && !command->motor[joint].bridge_on) {
                return false;
            }
        }
    }
    return true;
}

static void machine_control(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    boards_control(simulator->boards, now_ns, plant_command(simulator->plant));
    if (simulator->release.due && all_motors_on(simulator)) {
        simulator->release.due = false;
        simulator->release.at_ns = now_ns + (simulator->config.settle ? BRAKE_NS : 0);
    }
    if (simulator->release.at_ns >= 0 && now_ns >= simulator->release.at_ns) {
        plant_clamp(simulator->plant, false);
        simulator->release.at_ns = -1;
        atomic_store(&simulator->released, now_ns);
    }
}

static bool sane(struct simulator *simulator, enum error_code code)
{
    if (code) {
        snprintf(simulator->failure, sizeof simulator->failure, "%s",
                 plant_failure(simulator->plant));
    }
    return !code;
}

static bool machine_plant(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    (void)now_ns; /* the plant integrates its own */
    return sane(simulator, plant_step(simulator->plant, simulator->config.rig->substeps));
}

static bool machine_sample(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    if (!sane(simulator, plant_sample(simulator->plant))) {
        return false;
    }
    simulator->measured = sensing_sample(simulator->sensing, now_ns, plant_sensors(simulator->plant));
    boards_sample(simulator->boards, now_ns, simulator->measured);
    return true;
}

/* On a wire every board has a controller of its own, in the order of the rig, with error counters
 * that the board tells. */
static void tell_controllers(struct simulator *simulator, size_t bus)
{
    const struct boards_config *boards = &simulator->config.rig->boards;
    const struct wire *wire = simulator->buses.wire[bus];
    size_t node = 0;

    for (size_t i = 0; wire && i < boards->nboard; i++) {
        struct wire_node_stats stats;

        if (boards->board[i].bus == (int)bus) {
            wire_node_stats(wire, node++, &stats);
            boards_set_can_state(simulator->boards, i,
                                 &(struct board_can_state){.tec = stats.tec,
                                                           .rec = stats.rec,
                                                           .bus_off = stats.state == WIRE_BUS_OFF});
        }
    }
}

static void machine_advance(void *context, int64_t now_ns)
{
    const struct simulator *simulator = context;

    buses_advance(&simulator->buses, now_ns);
}

static size_t machine_transmit(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                               size_t max)
{
    struct simulator *simulator = context;

    tell_controllers(simulator, bus);
    return boards_transmit(simulator->boards, now_ns, bus, frames, max);
}

static bool machine_fault(void *context)
{
    const struct simulator *simulator = context;

    return boards_fault(simulator->boards);
}

static void machine_shut_down(void *context)
{
    struct simulator *simulator = context;

    boards_shut_down(simulator->boards, plant_time_ns(simulator->plant),
                     plant_command(simulator->plant));
}

static void fill_buses(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;

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

static void fill_plant(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);
    const struct contact_wrench *wrench = plant_contact_wrenches(simulator->plant);
    size_t count;

    if (rig->robot->floating) {
        memcpy(simulator->status.base, plant_state(simulator->plant, &count),
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

static void fill_counters(struct simulator *simulator, const struct loop_stats *stats)
{
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
}

static void fill_faults(struct simulator *simulator)
{
    uint64_t *word = simulator->status.fault;

    memset(word, 0, sizeof simulator->status.fault);
    for (size_t i = 0; i < faults_count(simulator->faults); i++) {
        word[i / 64] |= (uint64_t)faults_at(simulator->faults, i)->active << i % 64;
    }
}

void simulator_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    struct simulator *simulator = context;

    simulator->status.time_ns = now_ns;
    fill_counters(simulator, stats);
    fill_faults(simulator);
    fill_buses(simulator);
    fill_plant(simulator);
    snapshot_write(simulator->published, &simulator->status);
}

static void machine_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    struct simulator *simulator = context;

    simulator_publish(simulator, now_ns, stats);
    simulator_record_row(simulator);
    simulator_stream_row(simulator);
}

struct loop_machine simulator_machine(struct simulator *simulator)
{
    return (struct loop_machine){
        .context = simulator,
        .begin = machine_begin,
        .controller =
            simulator->task_inline || simulator->config.observer ? machine_controller : NULL,
        .receive = machine_receive,
        .control = machine_control,
        .plant = machine_plant,
        .sample = machine_sample,
        .advance = simulator->buses.timed ? machine_advance : NULL,
        .transmit = machine_transmit,
        .fault = machine_fault,
        .publish = machine_publish,
        .shut_down = machine_shut_down,
    };
}
