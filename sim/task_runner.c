/* SPDX-License-Identifier: Apache-2.0 */
/* Steps a task on time. */
#include "sim/task_runner.h"

#include "base/text.h"

#include <stdio.h>
#include <string.h>

enum {
    PUBLISH_STEPS = 50,      /* a running task's message is passed on so often */
    DONE_WAIT_NS = 10000000, /* lockstep: longest sleep for DONE before the task looks again */
    POLLED_MAX = 64,
};

#define GAP_NS (50 * CLOCK_MS) /* between two steps: longer ones are pauses */

enum error_code controller_check_name(const char *task, struct error *error)
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

enum error_code controller_create(const struct rig *rig, const char *task, struct can_port **port,
                                  bool lockstep, struct clock *time, struct arena *arena,
                                  struct controller **out, struct error *error)
{
    struct controller *made = arena_alloc(arena, 1, sizeof *made);
    struct task_config config = {
        .host =
            {
                .nbus = rig->nbus,
                .port = port,
                .bus = rig->host_bus,
                .naxis = rig->naxis,
                .axis = rig->axis,
                .nft = rig->nft,
                .ft = rig->ft,
                .supply_v = rig->supply_v,
                .period_ns = rig->tick_ns,
                .lockstep = lockstep,
                .lockstep_bus = rig->lockstep.bus,
                .step_id = rig->lockstep.step_id,
                .done_id = rig->lockstep.done_id,
            },
        .initial_rad = rig->initial_rad,
        .servo = rig->servo,
        .squat = rig->squat,
        .grasp = rig->grasp,
    };
    enum error_code code;

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for the controller");
    }
    *made = (struct controller){
        .lockstep = lockstep,
        .period_ns = rig->tick_ns,
        .nbus = rig->nbus,
        .port = port,
        .time = time,
    };
    code = snapshot_create(sizeof(struct controller_status), arena, &made->published, error);
    if (!code) {
        code = task_create(task, &config, arena, &made->task, error);
    }
    *out = made;
    return code;
}

enum task_status controller_step(struct controller *controller, int64_t now_ns)
{
    enum task_status status = task_step(controller->task, now_ns);

    if (controller->steps++ % PUBLISH_STEPS == 0 || status != TASK_RUNNING) {
        controller->now.status = status;
        strncpy(controller->now.message, task_message(controller->task),
                sizeof controller->now.message - 1);
        snapshot_write(controller->published, &controller->now);
    }
    return status;
}

/* lockstep: sleeps until some bus has frames */
static void wait_for_frames(struct controller *controller)
{
    struct pollfd fds[POLLED_MAX];
    size_t count = 0;

    for (size_t b = 0; b < controller->nbus && b < POLLED_MAX; b++) {
        fds[count].fd = controller->port[b]->ops->descriptor(controller->port[b]);
        fds[count++].events = POLLIN;
    }
    clock_wait_readable(controller->time, fds, count, clock_now(controller->time) + DONE_WAIT_NS);
}

/* The task's time: the clock's without the pauses in which it did not run. */
static int64_t task_time(const struct controller *controller, int64_t *last_ns, int64_t *paused_ns)
{
    int64_t now = clock_now(controller->time);

    if (now - *last_ns > GAP_NS) {
        *paused_ns += now - *last_ns - controller->period_ns;
    }
    *last_ns = now;
    return now - *paused_ns;
}

enum task_status controller_run(struct controller *controller)
{
    int64_t now = clock_now(controller->time), last = now, paused = 0;
    int64_t deadline = controller->grid_ns > 0 ? controller->grid_ns : now;
    enum task_status status = TASK_RUNNING;

    while (!atomic_load(&controller->stop)) {
        status = controller_step(controller, now);
        if (status != TASK_RUNNING) {
            return status;
        }
        if (controller->lockstep) {
            wait_for_frames(controller);
        } else {
            deadline += controller->period_ns;
            if (clock_now(controller->time) > deadline) {
                /* late: the missed periods are dropped, the grid stays */
                deadline += (clock_now(controller->time) - deadline) / controller->period_ns *
                            controller->period_ns;
            }
            clock_sleep_until(controller->time, deadline);
        }
        now = task_time(controller, &last, &paused);
    }
    task_stop(controller->task);
    return status;
}

void controller_read(const struct controller *controller, struct controller_status *status)
{
    if (!snapshot_read(controller->published, status)) {
        memset(status, 0, sizeof *status);
    }
}
