/* SPDX-License-Identifier: Apache-2.0 */
/* The life of a simulator: created whole or not at all, run in the caller's thread with the task
 * in a thread of its own, closed. assembly.c creates its parts. */
#include "sim/simulator_private.h"

#include <string.h>

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
    code = simulator_assemble(simulator, notice, error);
    if (code) {
        simulator_destroy(simulator);
        return code;
    }
    *out = simulator;
    return ERROR_NONE;
}

/* ---- running ---- */

/* Makes the task step in the middle between two ticks: on one processor it would otherwise delay
 * the loop by its own duration whenever the two grids coincide. */
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
    struct realtime_report unused; /* the loop's thread reports the same */

    realtime_apply(&simulator->task_realtime, &unused);
    simulator_offset_task_grid(simulator);
    task_runner_run(simulator->task);
    loop_stop(simulator->loop);
    return NULL;
}

/* Starts the task's thread. */
static enum error_code simulator_start_task(struct simulator *simulator, struct error *error)
{
    const int priority = simulator->config.rig->realtime.priority;
    int reason;

    /* A priority above the loop's, as if the task ran on another computer at the end of the
     * cable */
    simulator->task_realtime = (struct realtime_config){
        .priority = priority + (priority > 0 && priority < 99),
        .cpu = -1,
    };
    reason = pthread_create(&simulator->task_thread, NULL, simulator_task_main, simulator);
    if (reason) {
        return error_set_errno(error, reason, "cannot start the task's thread");
    }
    simulator->task_running = true;
    return ERROR_NONE;
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
    enum error_code code;

    memset(report, 0, sizeof *report);
    /* Memory: no page fault may come in the loop */
    if (simulator->config.untouched) {
        arena_close(simulator->arena);
        code = ERROR_NONE;
    } else {
        code = arena_seal(simulator->arena, false, error);
        realtime_touch();
    }
    if (code || simulator->config.clock != LOOP_CLOCK_REAL) {
        return code;
    }
    /* The task's thread starts before the calling thread takes its real-time settings */
    if (simulator->task) {
        code = simulator_start_task(simulator, error);
        if (code) {
            return code;
        }
    }
    realtime_apply(&config, report);
    return ERROR_NONE;
}

/* Ends the task's thread; returns whether the task had ended by itself. */
static bool simulator_join_task(struct simulator *simulator)
{
    atomic_store(&simulator->task->stop, true);
    if (simulator->pace) {
        /* the task may sleep on this clock, which stands still in a pause */
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

/* Accounts for frames that clients have sent since the last tick, as received or as lost: no
 * board sees them, but whoever counts what was sent finds all of it. */
static void simulator_receive_rest(struct simulator *simulator)
{
    struct bus_frame frame[64];

    for (size_t b = 0; simulator->buses.local && b < simulator->ports.count; b++) {
        while (can_receive(simulator->ports.port[b], frame, 64)) {
        }
    }
}

bool simulator_close_gateway(struct simulator *simulator, struct gateway_counters *counters)
{
    struct gateway *gateway = simulator->gateway;

    if (!gateway) {
        return false;
    }
    simulator->gateway = NULL;
    gateway_stop(gateway);
    simulator_receive_rest(simulator);
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

    /* A run that never began leaves no recording */
    if (simulator->recorder && (!simulator->loop || !loop_stats(simulator->loop)->ticks)) {
        recorder_discard(simulator->recorder);
        simulator->recorder = NULL;
    }
    simulator_finish_recording(simulator, &counters, &error);

    /* Users of ports, then the ports, then the buses */
    simulator_close_gateway(simulator, &carried);
    bus_ports_close(&simulator->gateway_ports);
    bus_ports_close(&simulator->task_ports);
    bus_ports_close(&simulator->ports);
    buses_close(&simulator->buses);

    if (simulator->contact) {
        simulator->contact->ops->destroy(simulator->contact);
    }
    requests_destroy(simulator->requests);
}
