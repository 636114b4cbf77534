/* SPDX-License-Identifier: Apache-2.0 */
/* Plays a recording; each client has its own time in it. */
#include "viewer/private.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

/* TRACE_SPAN_NS: after a jump, the client gets the frames of this time before the target; for
 * COMAN, they fit in VIEWER_TRACE. LOAD_SPAN_NS: averaging time of bus loads. */
#define TRACE_SPAN_NS (CLOCK_SECOND / 5)
#define LOAD_SPAN_NS CLOCK_SECOND

enum { RECORDING_PATH = 4096 };

/* ---- opening ---- */

/* Makes the path of a file of the recording; returns false if it is too long. */
static bool recording_path(const struct recording *recording, const char *name,
                           char path[RECORDING_PATH])
{
    return snprintf(path, RECORDING_PATH, "%s/%s", recording->config.directory, name) <
           RECORDING_PATH;
}

/* Opens signals.csv, which must exist, and poses.csv. */
static enum error_code recording_open_rows(struct recording *recording, struct arena *arena,
                                           struct error *error)
{
    char path[RECORDING_PATH];
    enum error_code code;

    if (!recording_path(recording, "signals.csv", path)) {
        return error_set(error, ERROR_INPUT, "the name of the recording is too long");
    }
    if (access(path, R_OK)) {
        return error_set(error, ERROR_INPUT,
                         "%s: found no signals.csv that can be read, expected a recording of "
                         "\"run --record\" with --record-format csv or both",
                         recording->config.directory);
    }
    code = recorded_table_open(path, arena, &recording->signals, error);
    if (!code && recording_path(recording, "poses.csv", path)) {
        code = recorded_table_open(path, arena, &recording->poses, error);
    }
    return code;
}

/* Opens the files of frames and events, if the recording has them. */
static enum error_code recording_open_rest(struct recording *recording, struct arena *arena,
                                           struct error *error)
{
    const struct rig *rig = recording->config.rig;
    const char **bus = arena_alloc(arena, rig->nbus + 1, sizeof *bus);
    char path[RECORDING_PATH];
    enum error_code code;

    for (size_t b = 0; bus && b < rig->nbus; b++) {
        bus[b] = rig->bus[b].interface;
    }
    if (!bus || !recording_path(recording, "candump.log", path)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recording");
    }
    /* Frames and events are optional */
    code = access(path, F_OK) == 0 ? recorded_log_open(path, bus, rig->nbus, &recording->log, error)
                                   : ERROR_NONE;
    recording_path(recording, "events.log", path);
    if (!code && access(path, F_OK) == 0) {
        code = recorded_file_open(path, &recording->events, error);
    }
    return code;
}

/* Checks that the recording has each joint and each body of the rig. */
static enum error_code recording_check_rig(struct recording *recording, struct arena *arena,
                                           struct error *error)
{
    const struct rig *rig = recording->config.rig;
    const struct robot *robot = rig->robot;
    const char *missing = NULL;

    recording->angle = arena_alloc(arena, robot->njoint + 1, sizeof *recording->angle);
    if (!recording->angle) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recording");
    }
    for (size_t j = 0; j < robot->njoint && !missing; j++) {
        recording->angle[j] =
            viewer_find_column(recording->signals.title, recording->signals.ncolumn, "q_",
                               robot->joint[j].name, "_rad");
        missing = recording->angle[j] == SIZE_MAX ? robot->joint[j].name : NULL;
    }
    for (size_t i = 0; i < robot->nbody + rig->nfree && !missing; i++) {
        const char *name =
            i < robot->nbody ? robot->body[i].name : rig->free[i - robot->nbody].name;
        size_t at =
            viewer_find_column(recording->poses.title, recording->poses.ncolumn, "", name, "_x_m");

        missing = at == SIZE_MAX || at + RECORDER_POSE > recording->poses.ncolumn ? name : NULL;
    }
    return missing ? error_set(error, ERROR_INPUT,
                               "%s: found nothing of %s, expected a recording of the rig %s; "
                               "--rig names another",
                               recording->config.directory, missing, rig->name)
                   : ERROR_NONE;
}

/* Sets the shown range: the requested range, limited to the recorded range. */
static enum error_code recording_set_range(struct recording *recording, struct error *error)
{
    const struct recorded_table *rows = &recording->signals;
    const struct recording_config *config = &recording->config;
    int64_t first = rows->row[0].time_ns, last = rows->row[rows->nrow - 1].time_ns;

