/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the answers that describe the simulator, as JSON. If memory for a key is missing, the whole
 * object becomes NULL. */
#include "control/private.h"

#include <inttypes.h>

/* ---- pieces ---- */

json_t *control_hash(uint64_t hash)
{
    return json_sprintf("%016" PRIx64, hash);
}

void control_append(json_t **array, json_t *value)
{
    if (json_array_append_new(*array, value)) {
        json_decref(*array);
        *array = NULL;
    }
}

/* Sets a key of an object. Out of memory: the object becomes NULL. */
static void control_put(json_t **object, const char *key, json_t *value)
{
    if (json_object_set_new(*object, key, value)) {
        json_decref(*object);
        *object = NULL;
    }
}

/* ---- hello ---- */

json_t *control_hello(const struct control *control)
{
    return json_pack("{s:s, s:s, s:i, s:o, s:o, s:i}", "program", "coman-hil", "version",
                     HIL_VERSION, "protocol", CONTROL_PROTOCOL, "rig",
                     control_text(control->rig->name), "file", control_text(control->rig->file),
                     "pid", getpid());
}

/* ---- status ---- */

/* Returns the name of a port's state in the protocol. It is shorter than can_port_state_name's. */
static const char *protocol_state_name(int64_t state)
{
    static const char *const names[] = {
        [CAN_PORT_UP] = "up",           [CAN_PORT_WARNING] = "warning",
        [CAN_PORT_PASSIVE] = "passive", [CAN_PORT_BUS_OFF] = "bus-off",
        [CAN_PORT_DOWN] = "down",       [CAN_PORT_GONE] = "gone",
        [CAN_PORT_STUCK] = "stuck",
    };

    return state >= 0 && state <= CAN_PORT_STUCK ? names[state] : "unknown";
}

/* Makes the list of buses: their counters, and their loads since the status `before`. */
static json_t *status_buses(const struct control *control, const struct simulator_status *now,
                            const struct simulator_status *before)
{
    json_t *array = json_array();

    for (size_t b = 0; b < control->rig->nbus; b++) {
        const struct rig_bus *rig_bus = &control->rig->bus[b];
        const struct bus_status *bus = &now->bus[b];
        bool onward = now->time_ns > before->time_ns && bus->bits >= before->bus[b].bits;
        double bits = (double)(bus->bits - (onward ? before->bus[b].bits : 0));
        double span = (double)(now->time_ns - (onward ? before->time_ns : 0)) * 1e-9;

        double load = span > 0.0 ? bits / span / (double)rig_bus->bitrate : 0.0;

        control_append(
            &array,
            json_pack("{s:o, s:s, s:I, s:I, s:I, s:I, s:o}", "name", control_text(rig_bus->name),
                      "state", protocol_state_name(bus->state), "rx_frames",
                      (json_int_t)bus->rx_frames, "tx_frames", (json_int_t)bus->tx_frames,
                      "rx_dropped", (json_int_t)bus->rx_dropped, "tx_dropped",
                      (json_int_t)bus->tx_dropped, "load", control_number(load)));
    }
    return array;
}

/* Makes the angles of the joints, rad; empty before the first tick. */
static json_t *status_joints(const struct control *control, const struct simulator_status *now)
{
    const struct robot *robot = control->rig->robot;
    json_t *object = json_object();

    for (size_t j = 0; j < robot->njoint && now->tick > 0; j++) {
        control_put(&object, robot->joint[j].name, control_number(now->q[j]));
    }
    return object;
}

/* Makes the upward forces on contact bodies, N; empty before the first tick. */
static json_t *status_contacts(const struct control *control, const struct simulator_status *now)
{
    json_t *object = json_object();

    for (size_t c = 0; c < control->rig->contact.nbody && now->tick > 0; c++) {
        control_put(&object, rig_contact_name(control->rig, c), control_number(now->force_z[c]));
    }
    return object;
}

static bool fault_is_active(const struct simulator_status *now, size_t fault)
{
    return now->fault[fault / 64] >> fault % 64 & 1;
}

/* Makes the list of active faults. */
static json_t *status_faults(const struct control *control, const struct simulator_status *now)
{
    const struct faults *faults = simulator_parts(control->config.simulator).faults;
    json_t *array = json_array();

    for (size_t i = 0; i < faults_count(faults); i++) {
        if (fault_is_active(now, i)) {
            control_append(&array, control_text(faults_at(faults, i)->name));
        }
    }
    return array;
}

/* Makes the list of the rig's external boards and the times of their last frames; empty before the
 * first tick. */
