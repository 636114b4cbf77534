/* SPDX-License-Identifier: Apache-2.0 */
/* Functions that all tasks share: start-up of the boards, poses, health, settings, stopping. */
#include "tasks/task_private.h"

#include "base/array.h"
#include "base/text.h"

#include <string.h>

enum { TELL_STEPS = 20, TEXT_SIZE = 100, WORST_TOLD = 3 };

/* position error of a motor that means that it is stuck, or that the robot has fallen */
static const double STRAY_RAD = 0.4;

static const struct task_ops *const known[] = {&task_squat,  &task_grasp, &task_hold,
                                               &task_stand,  &task_walk,  &task_sweep,
                                               &task_follow, &task_pose,  &task_excite};
static const char *const names[] = {"squat", "grasp",  "hold", "stand",  "walk",
                                    "sweep", "follow", "pose", "excite", NULL};

enum { KNOWN = ARRAY_COUNT(known) };

const char *const *task_names(void)
{
    return names;
}

/* Returns the operations of the task with this name; NULL = unknown name. */
static const struct task_ops *task_find_ops(const char *name)
{
    for (size_t i = 0; i < KNOWN; i++) {
        if (strcmp(known[i]->name, name) == 0) {
            return known[i];
        }
    }
    return NULL;
}

const char *task_summary(const char *name)
{
    const struct task_ops *ops = task_find_ops(name);

    return ops ? ops->summary : NULL;
}

const char *const *task_setting_names(const char *name)
{
    static const char *const none[] = {NULL};
    const struct task_ops *ops = task_find_ops(name);

    return ops && ops->setting_name ? ops->setting_name : none;
}

enum error_code task_create(const char *name, const struct task_config *config, struct arena *arena,
                            struct task **out, struct error *error)
{
    struct task *task = arena_alloc(arena, 1, sizeof *task);
    double *from = arena_alloc(arena, config->host.naxis, sizeof *from);
    enum error_code code;

    if (!task || !from) {
        return error_set(error, ERROR_MEMORY, "no memory for the task");
    }
    task->ops = task_find_ops(name);
    if (!task->ops) {
        return error_set(error, ERROR_INPUT, "found unknown task \"%.100s\"", name);
    }
    task->config = *config;
    task->from = from;

    /* Create the layers from the bus upward: host, servo loops, behavior */
    code = host_create(&config->host, arena, &task->host, error);
    code = code ? code : servo_create(&config->servo, task->host, arena, &task->servo, error);
    code = code ? code : task->ops->create(task, arena, error);
    *out = task;
    return code;
}

/* ---- functions for tasks ---- */

/* Writes the names of the joints until the text is full. */
static void task_list_joints(const struct task *task, char *list, size_t size)
{
    size_t used = 0;

    list[0] = '\0';
    for (size_t i = 0; i < task->config.host.naxis && used < size; i++) {
        int length = snprintf(list + used, size - used, "%s%s", i ? ", " : "",
                              task->config.host.axis[i].joint);

        /* Keep space for the five characters that end a truncated list, and a terminating 0 */
        if (used + (size_t)length + 6 > size) {
            snprintf(list + used, size - used, ", ...");
            return;
        }
        used += (size_t)length;
    }
}

enum error_code task_find_axis(const struct task *task, const char *joint, size_t *axis,
                               struct error *error)
{
    int index = host_find_axis(task->host, joint);

    if (index < 0) {
        const struct host_config *host = &task->config.host;
        const char *nearest =
            text_nearest_first(joint, host->axis, sizeof *host->axis, host->naxis);
        char list[320];

        task_list_joints(task, list, sizeof list);
        return error_set(error, ERROR_INPUT, "%s: the rig has no joint %.63s, expected %s%s",
                         task->ops->name, joint,
                         nearest || task->config.host.naxis == 1 ? "" : "one of ",
                         nearest ? nearest : list);
    }
    *axis = (size_t)index;
    return ERROR_NONE;
}

enum error_code task_find_input_axis(const struct task *task, size_t *axis, struct error *error)
{
    if (!task->config.input.joint) {
        return error_set(error, ERROR_INPUT, "%s: found no joint, expected one by --joint",
                         task->ops->name);
    }
    return task_find_axis(task, task->config.input.joint, axis, error);
}

enum error_code task_find_force(const struct task *task, const char *name, size_t *ft,
                                struct error *error)
{
    for (size_t i = 0; i < task->config.host.nft; i++) {
        if (strcmp(task->config.host.ft[i].name, name) == 0) {
            *ft = i;
            return ERROR_NONE;
        }
    }
    return error_set(error, ERROR_INPUT, "%s: the rig has no force-torque board for %s",
                     task->ops->name, name);
}

