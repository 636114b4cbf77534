/* SPDX-License-Identifier: Apache-2.0 */
/* Makes the answers that describe the simulator, as JSON. A key that could not be made (no
 * memory) spoils the whole object, which then is NULL. */
#include "control/private.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* ---- pieces ---- */

bool control_put(json_t *object, const char *key, json_t *value)
{
    return json_object_set_new(object, key, value) == 0;
}

json_t *control_number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

json_t *control_count(uint64_t value)
{
    return json_integer((json_int_t)value);
}

json_t *control_hash(uint64_t hash)
{
    char text[17];

    snprintf(text, sizeof text, "%016" PRIx64, hash);
    return json_string(text);
}

static json_t *control_seconds(int64_t ns)
{
    return control_number((double)ns * 1e-9);
}

/* Appends a value to an array and takes it over; false = no memory. */
static bool control_append(json_t *array, json_t *value)
{
    return json_array_append_new(array, value) == 0;
}

/* Returns the object, or frees it and returns NULL when a part of it could not be made. */
static json_t *control_whole_or_null(json_t *object, bool good)
{
    if (!good) {
        json_decref(object);
        return NULL;
    }
    return object;
}

/* ---- hello ---- */

json_t *control_hello(const struct control *control)
{
    json_t *body = json_object();
    bool good = control_put(body, "program", json_string("coman-hil"));

    good = control_put(body, "version", json_string(HIL_VERSION)) && good;
    good = control_put(body, "protocol", json_integer(CONTROL_PROTOCOL)) && good;
    good = control_put(body, "rig", control_text(control->rig->name)) && good;
    good = control_put(body, "file", control_text(control->rig->file)) && good;
    good = control_put(body, "pid", json_integer(getpid())) && good;
    return control_whole_or_null(body, good);
}

/* ---- status ---- */

/* Returns the protocol's word for a port's state; they are shorter than those of
 * can_port_state_name. */
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

/* Returns the load of a bus (0 to 1) since the status `before`, or since the start when time was
 * set back. */
static double status_bus_load(const struct rig_bus *bus, const struct bus_status *now,
                              int64_t time_ns, const struct bus_status *before, int64_t before_ns)
{
    bool onward = time_ns > before_ns && now->bits >= before->bits;
    double bits = (double)(now->bits - (onward ? before->bits : 0));
    double span = (double)(time_ns - (onward ? before_ns : 0)) * 1e-9;

    return span > 0.0 ? bits / span / (double)bus->bitrate : 0.0;
}

/* Makes the list of buses with their counters, and loads since the status `before`. */
static json_t *status_buses(const struct control *control, const struct simulator_status *now,
                            const struct simulator_status *before)
{
    json_t *array = json_array();
    bool good = array != NULL;

    for (size_t b = 0; b < control->rig->nbus && good; b++) {
        const struct rig_bus *rig_bus = &control->rig->bus[b];
        const struct bus_status *bus = &now->bus[b];
        json_t *entry = json_object();

        good = control_put(entry, "name", control_text(rig_bus->name)) && good;
        good = control_put(entry, "state", json_string(protocol_state_name(bus->state))) && good;
        good = control_put(entry, "rx_frames", control_count(bus->rx_frames)) && good;
        good = control_put(entry, "tx_frames", control_count(bus->tx_frames)) && good;
        good = control_put(entry, "rx_dropped", control_count(bus->rx_dropped)) && good;
        good = control_put(entry, "tx_dropped", control_count(bus->tx_dropped)) && good;
        good = control_put(entry, "load",
                           control_number(status_bus_load(rig_bus, bus, now->time_ns,
                                                          &before->bus[b], before->time_ns))) &&
               good;
        good = control_append(array, entry) && good;
    }
    return control_whole_or_null(array, good);
}

