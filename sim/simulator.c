/* SPDX-License-Identifier: Apache-2.0 */
/* Creates a simulator as a whole or not at all, runs it in the caller's thread, and closes it. The
 * task runs in its own thread. assembly.c creates the parts. */
#include "sim/simulator_private.h"

#include <stdlib.h>

enum error_code simulator_create(const struct simulator_config *config, struct arena *arena,
                                 struct simulator **out, char notice[256], struct error *error)
{
    struct simulator *simulator = arena_alloc(arena, 1, sizeof *simulator);
    enum error_code code;

    *out = NULL;
    notice[0] = '\0';
    if (!simulator) {
        return error_set(error, ERROR_MEMORY, "no memory left for the simulator");
    }
    simulator->config = *config;
    simulator->arena = arena;
    simulator->time = clock_monotonic();
    pthread_mutex_init(&simulator->dropped.lock, NULL);
    code = simulator_assemble(simulator, notice, error);
    if (code) {
        simulator_destroy(simulator);
        return code;
    }
    *out = simulator;
    return ERROR_NONE;
}

/* ---- running ---- */

/* Shifts the task's steps to the middle between two ticks. If both grids coincided on one
 * processor, each step would delay the loop by the step's duration. */
static void simulator_offset_task_grid(struct simulator *simulator)
{
    int64_t tick_ns = simulator->config.rig->tick_ns;
    struct simulator_status status;

    while (!simulator_read(simulator, &status)) {
        if (atomic_load(&simulator->task->stop)) {
            return;
        }
        clock_sleep_until(simulator->time, clock_now(simulator->time) + tick_ns);
    }
    simulator->task->grid_ns = status.start_ns + tick_ns / 2;
}

/* Runs the task in its own thread; the loop stops when it ends. */
static void *simulator_task_main(void *context)
{
    struct simulator *simulator = context;
    struct realtime_report unused; /* the loop's thread reports the same values */

    realtime_apply(&simulator->task_realtime, &unused);
    simulator_offset_task_grid(simulator);
    task_runner_run(simulator->task);
    loop_stop(simulator->loop);
    return NULL;
}

enum error_code simulator_start(struct simulator *simulator, struct realtime_report *report,
                                struct error *error)
{
    const struct rig_realtime *wanted = &simulator->config.rig->realtime;
    const struct realtime_config config = {
        .priority = wanted->priority,
        .cpu = wanted->cpu,
        .lock_memory = wanted->lock_memory,
    };

    memset(report, 0, sizeof *report);
    /* Maps memory now, so that no page fault occurs in the loop */
    if (simulator->config.untouched) {
        arena_close(simulator->arena);
    } else {
        arena_seal(simulator->arena);
        realtime_touch();
    }
    if (simulator->config.clock != LOOP_CLOCK_REAL) {
        return ERROR_NONE;
    }
    /* The task's thread starts before the calling thread gets its real-time settings */
    if (simulator->task) {
        const int priority = simulator->config.rig->realtime.priority;
        int reason;

        /* Start the task's thread. Its priority is above the loop's, as if it ran on another
         * computer at the end of the cable. */
        simulator->task_realtime = (struct realtime_config){
            .priority = priority + (priority > 0 && priority < 99),
            .cpu = -1,
        };
        reason = pthread_create(&simulator->task_thread, NULL, simulator_task_main, simulator);
        if (reason) {
            return error_set_errno(error, reason, "cannot start the task's thread");
        }
        simulator->task_running = true;
    }
    realtime_apply(&config, report);
    return ERROR_NONE;
}

/* Ends the task's thread; returns whether the task had ended by itself. */
static bool simulator_join_task(struct simulator *simulator)
{
    atomic_store(&simulator->task->stop, true);
    if (simulator->pace) {
        /* a pause stops the clock on which the task may sleep */
        pace_set(simulator->pace, 1.0);
    }
    pthread_join(simulator->task_thread, NULL);
    simulator->task_running = false;
    return simulator->task->now.status != TASK_RUNNING;
}

enum loop_end simulator_run(struct simulator *simulator)
{
    enum loop_end end = loop_run(simulator->loop);

    if (simulator->task_running && simulator_join_task(simulator) && end == LOOP_END_STOPPED) {
        end = LOOP_END_CONTROLLER;
    }
    return end;
}

void simulator_stop(struct simulator *simulator)
{
    loop_stop(simulator->loop);
}

/* ---- closing ---- */

enum error_code simulator_finish_recording(struct simulator *simulator,
                                           struct recorder_counters *counters, struct error *error)
{
    struct recorder *recorder = simulator->recorder;