static json_t *status_external(const struct control *control, const struct simulator_status *now)
{
    const struct boards_config *boards = &control->rig->boards;
    json_t *array = json_array();
    size_t count = 0;

    for (size_t i = 0; i < boards->nboard && count < SIMULATOR_EXTERNAL_MAX; i++) {
        const struct board_config *board = &boards->board[i];
        int64_t heard_ns = now->external_heard_ns[count];

        if (board->external && now->tick > 0) {
            control_append(
                &array, json_pack("{s:o, s:o, s:b, s:o}", "board", control_text(board->name), "bus",
                                  control_text(control->rig->bus[board->bus].name), "silent",
                                  (int)(now->external_silent >> count & 1), "heard_s",
                                  heard_ns < 0 ? json_null() : json_real((double)heard_ns * 1e-9)));
            count++;
        }
    }
    return array;
}

/* Makes the name, status and message of the task; JSON null without a task. */
static json_t *status_task(const struct control *control)
{
    static const char *const names[] = {
        [TASK_RUNNING] = "running", [TASK_DONE] = "done", [TASK_FAILED] = "failed"};
    const struct task_runner *runner = simulator_task_runner(control->config.simulator);
    struct task_runner_status status = {.status = TASK_RUNNING};

    if (!runner) {
        return json_null();
    }
    task_runner_read(runner, &status);
    return json_pack("{s:o, s:s, s:o}", "name",
                     control_text(simulator_configuration(control->config.simulator)->task),
                     "status", names[status.status], "message", control_text(status.message));
}

/* Makes the counters of this socket. */
static json_t *status_control(const struct control *control)
{
    const struct control_counters *c = &control->counters;

    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I}", "clients",
                     (json_int_t)c->clients, "requests", (json_int_t)c->requests,
                     "refused_requests", (json_int_t)c->refused_requests, "turned_away",
                     (json_int_t)c->refused, "cut_junk", (json_int_t)c->cut_junk, "cut_slow",
                     (json_int_t)c->cut_slow, "cut_silent", (json_int_t)c->cut_silent, "cut_idle",
                     (json_int_t)c->cut_idle, "rows", (json_int_t)c->rows, "missed_rows",
                     (json_int_t)c->missed_rows);
}

json_t *control_status(const struct control *control, struct control_client *client)
{
    static const struct simulator_status start;
    const struct simulator_config *config = simulator_configuration(control->config.simulator);
    const struct rig *rig = control->rig;
    struct simulator_status now = {0};
    json_t *body;

    simulator_read(control->config.simulator, &now);
    /* The loads of buses are means since this client's last status */
    body = json_pack(
        "{s:o, s:o, s:o, s:o, s:o, s:s, s:o, s:b, s:b, s:I, s:f, s:f, s:f, s:I, s:I, s:o, s:o, "
        "s:o, s:o, s:o, s:{s:I, s:I, s:I, s:I}, s:o}",
        "rig", control_text(rig->name), "file", control_text(rig->file), "robot_hash",
        control_hash(rig->robot->hash), "task", status_task(control), "recording",
        config->record ? control_text(config->record) : json_null(), "clock",
        word_of(loop_clock_words, config->clock), "speed",
        control_number(requests_speed(control->config.requests)), "paused",
        (int)requests_paused(control->config.requests), "clamped", (int)now.clamped, "tick",
        (json_int_t)now.tick, "tick_s", (double)rig->tick_ns * 1e-9, "time_s",
        (double)now.time_ns * 1e-9, "elapsed_s", (double)now.elapsed_ns * 1e-9, "overruns",
        (json_int_t)now.overruns, "lost_ticks", (json_int_t)now.lost_ticks, "buses",
        status_buses(control, &now, client->seen ? &client->before : &start), "joints",
        status_joints(control, &now), "contacts", status_contacts(control, &now), "faults",
        status_faults(control, &now), "external", status_external(control, &now), "boards",
        "frames", (json_int_t)now.boards.frames, "foreign", (json_int_t)now.boards.foreign,
        "unknown", (json_int_t)now.boards.unknown, "malformed", (json_int_t)now.boards.malformed,
        "control", status_control(control));
    client->before = now;
    client->seen = true;
    return body;
}

/* ---- statistics ---- */

/* Makes count and percentiles of a histogram from a copy, because the loop writes it
 * concurrently. */
static json_t *statistics_histogram(struct control *control, const struct histogram *of)
{
    struct histogram *copy = &control->histogram;

    histogram_copy(of, copy);
    return json_pack("{s:I, s:f, s:f, s:f, s:f, s:f}", "count", (json_int_t)copy->count, "min_us",
                     (double)copy->min * 1e-3, "median_us",
                     (double)histogram_percentile(copy, 0.5) * 1e-3, "p99_us",
                     (double)histogram_percentile(copy, 0.99) * 1e-3, "max_us",
                     (double)copy->max * 1e-3, "mean_us",
                     copy->count ? (double)copy->sum * 1e-3 / (double)copy->count : 0.0);
}