/* Makes the angles of the joints, rad; empty before the first tick. */
static json_t *status_joints(const struct control *control, const struct simulator_status *now)
{
    const struct robot *robot = control->rig->robot;
    json_t *object = json_object();
    bool good = object != NULL;

    for (size_t j = 0; j < robot->njoint && good && now->tick > 0; j++) {
        good = control_put(object, robot->joint[j].name, control_number(now->q[j]));
    }
    return control_whole_or_null(object, good);
}

/* Makes the upward forces on contact bodies, N; empty before the first tick. */
static json_t *status_contacts(const struct control *control, const struct simulator_status *now)
{
    json_t *object = json_object();
    bool good = object != NULL;

    for (size_t c = 0; c < control->rig->contact.nbody && good && now->tick > 0; c++) {
        good =
            control_put(object, rig_contact_name(control->rig, c), control_number(now->force_z[c]));
    }
    return control_whole_or_null(object, good);
}

static bool fault_is_active(const struct simulator_status *now, size_t fault)
{
    return now->fault[fault / 64] >> fault % 64 & 1;
}

/* Makes the list of active faults. */
static json_t *status_faults(const struct control *control, const struct simulator_status *now)
{
    const struct faults *faults = simulator_faults(control->config.simulator);
    json_t *array = json_array();
    bool good = array != NULL;

    for (size_t i = 0; i < faults_count(faults) && good; i++) {
        good = !fault_is_active(now, i) ||
               control_append(array, control_text(faults_at(faults, i)->name));
    }
    return control_whole_or_null(array, good);
}

/* Makes the list of the rig's real boards, with when they were last heard; empty before the
 * first tick. */
static json_t *status_external(const struct control *control, const struct simulator_status *now)
{
    const struct boards_config *boards = &control->rig->boards;
    json_t *array = json_array();
    bool good = array != NULL;
    size_t count = 0;

    for (size_t i = 0; i < boards->nboard && count < SIMULATOR_EXTERNAL_MAX && good; i++) {
        const struct board_config *board = &boards->board[i];
        json_t *entry;

        if (!board->external || now->tick == 0) {
            continue;
        }
        entry = json_object();
        good = control_put(entry, "board", control_text(board->name));
        good = control_put(entry, "bus", control_text(control->rig->bus[board->bus].name)) && good;
        good =
            control_put(entry, "silent", json_boolean(now->external_silent >> count & 1)) && good;
        good = control_put(entry, "heard_s",
                           now->external_heard_ns[count] < 0
                               ? json_null()
                               : control_seconds(now->external_heard_ns[count])) &&
               good;
        good = control_append(array, entry) && good;
        count++;
    }
    return control_whole_or_null(array, good);
}

/* Makes name, status and message of the task; null without one. */
static json_t *status_task(const struct control *control)
{
    static const char *const names[] = {
        [TASK_RUNNING] = "running", [TASK_DONE] = "done", [TASK_FAILED] = "failed"};
    const struct task_runner *runner = simulator_task_runner(control->config.simulator);
    struct task_runner_status status = {.status = TASK_RUNNING};
    json_t *body;
    bool good;

    if (!runner) {
        return json_null();
    }
    task_runner_read(runner, &status);
    body = json_object();
    good = control_put(body, "name",
                       control_text(simulator_configuration(control->config.simulator)->task));
    good = control_put(body, "status", json_string(names[status.status])) && good;
    good = control_put(body, "message", control_text(status.message)) && good;
    return control_whole_or_null(body, good);
}

/* Makes the counters of this socket. */
static json_t *status_control(const struct control *control)
{
    const struct control_counters *c = &control->counters;
    json_t *body = json_object();
    bool good = control_put(body, "clients", control_count(c->clients));

    good = control_put(body, "requests", control_count(c->requests)) && good;
    good = control_put(body, "refused_requests", control_count(c->refused_requests)) && good;
    good = control_put(body, "turned_away", control_count(c->refused)) && good;
    good = control_put(body, "cut_junk", control_count(c->cut_junk)) && good;
    good = control_put(body, "cut_slow", control_count(c->cut_slow)) && good;
    good = control_put(body, "cut_silent", control_count(c->cut_silent)) && good;
    good = control_put(body, "rows", control_count(c->rows)) && good;
    good = control_put(body, "missed_rows", control_count(c->missed_rows)) && good;
    return control_whole_or_null(body, good);
}