enum error_code task_find_feet(struct task *task, struct error *error)
{
    enum error_code code = task_find_force(task, "r_leg_ft", &task->foot[0], error);

    return code ? code : task_find_force(task, "l_leg_ft", &task->foot[1], error);
}

double task_feet_force(const struct task *task)
{
    return host_force(task->host, task->foot[0])->force_n[2] +
           host_force(task->host, task->foot[1])->force_n[2];
}

void task_move_pose(struct task *task, const double *to, double ramp_s, double t_s)
{
    double s = fmin(t_s / ramp_s, 1), blend = s * s * (3 - 2 * s);

    to = to ? to : task->config.initial_rad;
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        double span = to[i] - task->from[i];

        servo_set(task->servo, i, task->from[i] + blend * span,
                  s < 1 ? 6 * s * (1 - s) * span / ramp_s : 0);
    }
}

void task_tell_worst(struct task *task, const double *worst)
{
    size_t told[WORST_TOLD], naxis = task->config.host.naxis;

    for (size_t count = 0; count < WORST_TOLD && count < naxis; count++) {
        size_t used = strlen(task->message), next = naxis;

        /* Find the largest deviation of the axes that are not in the message yet */
        for (size_t i = 0; i < naxis; i++) {
            bool is_told = false;

            for (size_t k = 0; k < count; k++) {
                is_told |= told[k] == i;
            }
            next = !is_told && (next == naxis || worst[i] > worst[next]) ? i : next;
        }
        snprintf(task->message + used, sizeof task->message - used, "%s %.30s %.2f mrad",
                 count ? "," : "", task->config.host.axis[next].joint, 1e3 * worst[next]);
        told[count] = next;
    }
}

bool task_can_swing(struct task *task, size_t axis, double radians)
{
    const struct host_axis *of = &task->config.host.axis[axis];
    const double pose = task->config.initial_rad[axis];

    if (pose - radians >= of->lower_rad && pose + radians <= of->upper_rad) {
        return true;
    }
    snprintf(task->message, sizeof task->message,
             "joint %s: %.3g rad to both sides of %.3g rad is beyond its limits, %.3g to %.3g rad",
             of->joint, radians, pose, of->lower_rad, of->upper_rad);
    return false;
}

bool task_motors_follow(struct task *task, double *worst_error_rad)
{
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        double error = fabs(servo_reference(task->servo, i) - host_joint(task->host, i)->motor_rad);

        *worst_error_rad = fmax(*worst_error_rad, error);
        if (error > STRAY_RAD) {
            snprintf(task->message, sizeof task->message, "joint %s is %.2f rad from its reference",
                     task->config.host.axis[i].joint, error);
            return false;
        }
    }
    return true;
}

/* ---- a step ---- */

/* Continues the start-up of the boards by one period; starts the task when the motors are on. */
static enum task_status task_start_up(struct task *task)
{
    static const char *const doing[] = {
        [HOST_DISCOVERING] = "discovering the boards",
        [HOST_CONFIGURING] = "configuring the boards",
        [HOST_ENABLING] = "enabling the motors",
        [HOST_READY] = "motors on",
    };
    enum host_phase phase = host_start_up(task->host);

    if (phase == HOST_FAILED) {
        snprintf(task->message, sizeof task->message, "%s", host_message(task->host));
        return TASK_FAILED;
    }
    snprintf(task->message, sizeof task->message, "%s", doing[phase]);
    if (phase == HOST_READY) {
        task->started = true;
        task->start_ns = host_time_ns(task->host);
        servo_start(task->servo);
        for (size_t i = 0; i < task->config.host.naxis; i++) {
            task->from[i] = servo_wanted(task->servo, i);
        }
        if (task->ops->start) {
            task->ops->start(task);
        }
    }
    return TASK_RUNNING;
}

enum task_status task_step(struct task *task, int64_t now_ns)
{
    enum task_status status;

    if (!host_receive(task->host, now_ns)) {
        host_repeat_step(task->host, now_ns);
        return TASK_RUNNING;
    }
    /* Start the boards first, then run the task while they are healthy */
    if (!task->started) {
        status = task_start_up(task);
    } else if (!host_healthy(task->host)) {
        snprintf(task->message, sizeof task->message, "%s", host_message(task->host));
        status = TASK_FAILED;
    } else {
        task->tells = task->steps++ % TELL_STEPS == 0;
        status = task->ops->step(task, (double)(host_time_ns(task->host) - task->start_ns) * 1e-9);
        servo_update(task->servo);
    }
    /* Switch the motors off when the task ends, for any reason */
    if (status == TASK_RUNNING) {
        host_send(task->host);
    } else {
        task_stop(task);
    }
    return status;
}

