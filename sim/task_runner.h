/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Runs a task against the buses of a rig: stepped inline by the loop (lockstep, free run), or in a
 * thread or process of its own (real time on a grid of the tick, or lockstep from outside). What the
 * task has to say can be read from any thread.
 */
#ifndef SIM_TASK_RUNNER_H
#define SIM_TASK_RUNNER_H

#include "rt/clock.h"
#include "rig/rig.h"
#include "rt/snapshot.h"
#include "tasks/task.h"

#include <stdatomic.h>
#include <stdbool.h>

struct controller_status {
    int64_t status;    /* enum task_status */
    char message[160]; /* task_message */
};

struct controller {
    struct task *task;
    bool lockstep;
    int64_t period_ns;
    size_t nbus;
    struct can_port **port;
    struct clock *time;
    int64_t grid_ns;  /* controller_run wakes up at this + k periods of the clock; 0 = at its begin */
    atomic_bool stop; /* ends controller_run */
    struct controller_status now;
    uint64_t steps;
    struct snapshot *published; /* struct controller_status */
};

/* ERROR_INPUT when there is no such task: to be asked before anything is opened. */
enum error_code controller_check_name(const char *task, struct error *error);

/* port: one a bus of the rig; stays the caller's. lockstep: the task sends STEP and waits for DONE.
 * Not RT-safe. */
enum error_code controller_create(const struct rig *rig, const char *task, struct can_port **port,
                                  bool lockstep, struct clock *time, struct arena *arena,
                                  struct controller **controller, struct error *error);

/* One step of the task. RT-safe. */
enum task_status controller_step(struct controller *controller, int64_t now_ns);

/* Steps until the task ends or stop is set; sends the motors-off when it was stopped. When it could not
 * run for more than 50 ms (a stopped process, a stolen processor) the task's time stands still
 * meanwhile: it goes on where it was, and takes its own absence for nobody else's silence. */
enum task_status controller_run(struct controller *controller);

/* The last published status; from any thread. */
void controller_read(const struct controller *controller, struct controller_status *status);

#endif
