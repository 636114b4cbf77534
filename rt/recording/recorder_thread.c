/* SPDX-License-Identifier: Apache-2.0 */
/* Formats and writes the contents of the recorder's rings in a separate thread. */
#include "rt/recording/recorder_mcap.h"

#include "canbus/candump.h"
#include "rt/clock.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum {
    ROUND = 4096, /* items written between two checks of the files */
    IDLE_NS = 2000000,
};

#define TEND_NS (250 * CLOCK_MS)

/* ---- rows ---- */

/* Writes a line of a CSV file: the row's time (s), then `count` values. */
static void recorder_write_values(struct recorder *recorder, enum recorder_file file,
                                  double time_ns, const double *value, size_t count)
{
    char *line = recorder->line;
    size_t size = (size_t)sprintf(line, "%.6f", time_ns * 1e-9);

    for (size_t i = 0; i < count; i++) {
        size += (size_t)sprintf(line + size, ",%.9g", value[i]);
    }
    line[size++] = '\n';
    line_file_put(&recorder->file[file], line, size);
}

/* ---- events ---- */

/* Writes the first `count` of the waiting events to events.log and to the MCAP file. */
static void recorder_release_events(struct recorder *recorder, size_t count)
{
    struct recorder_order *order = &recorder->order;

    for (size_t i = 0; i < count; i++) {
        const struct event_item *item = &order->item[i];
        int size =
            snprintf(recorder->line, RECORDER_LINE, "%.6f %s %s\n", (double)item->time_ns * 1e-9,
                     journal_priority_name(item->priority), item->text);

        line_file_put(&recorder->file[FILE_EVENTS], recorder->line, (size_t)size);
        if (recorder->mcap) {
            recorder_mcap_event(recorder->mcap, item);
        }
    }
    order->count -= count;
    memmove(order->item, order->item + count, order->count * sizeof *order->item);
}

/* Inserts an event in order into the list of waiting events. A full list first writes its older
 * half. */
static void recorder_hold_event(struct recorder *recorder, const struct event_item *item)
{
    struct recorder_order *order = &recorder->order;
    size_t at;

    if (order->count == RECORDER_HELD) {
        recorder_release_events(recorder, RECORDER_HELD / 2);
    }
    /* Find its place: before later events, and before events of the same time with a higher rank */
    for (at = order->count; at > 0; at--) {
        const struct event_item *other = &order->item[at - 1];

        if (item->time_ns > other->time_ns ||
            (item->time_ns == other->time_ns && item->rank >= other->rank)) {
            break;
        }
        order->item[at] = *other;
    }
    order->item[at] = *item;
    order->count++;
}

/* ---- the thread ---- */

/* Writes up to a round of items from each ring; false = all rings were empty. An item leaves its
 * ring after it is written. The items that a hung thread leaves behind are therefore counted. */
static bool recorder_drain_rings(struct recorder *recorder)
{
    const struct frame_item *frame;
    const void *item;
    int count = 0;

    for (; count < ROUND && (frame = ring_front(&recorder->frames)); count++) {
        size_t size =
            candump_format(&frame->frame, recorder->config.bus[frame->bus], recorder->line);

        line_file_put(&recorder->file[FILE_FRAMES], recorder->line, size);
        if (recorder->mcap) {
            recorder_mcap_frame(recorder->mcap, frame);
        }
        ring_drop(&recorder->frames);
    }
    for (; count < 2 * ROUND && (item = ring_front(&recorder->rows)); count++) {
        /* Write a row to the files that hold signals and poses */
        const struct recorder_config *config = &recorder->config;
        const double *row = item;

        if (recorder->has[FILE_SIGNALS]) {
            recorder_write_values(recorder, FILE_SIGNALS, row[0], row + 1, config->nsignal);
        }
        if (recorder->has[FILE_POSES]) {
            recorder_write_values(recorder, FILE_POSES, row[0], row + 1 + config->nsignal,
                                  RECORDER_POSE * config->nbody);
        }
        if (recorder->mcap) {
            recorder_mcap_row(recorder->mcap, row);
        }

        ring_drop(&recorder->rows);
    }
    for (; count < 3 * ROUND && (item = ring_front(&recorder->events)); count++) {
        recorder_hold_event(recorder, item);
        ring_drop(&recorder->events);
    }
    return count > 0;
}

/* Advances the beat. A few times a second, flushes the files and checks that they still exist. */
static void recorder_tend_files(struct recorder *recorder)
{
    struct recorder_order *order = &recorder->order;
    int64_t now = clock_now(clock_monotonic());
    size_t due = 0;

    atomic_fetch_add_explicit(&recorder->beat, 1, memory_order_relaxed);
    if (now < recorder->tend_ns) {
        return;
    }
    recorder->tend_ns = now + TEND_NS;
    /* Write events that waited at the previous call, and new events with earlier times */
    while (due < order->count && order->item[due].time_ns <= order->settled_ns) {
        due++;
    }
    recorder_release_events(recorder, due);
    order->settled_ns = order->count ? order->item[order->count - 1].time_ns : INT64_MIN;
    if (recorder->mcap) {
        recorder_mcap_tend(recorder->mcap, now);
    }
    for (int f = 0; f < RECORDER_FILES; f++) {
        line_file_flush(&recorder->file[f]);
        line_file_look(&recorder->file[f]);
    }
}

static void recorder_thread_ended(void *context)
{
    atomic_store(&((struct recorder *)context)->ended, true);
}

void *recorder_thread_main(void *context)
{
    struct recorder *recorder = context;
    sigset_t of_writing;

    /* Block signals, so that a pipe without a reader or a file at its size limit makes write()
     * fail */
    sigemptyset(&of_writing);
    sigaddset(&of_writing, SIGPIPE);
    sigaddset(&of_writing, SIGXFSZ);
    pthread_sigmask(SIG_BLOCK, &of_writing, NULL);
    pthread_cleanup_push(recorder_thread_ended, recorder);
    if (recorder->mcap) {
        recorder_mcap_start(recorder->mcap);
    }
    /* Write until the recorder stops, then write the rest */
    while (!atomic_load(&recorder->stop)) {
        if (!recorder_drain_rings(recorder)) {
            nanosleep(&(struct timespec){.tv_nsec = IDLE_NS}, NULL);
        }
        recorder_tend_files(recorder);
    }
    while (recorder_drain_rings(recorder)) {
        recorder_tend_files(recorder);
    }
    /* Write the remaining events, end the MCAP file, and close all files */
    recorder_release_events(recorder, recorder->order.count);
    if (recorder->mcap) {
        recorder_mcap_finish(recorder->mcap);
    }
    for (int f = 0; f < RECORDER_FILES; f++) {
        line_file_look(&recorder->file[f]);
        line_file_close(&recorder->file[f]);
    }
    pthread_cleanup_pop(1);
    return NULL;
}