bool task_is_endless(const struct task *task)
{
    return task->ops->endless && (task->ops != &task_walk || task->config.walk->distance_m <= 0);
}

void task_stop(struct task *task)
{
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        host_set_motor(task->host, i, false);
    }
    host_send(task->host);
}

/* ---- settings ---- */

enum error_code task_reserve_settings(struct task *task, size_t n, struct arena *arena,
                                      struct error *error)
{
    task->nsetting = n;
    task->setting = arena_alloc(arena, n, sizeof *task->setting);
    task->value = arena_alloc(arena, n, sizeof *task->value);
    return task->setting && task->value
               ? ERROR_NONE
               : error_set(error, ERROR_MEMORY, "no memory for the task's settings");
}

enum error_code task_make_settings(struct task *task, const struct task_setting *setting, size_t n,
                                   struct arena *arena, struct error *error)
{
    enum error_code code = task_reserve_settings(task, n, arena, error);

    for (size_t i = 0; i < n && !code; i++) {
        task->setting[i] = setting[i];
        task->value[i] = setting[i].initial;
    }
    return code;
}

size_t task_settings(const struct task *task, const struct task_setting **setting)
{
    *setting = task->setting;
    return task->nsetting;
}

bool task_set(struct task *task, size_t index, double value)
{
    const struct task_setting *setting = task->setting + index;

    if (index >= task->nsetting || !(value >= setting->min && value <= setting->max) ||
        (setting->whole && value != rint(value))) {
        return false;
    }
    task->value[index] = value;
    if (task->ops->changed) {
        task->ops->changed(task, index);
    }
    atomic_fetch_add(&task->changes, 1);
    return true;
}

double task_get(const struct task *task, size_t index)
{
    return index < task->nsetting ? task->value[index] : 0;
}

uint64_t task_changes(const struct task *task)
{
    return atomic_load(&task->changes);
}

/* Changes a setting from "NAME=VALUE". Returns ERROR_INPUT if the setting is unknown or the value
 * is out of range. */
static enum error_code task_set_pair(struct task *task, const char *pair, struct error *error)
{
    const char *equals = strchr(pair, '=');
    const struct task_setting *setting;
    size_t count = task_settings(task, &setting);
    int i;
    char name[TEXT_SIZE];
    double value;

    if (!equals || equals - pair >= TEXT_SIZE) {
        return error_set(error, ERROR_INPUT, "--set: found \"%.100s\", expected NAME=VALUE", pair);
    }
    snprintf(name, sizeof name, "%.*s", (int)(equals - pair), pair);
    i = TEXT_FIND(setting, count, name, name);
    if (i < 0) {
        const char *nearest = text_nearest_first(name, setting, sizeof *setting, count);

        return error_set(error, ERROR_INPUT, "found no setting \"%.80s\" of the task %s%s%s%s",
                         name, task->ops->name, count == 0 ? ", which has none" : "",
                         nearest ? "; the nearest is " : "", nearest ? nearest : "");
    }
    if (!text_to_double(equals + 1, &value) || !task_set(task, (size_t)i, value)) {
        return error_set(error, ERROR_INPUT, "%s: found \"%.80s\", expected %s%.6g to %.6g%s%s",
                         name, equals + 1, setting[i].whole ? "a whole number, " : "",
                         setting[i].min, setting[i].max, setting[i].unit[0] ? " " : "",
                         setting[i].unit);
    }
    return ERROR_NONE;
}

enum error_code task_set_all(struct task *task, const char *const *pair, size_t npair,
                             struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < npair && !code; i++) {
        code = task_set_pair(task, pair[i], error);
    }
    return code;
}

/* ---- reports ---- */

size_t task_signals(const struct task *task, const char *const **name)
{
    *name = task->ops->signal_name;
    return task->ops->nsignal;
}

void task_read_signals(const struct task *task, double *value)
{
    if (task->started && task->ops->nsignal > 0) {
        task->ops->signals(task, value);
    } else {
        memset(value, 0, task->ops->nsignal * sizeof *value);
    }
}

const char *task_message(const struct task *task)
{
    return task->message;
}

bool task_lost(const struct task *task)
{
    return host_lost(task->host);
}
