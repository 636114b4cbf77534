/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Runs a task on the buses of a rig. In lockstep and free run, the loop steps it inline. Otherwise
 * it has its own thread or process: in real time on the grid of the tick, or in lockstep from
 * outside. Any thread can read its state and message. Times in ns of the given clock.
 */
#ifndef SIM_TASK_RUNNER_H
#define SIM_TASK_RUNNER_H

#include "rig/rig.h"
#include "rt/clock.h"
#include "rt/snapshot.h"
#include "tasks/task.h"

#include <stdatomic.h>

struct task_runner_status {
    int64_t status;    /* enum task_status */
    char message[160]; /* task_message */
};

struct task_runner {
    struct task *task;
    bool lockstep;
    int64_t period_ns;
    size_t nbus;
    struct can_port **port;
    struct clock *time;
    int64_t grid_ns;  /* task_runner_run steps at grid_ns + k periods; 0 = its start */
    atomic_bool stop; /* ends task_runner_run; any thread may set it */
    struct task_runner_status now;
    uint64_t steps;
    struct snapshot *published; /* struct task_runner_status */
    size_t nsignal;             /* task_signals */
    const char *const *signal_name;
};

/* Checks that a task of this name exists. Call it before anything is opened. ERROR_INPUT. Not
 * RT-safe. */
enum error_code task_runner_check_name(const char *task, struct error *error);

/* Creates a task and its runner. input: NULL = none. port: one per bus of the rig. All arguments
 * and the clock are borrowed. lockstep: the task sends STEP and waits for DONE. Memory from arena.
 * ERROR_MEMORY, ERROR_INPUT. Not RT-safe. */
enum error_code task_runner_create(const struct rig *rig, const char *task,
                                   const struct task_input *input, struct can_port **port,
                                   bool lockstep, struct clock *time, struct arena *arena,
                                   struct task_runner **runner, struct error *error);

/* Runs one step of the task. RT-safe. */
enum task_status task_runner_step(struct task_runner *runner, int64_t now_ns);

/* Steps until the task ends or stop is set; after stop, switches the motors off. A gap of more than
 * 50 ms between two steps (a stopped process, no processor) does not count as task time. So the
 * task continues where it was, and does not mistake the gap for a board's timeout. RT-safe except
 * that it sleeps. */
enum task_status task_runner_run(struct task_runner *runner);

/* Copies the last published status. Any thread. RT-safe except that it may repeat the copy. */
void task_runner_read(const struct task_runner *runner, struct task_runner_status *status);

#endif