json_t *control_status(const struct control *control, struct control_client *client)
{
    const struct simulator *simulator = control->config.simulator;
    const struct simulator_config *config = simulator_configuration(simulator);
    static const struct simulator_status start;
    struct simulator_status now = {0};
    json_t *body = json_object();
    bool good = body != NULL;

    simulator_read(simulator, &now);

    /* What is simulated */
    good = control_put(body, "rig", control_text(control->rig->name)) && good;
    good = control_put(body, "file", control_text(control->rig->file)) && good;
    good = control_put(body, "robot_hash", control_hash(control->rig->robot->hash)) && good;
    good = control_put(body, "task", status_task(control)) && good;
    good = control_put(body, "recording",
                       config->record ? control_text(config->record) : json_null()) &&
           good;

    /* Its time */
    good =
        control_put(body, "clock", json_string(word_of(loop_clock_words, config->clock))) && good;
    good = control_put(body, "speed", control_number(requests_speed(control->config.requests))) &&
           good;
    good = control_put(body, "paused", json_boolean(requests_paused(control->config.requests))) &&
           good;
    good = control_put(body, "clamped", json_boolean(now.clamped)) && good;
    good = control_put(body, "tick", control_count(now.tick)) && good;
    good = control_put(body, "tick_s", control_seconds(control->rig->tick_ns)) && good;
    good = control_put(body, "time_s", control_seconds(now.time_ns)) && good;
    good = control_put(body, "elapsed_s", control_seconds(now.elapsed_ns)) && good;
    good = control_put(body, "overruns", control_count(now.overruns)) && good;
    good = control_put(body, "lost_ticks", control_count(now.lost_ticks)) && good;

    /* Its parts; loads are means since this client asked last */
    good = control_put(body, "buses",
                       status_buses(control, &now, client->seen ? &client->before : &start)) &&
           good;
    good = control_put(body, "joints", status_joints(control, &now)) && good;
    good = control_put(body, "contacts", status_contacts(control, &now)) && good;
    good = control_put(body, "faults", status_faults(control, &now)) && good;
    good = control_put(body, "external", status_external(control, &now)) && good;
    good = control_put(body, "control", status_control(control)) && good;
    client->before = now;
    client->seen = true;
    return control_whole_or_null(body, good);
}

/* ---- statistics ---- */

/* Converts ns to a number of us. */
static json_t *control_microseconds(int64_t ns)
{
    return control_number((double)ns * 1e-3);
}

/* Makes count and percentiles of a histogram, from a copy since the loop goes on writing. */
static json_t *statistics_histogram(struct control *control, const struct histogram *of)
{
    struct histogram *copy = &control->histogram;
    json_t *body = json_object();
    bool good;

    histogram_copy(of, copy);
    good = control_put(body, "count", control_count(copy->count));
    good = control_put(body, "min_us", control_microseconds(copy->min)) && good;
    good = control_put(body, "median_us", control_microseconds(histogram_percentile(copy, 0.5))) &&
           good;
    good =
        control_put(body, "p99_us", control_microseconds(histogram_percentile(copy, 0.99))) && good;
    good = control_put(body, "max_us", control_microseconds(copy->max)) && good;
    good = control_put(body, "mean_us",
                       control_number(copy->count ? (double)copy->sum * 1e-3 / (double)copy->count
                                                  : 0.0)) &&
           good;
    return control_whole_or_null(body, good);
}

/* Makes the durations of each phase. */
static json_t *statistics_phases(struct control *control, const struct loop_stats *stats)
{
    json_t *object = json_object();
    bool good = object != NULL;

    for (int p = 0; p < PHASE_COUNT && good; p++) {
        good = control_put(object, loop_phase_name((enum loop_phase)p),
                           statistics_histogram(control, &stats->phase[p]));
    }
    return control_whole_or_null(object, good);
}

