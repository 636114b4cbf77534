/* SPDX-License-Identifier: Apache-2.0 */
/* Steps a task at the right times, inline or in its own thread or process. */
#include "sim/task_runner.h"

#include "base/text.h"

#include <stdio.h>
#include <string.h>

enum {
    PUBLISH_STEPS = 50,      /* steps between two messages of a running task */
    DONE_WAIT_NS = 10000000, /* lockstep: longest sleep for DONE before the task checks again */
    POLLED_MAX = 64,
};

/* A longer time between two steps is a pause of the process. */
#define GAP_NS (50 * CLOCK_MS)

enum error_code task_runner_check_name(const char *task, struct error *error)
{
    const char *const *names = task_names();
    const char *nearest;
    char list[256] = "";
    size_t count = 0;

    for (; names[count]; count++) {
        size_t used = strlen(list);

        if (!strcmp(names[count], task)) {
            return ERROR_NONE;
        }
        snprintf(list + used, sizeof list - used, "%s%s", count ? ", " : "", names[count]);
    }
    nearest = text_nearest(task, names, count);
    return error_set(error, ERROR_INPUT, "found unknown task \"%.100s\", expected one of: %s%s%s%s",
                     task, list, nearest ? "; did you mean \"" : "", nearest ? nearest : "",
                     nearest ? "\"?" : "");
}

enum error_code task_runner_create(const struct rig *rig, const char *task,
                                   const struct task_input *input, struct can_port **port,
                                   bool lockstep, struct clock *time, struct arena *arena,
                                   struct task_runner **out, struct error *error)
{
    struct task_runner *runner = arena_alloc(arena, 1, sizeof *runner);
    const struct task_config config = {
        .host = rig_host_config(rig, port, lockstep),
        .initial_rad = rig->initial_rad,
        .servo = rig->servo,
        .squat = rig->squat,
        .grasp = rig->grasp,
        .hold = rig->hold_task,
        .walk = rig->walk,
        .body = &rig->body,
        .input = input ? *input : (struct task_input){NULL, NULL},
    };
    enum error_code code;

    if (!runner) {
        return error_set(error, ERROR_MEMORY, "no memory left for a task");
    }
    /* The runner, its published status, and the task itself */
    *runner = (struct task_runner){
        .lockstep = lockstep,
        .period_ns = rig->tick_ns,
        .nbus = rig->nbus,
        .port = port,
        .time = time,
    };
    code = snapshot_create(sizeof(struct task_runner_status), arena, &runner->published, error);
    code = code ? code : task_create(task, &config, arena, &runner->task, error);
    if (code) {
        return code;
    }
    runner->nsignal = task_signals(runner->task, &runner->signal_name);
    *out = runner;
    return ERROR_NONE;
}

enum task_status task_runner_step(struct task_runner *runner, int64_t now_ns)
{
    enum task_status status = task_step(runner->task, now_ns);

    if (runner->steps++ % PUBLISH_STEPS == 0 || status != TASK_RUNNING) {
        runner->now.status = status;
        strncpy(runner->now.message, task_message(runner->task), sizeof runner->now.message - 1);
        snapshot_write(runner->published, &runner->now);
    }
    return status;
}

enum task_status task_runner_run(struct task_runner *runner)
{
    int64_t now = clock_now(runner->time), last = now, paused = 0;
    int64_t deadline = runner->grid_ns > 0 ? runner->grid_ns : now;
    enum task_status status = TASK_RUNNING;

    while (!atomic_load(&runner->stop)) {
        status = task_runner_step(runner, now);
        if (status != TASK_RUNNING) {
            return status;
        }
        if (runner->lockstep) {
            /* Sleeps until a bus has frames (lockstep) */
            struct pollfd fds[POLLED_MAX];
            size_t count = 0;

            for (size_t b = 0; b < runner->nbus && b < POLLED_MAX; b++) {
                fds[count].fd = runner->port[b]->ops->descriptor(runner->port[b]);
                fds[count++].events = POLLIN;
            }
            clock_wait_readable(runner->time, fds, count, clock_now(runner->time) + DONE_WAIT_NS);
        } else {
            /* Sleep until the next deadline (real time). Skip missed deadlines without shifting the
             * grid. */
            const int64_t before = clock_now(runner->time);

            deadline += runner->period_ns;
            if (before > deadline) {
                deadline += (before - deadline) / runner->period_ns * runner->period_ns;
            }
            clock_sleep_until(runner->time, deadline);
        }
        /* The task's time is the clock's time minus the pauses in which the process was stopped */
        now = clock_now(runner->time);
        if (now - last > GAP_NS) {
            paused += now - last - runner->period_ns;
        }
        last = now;
        now -= paused;
    }
    task_stop(runner->task);
    return status;
}

void task_runner_read(const struct task_runner *runner, struct task_runner_status *status)
{
    if (!snapshot_read(runner->published, status)) {
        memset(status, 0, sizeof *status);
    }
}