    memset(counters, 0, sizeof *counters);
    simulator->recorder = NULL;
    return recorder ? recorder_close(recorder, counters, error) : ERROR_NONE;
}

bool simulator_close_gateway(struct simulator *simulator, struct gateway_counters *counters)
{
    struct gateway *gateway = simulator->gateway;

    if (!gateway) {
        return false;
    }
    simulator->gateway = NULL;
    gateway_stop(gateway);

    /* Reads the frames that clients have sent since the last tick. No board receives them, but they
     * are counted as received or lost, so that sent and counted frames add up */
    struct bus_frame frame[64];

    for (size_t b = 0; simulator->buses.local && b < simulator->ports.count; b++) {
        while (can_receive(simulator->ports.port[b], frame, 64)) {
        }
    }
    gateway_counters(gateway, counters);
    return true;
}

void simulator_destroy(struct simulator *simulator)
{
    struct gateway_counters carried;
    struct recorder_counters counters;
    struct error error;

    if (!simulator) {
        return;
    }

    /* A run without ticks leaves no recording */
    if (simulator->recorder && (!simulator->loop || !loop_stats(simulator->loop)->ticks)) {
        recorder_discard(simulator->recorder);
        simulator->recorder = NULL;
    }
    simulator_finish_recording(simulator, &counters, &error);

    /* Closes users of ports, then the ports, then the buses */
    simulator_close_gateway(simulator, &carried);
    bus_ports_close(&simulator->gateway_ports);
    bus_ports_close(&simulator->task_ports);
    bus_ports_close(&simulator->ports);
    buses_close(&simulator->buses);

    if (simulator->contact) {
        simulator->contact->ops->destroy(simulator->contact);
    }
    requests_destroy(simulator->requests);
    free(simulator->client_table.text);
}

/* ---- access ---- */

enum error_code simulator_join(struct simulator *simulator, struct bus_ports *ports,
                               struct error *error)
{
    return buses_join(&simulator->buses, simulator->arena, ports, error);
}

uint64_t simulator_beat(const struct simulator *simulator)
{
    return loop_beat(simulator->loop);
}

bool simulator_read(const struct simulator *simulator, struct simulator_status *status)
{
    return snapshot_read(simulator->published, status) > 0;
}

void simulator_watch_interfaces(struct simulator *simulator, int64_t now_ns)
{
    interfaces_watch(&simulator->interfaces, now_ns);
    buses_seek(&simulator->buses, now_ns);
}

const struct simulator_config *simulator_configuration(const struct simulator *simulator)
{
    return &simulator->config;
}

const struct loop_stats *simulator_stats(const struct simulator *simulator)
{
    return loop_stats(simulator->loop);
}

struct can_port *simulator_port(const struct simulator *simulator, size_t bus)
{
    return simulator->ports.port[bus];
}

bool simulator_found_energy(const struct simulator *simulator)
{
    return watch_found_energy(simulator->watch);
}

struct simulator_parts simulator_parts(const struct simulator *simulator)
{
    return (struct simulator_parts){
        .boards = simulator->boards,
        .faults = simulator->faults,
        .gateway = simulator->gateway,
        .failure = simulator->failure,
        .settled = simulator->config.settle ? &simulator->settled : NULL,
        .stimulus = simulator->config.stimulus ? &simulator->stimulus : NULL,
        .dynamics = simulator->dynamics_notice.text,
        .is_local = simulator->buses.local,
        .nsignal = simulator->nsignal,
        .signal = simulator->title,
        .stream = simulator->stream,
        .view_stream = simulator->view_stream,
    };
}

const struct plant_sensors *simulator_measured(const struct simulator *simulator)
{
    return simulator->measured;
}

struct plant *simulator_plant(const struct simulator *simulator)
{
    return simulator->plant;
}

const struct task_runner *simulator_task_runner(const struct simulator *simulator)
{
    return simulator->task;
}

bool simulator_can_controller_state(const struct simulator *simulator, size_t bus, char *text,
                                    size_t size)
{
    return interfaces_describe(&simulator->interfaces, bus, text, size);
}

const struct wire *simulator_wire(const struct simulator *simulator, size_t bus)
{
    return simulator->buses.wire[bus];
}

struct requests *simulator_requests(const struct simulator *simulator)
{
    return simulator->requests;
}

const struct plant_contact_cost *simulator_contact_cost(const struct simulator *simulator)
{
    return plant_contact_cost(simulator->plant);
}