/* Makes the overruns by phase. */
static json_t *statistics_overruns(const struct simulator_status *now)
{
    json_t *object = json_object();
    bool good = object != NULL;

    for (int p = 0; p < PHASE_COUNT && good; p++) {
        good = control_put(object, loop_phase_name((enum loop_phase)p),
                           control_count(now->overruns_by[p]));
    }
    return control_whole_or_null(object, good);
}

/* Makes the counters of lockstep. */
static json_t *statistics_lockstep(const struct simulator_status *now)
{
    json_t *object = json_object();
    bool good = control_put(object, "steps", control_count(now->lockstep.steps));

    good = control_put(object, "mismatches", control_count(now->lockstep.mismatches)) && good;
    good = control_put(object, "malformed", control_count(now->lockstep.malformed)) && good;
    good = control_put(object, "silences", control_count(now->lockstep.silences)) && good;
    return control_whole_or_null(object, good);
}

json_t *control_statistics(struct control *control)
{
    const struct loop_stats *stats = simulator_stats(control->config.simulator);
    struct simulator_status now = {0};
    json_t *body = json_object();
    bool good = body != NULL;

    simulator_read(control->config.simulator, &now);
    good = control_put(body, "tick", control_count(now.tick)) && good;
    good = control_put(body, "time_s", control_seconds(now.time_ns)) && good;
    good = control_put(body, "phases", statistics_phases(control, stats)) && good;
    good = control_put(body, "work", statistics_histogram(control, &stats->work)) && good;
    good = control_put(body, "wakeup", statistics_histogram(control, &stats->wakeup)) && good;
    good = control_put(body, "overruns", control_count(now.overruns)) && good;
    good = control_put(body, "overruns_by", statistics_overruns(&now)) && good;
    good = control_put(body, "late_ticks", control_count(now.late_ticks)) && good;
    good = control_put(body, "lost_ticks", control_count(now.lost_ticks)) && good;
    good = control_put(body, "pauses", control_count(now.pauses)) && good;
    good = control_put(body, "pause_ticks", control_count(now.pause_ticks)) && good;
    good = control_put(body, "events_lost", control_count(now.events_lost)) && good;
    good = control_put(body, "lockstep", statistics_lockstep(&now)) && good;
    return control_whole_or_null(body, good);
}

/* ---- lists ---- */

json_t *control_tunable(const struct control *control, size_t index)
{
    const struct tunable *tunable = requests_tunable(control->config.requests, index);
    json_t *body = json_object();
    bool good = control_put(body, "name", control_text(tunable->name));

    good = control_put(body, "value",
                       control_number(requests_value(control->config.requests, index))) &&
           good;
    good = control_put(body, "unit", control_text(tunable->unit)) && good;
    good = control_put(body, "min", control_number(tunable->min)) && good;
    good = control_put(body, "max", control_number(tunable->max)) && good;
    good = control_put(body, "whole", json_boolean(tunable->whole)) && good;
    return control_whole_or_null(body, good);
}

/* Checks whether a request's pattern, if it has one, matches a name. */
static bool list_wants_name(const struct control_request *request, const char *name)
{
    return !request->match || control_matches(request->match, name);
}

/* Makes the list of tunables with value, unit and range. */
static json_t *answer_list_tunables(const struct control *control,
                                    const struct control_request *request)
{
    json_t *array = json_array();
    bool good = array != NULL;

    for (size_t i = 0; i < requests_tunables(control->config.requests) && good; i++) {
        good = !list_wants_name(request, requests_tunable(control->config.requests, i)->name) ||
               control_append(array, control_tunable(control, i));
    }
    return control_whole_or_null(array, good);
}