    recording->period_ns = rows->nrow > 1 ? (last - first) / (int64_t)(rows->nrow - 1) : CLOCK_MS;
    recording->first_ns = (int64_t)fmax((double)first, config->from_s * 1e9);
    recording->last_ns = (int64_t)fmin((double)last, config->to_s * 1e9);
    return recording->first_ns <= recording->last_ns
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%s: has nothing between %g and %g s, expected a part of %.3f to %.3f s",
                           config->directory, config->from_s, config->to_s, (double)first * 1e-9,
                           (double)last * 1e-9);
}

enum error_code recording_open(const struct recording_config *config, struct arena *arena,
                               struct recording **out, struct error *error)
{
    struct recording *recording = *out = arena_alloc(arena, 1, sizeof *recording);
    enum error_code code;

    if (!recording) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recording");
    }
    recording->config = *config;
    if ((code = recording_open_rows(recording, arena, error)) ||
        (code = recording_open_rest(recording, arena, error)) ||
        (code = recording_check_rig(recording, arena, error))) {
        return code;
    }
    return recording_set_range(recording, error);
}

void recording_close(struct recording *recording)
{
    if (recording) {
        recorded_table_close(&recording->signals);
        recorded_table_close(&recording->poses);
        recorded_log_close(&recording->log);
        recorded_file_close(&recording->events);
    }
}

double recording_duration_s(const struct recording *recording)
{
    return (double)(recording->last_ns - recording->first_ns) * 1e-9;
}

uint64_t recording_strange_frames(const struct recording *recording)
{
    return recording->log.strange;
}

enum error_code viewer_create_playback(struct viewer *viewer, struct error *error)
{
    const struct recording *recording = viewer->config.recording;
    const struct robot *robot = viewer->rig->robot;
    size_t nbody = robot->nbody + viewer->rig->nfree;
    struct playback *playback = arena_alloc(&viewer->arena, 1, sizeof *playback);

    if (playback) {
        playback->signal =
            arena_alloc(&viewer->arena, recording->signals.ncolumn + 1, sizeof(double));
        playback->pose = arena_alloc(&viewer->arena, recording->poses.ncolumn + 1, sizeof(double));
        playback->body = arena_alloc(&viewer->arena, nbody, sizeof *playback->body);
    }
    if (!playback || !playback->signal || !playback->pose || !playback->body) {
        return error_set(error, ERROR_MEMORY, "page: no memory");
    }
    for (size_t i = 0; i < nbody; i++) {
        const char *name =
            i < robot->nbody ? robot->body[i].name : viewer->rig->free[i - robot->nbody].name;

        playback->body[i] =
            viewer_find_column(recording->poses.title, recording->poses.ncolumn, "", name, "_x_m");
    }
    playback->counted_ns = INT64_MIN;
    viewer->playback = playback;
    viewer->view.signal = playback->signal;
    return ERROR_NONE;
}

/* ---- a client's time ---- */

/* Limits a time to the shown range. */
static int64_t playback_clamp(const struct viewer *viewer, double time_ns)
{
    const struct recording *recording = viewer->config.recording;

    return (int64_t)fmin(fmax(time_ns, (double)recording->first_ns), (double)recording->last_ns);
}

/* Returns a client's present time; pauses its playback at the end. */
static int64_t playback_time(const struct viewer *viewer, struct viewer_client *client)
{
    struct viewer_playback *playback = &client->playback;
    double moved = playback->speed * (double)(viewer->now_ns - playback->since_ns);
    int64_t now = playback->paused ? playback->from_ns
                                   : playback_clamp(viewer, (double)playback->from_ns + moved);

    if (now == viewer->config.recording->last_ns) {
        playback->paused = true;
        playback->from_ns = now;
    }
    return now;
}

/* Continues a client's playback from a time, with its present speed. */
static void playback_move(const struct viewer *viewer, struct viewer_client *client, double time_ns)
{
    client->playback.from_ns = playback_clamp(viewer, time_ns);
    client->playback.since_ns = viewer->now_ns;
}

void playback_begin(const struct viewer *viewer, struct viewer_client *client)
{
    const struct recording *recording = viewer->config.recording;

    client->playback =
        (struct viewer_playback){.speed = recording->config.speed, .traced_ns = INT64_MIN};
    playback_move(viewer, client, (double)recording->first_ns);
}