json_t *control_statistics(struct control *control)
{
    const struct loop_stats *stats = simulator_stats(control->config.simulator);
    const struct lockstep_counters *lockstep;
    struct simulator_status now = {0};
    json_t *phases = json_object(), *overruns = json_object();

    simulator_read(control->config.simulator, &now);
    for (int p = 0; p < PHASE_COUNT; p++) {
        const char *name = loop_phase_name((enum loop_phase)p);

        control_put(&phases, name, statistics_histogram(control, &stats->phase[p]));
        control_put(&overruns, name, json_integer((json_int_t)now.overruns_by[p]));
    }
    lockstep = &now.lockstep;
    return json_pack(
        "{s:I, s:f, s:o, s:o, s:o, s:I, s:o, s:I, s:I, s:I, s:I, s:I, s:{s:I, s:I, s:I, s:I}}",
        "tick", (json_int_t)now.tick, "time_s", (double)now.time_ns * 1e-9, "phases", phases,
        "work", statistics_histogram(control, &stats->work), "wakeup",
        statistics_histogram(control, &stats->wakeup), "overruns", (json_int_t)now.overruns,
        "overruns_by", overruns, "late_ticks", (json_int_t)now.late_ticks, "lost_ticks",
        (json_int_t)now.lost_ticks, "pauses", (json_int_t)now.pauses, "pause_ticks",
        (json_int_t)now.pause_ticks, "events_lost", (json_int_t)now.events_lost, "lockstep",
        "steps", (json_int_t)lockstep->steps, "mismatches", (json_int_t)lockstep->mismatches,
        "malformed", (json_int_t)lockstep->malformed, "silences", (json_int_t)lockstep->silences);
}

/* ---- lists ---- */

json_t *control_tunable(const struct control *control, size_t index)
{
    const struct tunable *tunable = requests_tunable(control->config.requests, index);

    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:b}", "name", control_text(tunable->name), "value",
                     control_number(requests_value(control->config.requests, index)), "unit",
                     control_text(tunable->unit), "min", control_number(tunable->min), "max",
                     control_number(tunable->max), "whole", (int)tunable->whole);
}

/* Makes the list of checkpoint slots that are in use; slot 0 is the start. */
static json_t *list_checkpoints(const struct control *control)
{
    json_t *array = json_array();

    for (int i = 0; i < CHECKPOINT_SLOTS; i++) {
        const struct request_answer *of = &control->slot[i];

        if (i == 0 || of->ticket > 0) {
            control_append(&array,
                           json_pack("{s:i, s:I, s:f}", "slot", i, "tick", (json_int_t)of->tick,
                                     "time_s", (double)of->time_ns * 1e-9));
        }
    }
    return array;
}

const char *control_list_entry(const struct control *control, enum control_list list, size_t index)
{
    const struct rig *rig = control->rig;
    const struct faults *faults = simulator_parts(control->config.simulator).faults;
    const struct tunable *tunable = requests_tunable(control->config.requests, index);
    size_t nbody = rig->robot->nbody;

    switch (list) {
    case CONTROL_LIST_TUNABLES:
        return tunable ? tunable->name : NULL;
    case CONTROL_LIST_FAULTS:
        return index < faults_count(faults) ? faults_at(faults, index)->name : NULL;
    case CONTROL_LIST_BODIES:
        return index < nbody                ? rig->robot->body[index].name
               : index < nbody + rig->nfree ? rig->free[index - nbody].name
                                            : NULL;
    case CONTROL_LIST_SIGNALS:
        return index < simulator_parts(control->config.simulator).nsignal
                   ? simulator_parts(control->config.simulator).signal[index]
                   : NULL;
    case CONTROL_LIST_COMMANDS:
        return index < CONTROL_COMMANDS ? control_command_name((enum control_command)index) : NULL;
    case CONTROL_LIST_CHECKPOINTS:
    case CONTROL_LISTS:
        break;
    }
    return NULL;
}

json_t *control_list(const struct control *control, const struct control_request *request)
{
    const enum control_list list = request->list;
    const struct faults *faults = simulator_parts(control->config.simulator).faults;
    struct simulator_status now = {0};
    json_t *array = list == CONTROL_LIST_CHECKPOINTS ? list_checkpoints(control) : json_array();
    const char *name;

    simulator_read(control->config.simulator, &now);
    for (size_t i = 0; (name = control_list_entry(control, list, i)); i++) {
        if (!request->match || control_matches(request->match, name)) {
            control_append(&array, list == CONTROL_LIST_TUNABLES ? control_tunable(control, i)
                                   : list == CONTROL_LIST_FAULTS
                                       ? json_pack("{s:o, s:o, s:b}", "name", control_text(name),
                                                   "line", control_text(faults_at(faults, i)->text),
                                                   "active", (int)fault_is_active(&now, i))
                                       : control_text(name));
        }
    }
    return json_pack("{s:o}", control_list_name(list), array);
}