/* Makes the list of faults, active or not. */
static json_t *answer_list_faults(const struct control *control,
                                  const struct control_request *request)
{
    const struct faults *faults = simulator_faults(control->config.simulator);
    struct simulator_status now = {0};
    json_t *array = json_array();
    bool good = array != NULL;

    simulator_read(control->config.simulator, &now);
    for (size_t i = 0; i < faults_count(faults) && good; i++) {
        const struct fault *fault = faults_at(faults, i);
        json_t *entry;

        if (!list_wants_name(request, fault->name)) {
            continue;
        }
        entry = json_object();
        good = control_put(entry, "name", control_text(fault->name)) && good;
        good = control_put(entry, "line", control_text(fault->text)) && good;
        good = control_put(entry, "active", json_boolean(fault_is_active(&now, i))) && good;
        good = control_append(array, entry) && good;
    }
    return control_whole_or_null(array, good);
}

/* Appends a name to a list if the request asks for it; false = no memory. */
static bool answer_append_name(json_t *array, const struct control_request *request,
                               const char *name)
{
    return !list_wants_name(request, name) || control_append(array, control_text(name));
}

/* Makes the list of bodies: the robot's, then free ones. */
static json_t *answer_list_bodies(const struct control *control,
                                  const struct control_request *request)
{
    const struct rig *rig = control->rig;
    json_t *array = json_array();
    bool good = array != NULL;

    for (size_t i = 0; i < rig->robot->nbody && good; i++) {
        good = answer_append_name(array, request, rig->robot->body[i].name);
    }
    for (size_t i = 0; i < rig->nfree && good; i++) {
        good = answer_append_name(array, request, rig->free[i].name);
    }
    return control_whole_or_null(array, good);
}

/* Makes the list of signals that can be subscribed to. */
static json_t *answer_list_signals(const struct control *control,
                                   const struct control_request *request)
{
    const char *const *name = simulator_signal_names(control->config.simulator);
    json_t *array = json_array();
    bool good = array != NULL;

    for (size_t i = 0; i < simulator_signals(control->config.simulator) && good; i++) {
        good = answer_append_name(array, request, name[i]);
    }
    return control_whole_or_null(array, good);
}

/* Makes the list of checkpoint slots that are in use; slot 0 is the start. */
static json_t *answer_list_checkpoints(const struct control *control)
{
    json_t *array = json_array();
    bool good = array != NULL;

    for (int i = 0; i < CHECKPOINT_SLOTS && good; i++) {
        const struct request_answer *of = &control->slot[i];
        json_t *entry;

        if (i > 0 && of->ticket == 0) {
            continue;
        }
        entry = json_object();
        good = control_put(entry, "slot", json_integer(i)) && good;
        good = control_put(entry, "tick", control_count(of->tick)) && good;
        good = control_put(entry, "time_s", control_seconds(of->time_ns)) && good;
        good = control_append(array, entry) && good;
    }
    return control_whole_or_null(array, good);
}

/* Makes the list of commands. */
static json_t *answer_list_commands(const struct control_request *request)
{
    json_t *array = json_array();
    bool good = array != NULL;

    for (int i = 0; i < CONTROL_COMMANDS && good; i++) {
        good = answer_append_name(array, request, control_command_name((enum control_command)i));
    }
    return control_whole_or_null(array, good);
}

json_t *control_list(const struct control *control, const struct control_request *request)
{
    json_t *body = json_object(), *list = NULL;

    switch (request->list) {
    case CONTROL_LIST_TUNABLES:
        list = answer_list_tunables(control, request);
        break;
    case CONTROL_LIST_FAULTS:
        list = answer_list_faults(control, request);
        break;
    case CONTROL_LIST_BODIES:
        list = answer_list_bodies(control, request);
        break;
    case CONTROL_LIST_SIGNALS:
        list = answer_list_signals(control, request);
        break;
    case CONTROL_LIST_CHECKPOINTS:
        list = answer_list_checkpoints(control);
        break;
    case CONTROL_LIST_COMMANDS:
    case CONTROL_LISTS:
        list = answer_list_commands(request);
        break;
    }
    return control_whole_or_null(body, control_put(body, control_list_name(request->list), list));
}