bool playback_obey(struct viewer *viewer, struct viewer_client *client,
                   const struct viewer_message *message, struct error *error)
{
    const struct recording *recording = viewer->config.recording;
    struct viewer_playback *playback = &client->playback;
    int64_t now = playback_time(viewer, client);

    /* Continue from the present time with the changed state */
    playback_move(viewer, client, (double)now);
    if (message->command == VIEWER_SEEK) {
        playback_move(viewer, client, message->from_s * 1e9);
        playback->traced_ns = INT64_MIN;
        return true;
    }
    switch (message->control) {
    case CONTROL_PAUSE:
        playback->paused = true;
        return true;
    case CONTROL_RESUME:
        if (now == recording->last_ns) {
            playback_move(viewer, client, (double)recording->first_ns);
            playback->traced_ns = INT64_MIN;
        }
        playback->paused = false;
        return true;
    case CONTROL_SPEED:
        if (!(message->value > 0)) {
            error_set(error, ERROR_INPUT, "speed: found 0, expected more in a recording");
            return false;
        }
        playback->speed = message->value;
        return true;
    case CONTROL_STEP:
        playback->paused = true;
        playback_move(viewer, client,
                      (double)now + (double)message->count * (double)recording->period_ns);
        return true;
    default:
        error_set(error, ERROR_UNSUPPORTED,
                  "this is a recording: it can be paused and looked through, and not changed");
        return false;
    }
}

/* ---- shown data ---- */

/* Counts frames and loads of each bus over the second before a time. */
static void playback_count_frames(struct viewer *viewer, int64_t now_ns)
{
    const struct recording *recording = viewer->config.recording;
    struct playback *playback = viewer->playback;
    struct simulator_status *status = &viewer->view.status;
    int64_t since_ns = now_ns - LOAD_SPAN_NS;

    if (!recording->log.file.data) {
        return;
    }
    if (playback->counted_ns == INT64_MIN || now_ns < playback->counted_ns ||
        now_ns - playback->counted_ns >= RECORDED_MARK_NS) {
        since_ns = since_ns > recording->log.first_ns ? since_ns : recording->log.first_ns;
        recorded_log_count(&recording->log, now_ns, playback->now);
        recorded_log_count(&recording->log, since_ns, playback->before);
        playback->counted_ns = now_ns;
        for (size_t b = 0; b < viewer->rig->nbus; b++) {
            double bits = (double)(playback->now[b].bits - playback->before[b].bits);
            double span_s = fmax((double)(now_ns - since_ns) * 1e-9, 1e-3);

            viewer->load[b] = bits / (span_s * (double)viewer->rig->bus[b].bitrate);
        }
    }
    for (size_t b = 0; b < viewer->rig->nbus; b++) {
        status->bus[b].rx_frames = playback->now[b].frames;
    }
}

void playback_view(struct viewer *viewer, struct viewer_client *client)
{
    const struct recording *recording = viewer->config.recording;
    struct simulator_status *status = &viewer->view.status;
    struct playback *playback = viewer->playback;
    int64_t now_ns = playback_time(viewer, client);
    size_t row = recorded_table_find(&recording->signals, now_ns);
    size_t pose = recorded_table_find(&recording->poses, now_ns);

    recorded_table_read(&recording->signals, row, recording->signals.ncolumn, NULL,
                        playback->signal);
    recorded_table_read(&recording->poses, pose, recording->poses.ncolumn, NULL, playback->pose);
    *status = (struct simulator_status){.tick = (uint64_t)(now_ns / viewer->rig->tick_ns),
                                        .time_ns = now_ns,
                                        .elapsed_ns = now_ns - recording->first_ns};
    for (size_t j = 0; j < viewer->rig->robot->njoint; j++) {
        status->q[j] = playback->signal[recording->angle[j]];
    }
    playback_count_frames(viewer, now_ns);
}

const double *playback_pose(const struct viewer *viewer, size_t body)
{
    return viewer->playback->pose + viewer->playback->body[body];
}

void playback_trace(struct viewer *viewer, struct viewer_client *client)
{
    const struct recording *recording = viewer->config.recording;
    struct viewer_playback *playback = &client->playback;
    int64_t now_ns = playback_time(viewer, client), from_ns = now_ns - TRACE_SPAN_NS;
    struct bus_frame frame;
    size_t at, bus;

    if (!client->watch.trace || !recording->log.file.data) {
        return;
    }
    /* Frames since the last state, but not older than TRACE_SPAN_NS */
    if (playback->traced_ns >= from_ns) {
        from_ns = playback->traced_ns + 1;
    }
    at = recorded_log_find(&recording->log, from_ns);
    while (recorded_log_next(&recording->log, &at, &bus, &frame) && frame.time_ns <= now_ns) {
        client_trace_frame(client, bus, &frame, frame.flags);
    }
    playback->traced_ns = now_ns;
}
