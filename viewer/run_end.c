/* SPDX-License-Identifier: Apache-2.0 */
/* Handles the end of a run: sends the end to the pages, serves the files of the recording, and
 * waits for open pages. */
#include "viewer/private.h"

#include "base/array.h"

#include <limits.h>
#include <stdio.h>
#include <time.h>

#define LINGER_SLICE_NS (50 * CLOCK_MS)
#define LINGER_GRACE_NS (2 * CLOCK_SECOND) /* a page that is reloaded disconnects for a moment */

/* The files that a recording may have, and their media types. */
static const struct end_file {
    const char *name, *type;
} end_files[VIEWER_FILES] = {
    {"summary.json", "application/json"},         {"events.log", "text/plain; charset=utf-8"},
    {"signals.csv", "text/csv; charset=utf-8"},   {"poses.csv", "text/csv; charset=utf-8"},
    {"candump.log", "text/plain; charset=utf-8"}, {"recording.mcap", "application/octet-stream"},
};

/* ---- the message ---- */

/* Opens the files of the recording, and lists the existing files. */
static json_t *end_open_files(struct viewer *viewer, const char *directory)
{
    json_t *list = json_array();

    for (size_t i = 0; i < ARRAY_COUNT(end_files); i++) {
        struct recorded_file *file = &viewer->file[i];
        char path[PATH_MAX];
        struct error error;
        int size = snprintf(path, sizeof path, "%s/%s", directory, end_files[i].name);

        if (size < (int)sizeof path && !recorded_file_open(path, file, &error) && file->data) {
            json_array_append_new(list, json_pack("{s:s, s:I}", "name", end_files[i].name, "bytes",
                                                  (json_int_t)file->size));
        }
    }
    return list;
}

static json_t *end_text(const char *text)
{
    return text ? control_text(text) : json_null();
}

enum error_code viewer_end(struct viewer *viewer, const struct viewer_end *end, struct error *error)
{
    json_t *files =
        end->recording && end->stays ? end_open_files(viewer, end->recording) : json_array();
    json_t *message =
        json_pack("{s:s, s:b, s:o, s:f, s:b, s:o, s:o, s:o, s:o}", "type", "end", "failed",
                  end->failed, "text", end_text(end->text), "time_s", end->time_s, "stays",
                  end->stays, "task", end_text(end->task), "task_text", end_text(end->task_text),
                  "recording", end_text(end->recording), "files", files);

    viewer->end = message ? json_dumps(message, JSON_COMPACT | JSON_REAL_PRECISION(12)) : NULL;
    json_decref(message);
    if (!viewer->end) {
        return error_set(error, ERROR_MEMORY, "page: no memory for the end of the run");
    }
    viewer->end_size = strlen(viewer->end);

    /* Make a last view, also if no client watched during the last ticks */
    if (viewer->config.simulator) {
        simulator_end_views(viewer->config.simulator);
    }
    viewer_give_order(viewer, VIEWER_ORDER_END);
    return ERROR_NONE;
}

/* ---- in the server's thread ---- */

void client_tell_end(struct viewer *viewer, struct viewer_client *client)
{
    if (client->mode != CLIENT_SOCKET || client->right == RIGHT_NONE || client->end_told) {
        return;
    }
    /* A page that connects after the end has received no event yet */
    client_send_events(viewer, client);
    if (!client_send_message(viewer, client, WEBSOCKET_TEXT, viewer->end, viewer->end_size)) {
        return;
    }
    client->end_told = true;
    if (!client->stays) {
        client_bye(viewer, client, WEBSOCKET_AWAY, "the run is over");
    }
}

bool viewer_find_file(const struct viewer *viewer, const char *name, struct viewer_file *file)
{
    for (size_t i = 0; i < ARRAY_COUNT(end_files); i++) {
        if (end_files[i].name && strcmp(name, end_files[i].name) == 0 && viewer->file[i].data) {
            *file = (struct viewer_file){end_files[i].type, viewer->file[i].data,
                                         viewer->file[i].size, false};
            return true;
        }
    }
    return false;
}

void viewer_count_staying(struct viewer *viewer)
{
    unsigned count = 0;

    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        const struct viewer_client *client = &viewer->client[i];

        count += client->socket >= 0 && client->mode == CLIENT_SOCKET && client->stays;
    }
    atomic_store(&viewer->staying, count);
}

/* ---- in the run's thread ---- */

bool viewer_is_watched(const struct viewer *viewer)
{
    return viewer && atomic_load(&viewer->staying) > 0;
}

void viewer_linger(const struct viewer *viewer, double longest_s, bool (*stopped)(void *context),
                   void *context)
{
    const struct timespec slice = {.tv_nsec = LINGER_SLICE_NS};
    struct clock *clock = clock_monotonic();
    int64_t end_ns = clock_now(clock) + (int64_t)(longest_s * 1e9), seen_ns = clock_now(clock);

    while (!stopped(context) && clock_now(clock) < end_ns) {
        if (viewer_is_watched(viewer)) {
            seen_ns = clock_now(clock);
        } else if (clock_now(clock) - seen_ns > LINGER_GRACE_NS) {
            return;
        }
        nanosleep(&slice, NULL);
    }
}
