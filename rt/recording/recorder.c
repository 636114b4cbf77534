/* SPDX-License-Identifier: Apache-2.0 */
/* Opens the recorder's rings and files, fills the rings from the loop, reports problems, and
 * closes. */
#include "rt/recording/recorder_mcap.h"

#include "base/input_file.h"
#include "base/whole_file.h"
#include "canbus/candump.h"
#include "rt/clock.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum {
    FRAME_RING = 65536, /* about one second of a fully loaded rig */
    ROW_RING = 1024,
    EVENT_RING = 1024,
    WAIT_NS = 100000, /* interval at which a waiting loop checks a ring for room */
};

/* A cancelled thread that runs longer than this hangs in a system call. */
#define CANCEL_NS (5 * CLOCK_SECOND)

const struct word recorder_format_words[] = {{"csv", RECORDER_CSV},
                                             {"mcap", RECORDER_MCAP},
                                             {"both", RECORDER_CSV | RECORDER_MCAP},
                                             {NULL, 0}};

static int64_t recorder_clock_now(void)
{
    return clock_now(clock_monotonic());
}

/* Sleeps for less than a second. */
static void recorder_nap(int64_t ns)
{
    nanosleep(&(struct timespec){.tv_nsec = ns}, NULL);
}

/* ---- opening ---- */

/* Sets *empty; false = the directory cannot be read (errno). */
static bool directory_is_empty(const char *directory, bool *empty)
{
    DIR *stream = opendir(directory);
    const struct dirent *entry;

    if (!stream) {
        return false;
    }
    *empty = true;
    while ((entry = readdir(stream))) {
        if (strcmp(entry->d_name, ".") && strcmp(entry->d_name, "..")) {
            *empty = false;
        }
    }
    closedir(stream);
    return true;
}

/* Creates the directory, or checks that an existing one may be written: it is empty, or `overwrite`
 * is set. */
static enum error_code recorder_prepare_directory(const struct recorder_config *config, bool *made,
                                                  struct error *error)
{
    enum error_code code = folder_make(config->directory, made, error);
    bool empty = false;

    if (code || *made) {
        return code;
    }
    if (!directory_is_empty(config->directory, &empty)) {
        return error_set_errno(error, errno, "cannot record into %s", config->directory);
    }
    if (!empty && !config->overwrite) {
        return error_set(error, ERROR_INPUT,
                         "%s is not empty: expected a new or empty directory, or --force to "
                         "overwrite the recording in it",
                         config->directory);
    }
    return ERROR_NONE;
}

/* Returns the title line of a CSV file: the time, then each of `count` names with each ending; NULL
 * = out of memory. */
static const char *recorder_make_title(const char *const *name, size_t count,
                                       const char *const *ending, size_t nending,
                                       struct arena *arena)
{
    size_t size = sizeof "time_s\n", used;
    char *title;

    for (size_t i = 0; i < count * nending; i++) {
        size += 1 + strlen(name[i / nending]) + strlen(ending[i % nending]);
    }
    title = arena_alloc(arena, size, 1);
    if (!title) {
        return NULL;
    }
    used = (size_t)sprintf(title, "time_s");
    for (size_t i = 0; i < count * nending; i++) {
        used += (size_t)sprintf(title + used, ",%s%s", name[i / nending], ending[i % nending]);
    }
    strcpy(title + used, "\n");
    return title;
}

/* Allocates the recorder with its rings and buffers; NULL = out of memory. */
static struct recorder *recorder_allocate(const struct recorder_config *config, struct arena *arena)
{
    struct recorder *made = arena_alloc(arena, 1, sizeof *made);
    uint32_t count = config->frame_ring ? (uint32_t)config->frame_ring : FRAME_RING;
    size_t nvalue = config->nsignal + RECORDER_POSE * config->nbody;
    size_t row_size = (1 + nvalue) * sizeof(double);
    void *frames = arena_alloc(arena, count, sizeof(struct frame_item));
    void *rows = arena_alloc(arena, ROW_RING, row_size);
    void *events = arena_alloc(arena, EVENT_RING, sizeof(struct event_item));
    struct event_item *held = arena_alloc(arena, RECORDER_HELD, sizeof *held);
    double *row = arena_alloc(arena, 1, row_size);
    char *line = arena_alloc(arena, RECORDER_LINE + (1 + nvalue) * RECORDER_NUMBER, 1);

    if (!made || !frames || !rows || !events || !held || !row || !line) {
        return NULL;
    }
    made->config = *config;
    made->config.format = config->format ? config->format : RECORDER_CSV;
    made->config.stall_ns = config->stall_ns ? config->stall_ns : RECORDER_STALL_NS;
    for (int f = 0; f < RECORDER_FILES; f++) {
        made->file[f].descriptor = -1;
    }
    made->nvalue = nvalue;
    made->row = row;
    made->line = line;
    made->order = (struct recorder_order){.item = held, .settled_ns = INT64_MIN};
    ring_init(&made->frames, frames, sizeof(struct frame_item), count);
    ring_init(&made->rows, rows, row_size, ROW_RING);
    ring_init(&made->events, events, sizeof(struct event_item), EVENT_RING);
    return made;
}

/* Removes the summary of the old recording. It must not remain beside the new files, even if the
 * new recording fails. */
static enum error_code recorder_remove_summary(const char *directory, struct error *error)
{
    char path[LINE_FILE_PATH];
    enum error_code code;
    struct stat there;

    snprintf(path, sizeof path, "%s/" RECORDER_SUMMARY, directory);
    if (!stat(path, &there) && (code = input_file_check_output(path, &there, error))) {
        return code;
    }
    if (unlink(path) && errno != ENOENT) {
        return error_set_errno(error, errno, "cannot remove %s of an earlier recording", path);
    }
    return ERROR_NONE;
}

/* Opens one file of the recording and writes its title. Fails if title is NULL (out of memory). */
static enum error_code recorder_open_file(struct recorder *recorder, enum recorder_file file,
                                          const char *title, size_t longest, struct arena *arena,
                                          struct error *error)
{
    static const char *const name[RECORDER_FILES] = {
        [FILE_FRAMES] = "candump.log", [FILE_SIGNALS] = "signals.csv", [FILE_POSES] = "poses.csv",
        [FILE_EVENTS] = "events.log",  [FILE_MCAP] = "recording.mcap",
    };
    enum error_code code;

    if (!title) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder");
    }
    code = line_file_open(&recorder->file[file], recorder->config.directory, name[file], title,
                          longest, &recorder->beat, arena, error);
    recorder->has[file] = !code;
    return code;
}

/* Writes a piece of the MCAP file to its line_file. */
static void recorder_put_mcap(void *context, const void *bytes, size_t size)
{
    struct recorder *recorder = context;

    line_file_put(&recorder->file[FILE_MCAP], bytes, size);
}

/* Creates the MCAP writer and its file. The file stores each piece as one record. */
static enum error_code recorder_open_mcap(struct recorder *recorder, struct arena *arena,
                                          struct error *error)
{
    enum error_code code = recorder_mcap_create(&recorder->config, recorder_put_mcap, recorder,
                                                arena, &recorder->mcap, error);

    if (!code) {
        code = recorder_open_file(recorder, FILE_MCAP, "", recorder_mcap_longest(recorder->mcap),
                                  arena, error);
        recorder->file[FILE_MCAP].records = true;
    }
    return code;
}

/* Opens all files of the configuration. */
static enum error_code recorder_open_files(struct recorder *recorder, struct arena *arena,
                                           struct error *error)
{
    static const char *const plain[] = {""};
    static const char *const pose[RECORDER_POSE] = {"_x_m", "_y_m", "_z_m", "_qw",
                                                    "_qx",  "_qy",  "_qz"};
    const struct recorder_config *config = &recorder->config;
    size_t longest = (1 + recorder->nvalue) * RECORDER_NUMBER;
    const char *signals = recorder_make_title(config->signal, config->nsignal, plain, 1, arena);
    const char *poses =
        recorder_make_title(config->body, config->nbody, pose, RECORDER_POSE, arena);
    enum error_code code;

    /* Frames and events are always recorded; rows in the chosen formats */
    code = recorder_open_file(recorder, FILE_FRAMES, "", CANDUMP_LINE_MAX, arena, error);
    if (!code && config->format & RECORDER_CSV) {
        code = recorder_open_file(recorder, FILE_SIGNALS, signals, longest, arena, error);
    }
    if (!code && config->format & RECORDER_CSV && config->nbody) {
        code = recorder_open_file(recorder, FILE_POSES, poses, longest, arena, error);
    }
    if (!code && config->format & RECORDER_MCAP) {
        code = recorder_open_mcap(recorder, arena, error);
    }
    return code ? code : recorder_open_file(recorder, FILE_EVENTS, "", RECORDER_LINE, arena, error);
}

/* Removes the files, and the directory if this recorder created it. Call it only when no thread
 * writes the files. */
static void recorder_remove_files(struct recorder *recorder)
{
    recorder_mcap_destroy(recorder->mcap);
    recorder->mcap = NULL;
    for (int f = 0; f < RECORDER_FILES; f++) {
        if (recorder->has[f]) {
            line_file_remove(&recorder->file[f]);
        }
    }
    if (recorder->made_directory) {
        rmdir(recorder->config.directory);
    }
}

enum error_code recorder_open(const struct recorder_config *config, struct arena *arena,
                              struct recorder **recorder, struct error *error)
{
    struct recorder *made = recorder_allocate(config, arena);
    enum error_code code;
    int reason;

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder");
    }
    /* Prepare the directory and remove an earlier summary, then open the files */
    code = recorder_prepare_directory(config, &made->made_directory, error);
    if (code) {
        goto fail;
    }
    code = recorder_remove_summary(config->directory, error);
    if (code) {
        goto fail;
    }
    code = recorder_open_files(made, arena, error);
    if (code) {
        goto fail;
    }
    /* Start the thread last, because it writes at once */
    reason = pthread_create(&made->thread, NULL, recorder_thread_main, made);
    if (reason) {
        code = error_set_errno(error, reason, "cannot start the recorder's thread");
        goto fail;
    }
    *recorder = made;
    return ERROR_NONE;

fail:
    recorder_remove_files(made);
    return code;
}

/* ---- the loop's side ---- */

/* Checks whether the writing thread has made no progress for timeout_ns. *beat and *since_ns keep
 * state between calls. */
static bool recorder_thread_stalled(const struct recorder *recorder, int64_t timeout_ns,
                                    uint64_t *beat, int64_t *since_ns)
{
    uint64_t now_at = atomic_load_explicit(&recorder->beat, memory_order_relaxed);
    int64_t now = recorder_clock_now();

    if (now_at != *beat) {
        *beat = now_at;
        *since_ns = now;
    }
    return now - *since_ns > timeout_ns;
}

/* Waits for room in a ring and pushes the item; false = the disk was given up. */
static bool recorder_wait_for_room(struct recorder *recorder, struct ring *ring, const void *item)
{
    uint64_t beat = atomic_load_explicit(&recorder->beat, memory_order_relaxed);
    int64_t since = recorder_clock_now();

    while (!ring_push(ring, item)) {
        if (recorder_thread_stalled(recorder, recorder->config.stall_ns, &beat, &since)) {
            atomic_store(&recorder->given_up, true);
            return false;
        }
        recorder_nap(WAIT_NS);
    }
    return true;
}

/* Pushes an item into a ring and counts it as accepted or dropped. Waits for room only if
 * lossless. */
static void recorder_push(struct recorder *recorder, struct ring *ring, const void *item,
                          _Atomic uint64_t *taken, _Atomic uint64_t *dropped)
{
    bool pushed = !atomic_load_explicit(&recorder->given_up, memory_order_relaxed) &&
                  (ring_push(ring, item) ||
                   (recorder->config.lossless && recorder_wait_for_room(recorder, ring, item)));
    _Atomic uint64_t *count = pushed ? taken : dropped;

    /* Each count has one writing thread, so an atomic increment is not needed */
    atomic_store_explicit(count, atomic_load_explicit(count, memory_order_relaxed) + 1,
                          memory_order_relaxed);
}

void recorder_frame(struct recorder *recorder, size_t bus, const struct bus_frame *frame,
                    int64_t time_ns)
{
    struct frame_item item = {.frame = *frame, .bus = (uint32_t)bus};

    item.frame.time_ns = time_ns;
    recorder_push(recorder, &recorder->frames, &item, &recorder->tally.frames,
                  &recorder->tally.frames_dropped);
}

void recorder_row(struct recorder *recorder, int64_t time_ns, const double *value)
{
    recorder->row[0] = (double)time_ns;
    memcpy(recorder->row + 1, value, recorder->nvalue * sizeof *value);
    recorder_push(recorder, &recorder->rows, recorder->row, &recorder->tally.rows,
                  &recorder->tally.rows_dropped);
}

void recorder_event(struct recorder *recorder, int64_t time_ns, unsigned rank,
                    enum journal_priority priority, const char *text)
{
    struct event_item item = {.time_ns = time_ns, .rank = rank, .priority = priority};

    strncpy(item.text, text, sizeof item.text - 1);
    recorder_push(recorder, &recorder->events, &item, &recorder->tally.events,
                  &recorder->tally.events_dropped);
}

/* ---- reports of what went wrong ---- */

/* Writes a sentence about a file that has ended or was renamed. Reports each problem once; false =
 * nothing new. */
static bool recorder_file_event(const struct line_file *file, struct file_reports *reports,
                                char *text, size_t size)
{
    if (atomic_load(&file->ended) && !reports->ended) {
        reports->ended = true;
        snprintf(text, size, "%s", file->error.text);
        return true;
    }
    if (atomic_load(&file->moved) && !reports->moved) {
        reports->moved = true;
        snprintf(text, size, "%s has another name now: recording goes on in the same file",
                 file->path);
        return true;
    }
    return false;
}

/* Writes a sentence about dropped items, at most once a second; false = nothing new. */
static bool recorder_drop_event(struct recorder *recorder, char *text, size_t size)
{
    struct recorder_tally *tally = &recorder->tally;
    uint64_t frames = atomic_load_explicit(&tally->frames_dropped, memory_order_relaxed);
    uint64_t rows = atomic_load_explicit(&tally->rows_dropped, memory_order_relaxed);
    uint64_t events = atomic_load_explicit(&tally->events_dropped, memory_order_relaxed);
    int64_t now = recorder_clock_now();

    if (frames + rows + events == recorder->drops_reported ||
        (recorder->drops_reported && now - recorder->drops_reported_ns < CLOCK_SECOND)) {
        return false;
    }
    recorder->drops_reported = frames + rows + events;
    recorder->drops_reported_ns = now;
    snprintf(text, size,
             "the disk does not keep up with the recording: %" PRIu64 " frames, %" PRIu64
             " rows and %" PRIu64 " events dropped until now",
             frames, rows, events);
    return true;
}

bool recorder_next_event(struct recorder *recorder, unsigned *kind, char *text, size_t size)
{
    for (unsigned f = 0; f < RECORDER_FILES; f++) {
        if (recorder_file_event(&recorder->file[f], &recorder->reports[f], text, size)) {
            *kind = f;
            return true;
        }
    }
    if (atomic_load(&recorder->given_up) && !recorder->given_up_reported) {
        recorder->given_up_reported = true;
        *kind = REPORT_GIVEN_UP;
        snprintf(text, size,
                 "the disk of %s took nothing for %.1f s: recording ends here, the run goes on",
                 recorder->config.directory, (double)recorder->config.stall_ns * 1e-9);
        return true;
    }
    *kind = REPORT_DROPS;
    return recorder_drop_event(recorder, text, size);
}

/* ---- the end ---- */

/* Waits until the writing thread ends; false = it hangs. */
static bool recorder_wait_for_thread(const struct recorder *recorder, int64_t timeout_ns)
{
    uint64_t beat = atomic_load_explicit(&recorder->beat, memory_order_relaxed);
    int64_t since = recorder_clock_now();

    while (!atomic_load(&recorder->ended)) {
        if (recorder_thread_stalled(recorder, timeout_ns, &beat, &since)) {
            return false;
        }
        recorder_nap(WAIT_NS);
    }
    return true;
}

/* Joins the ended thread and frees the MCAP writer. */
static void recorder_join_thread(struct recorder *recorder)
{
    pthread_join(recorder->thread, NULL);
    recorder_mcap_destroy(recorder->mcap);
    recorder->mcap = NULL;
}

/* Ends the writing thread. A thread that hangs in a system call is cancelled. It ends when the call
 * returns, before it touches the recorder again. */
static void recorder_end_thread(struct recorder *recorder, struct recorder_counters *counters)
{
    int64_t stall = recorder->config.stall_ns;

    /* Stop the thread; wait a shorter time if the disk was given up */
    atomic_store(&recorder->stop, true);
    if (recorder_wait_for_thread(recorder, atomic_load(&recorder->given_up) ? stall / 10 : stall)) {
        recorder_join_thread(recorder);
        return;
    }
    /* The thread hangs: cancel it, or abandon it */
    pthread_cancel(recorder->thread);
    if (recorder_wait_for_thread(recorder, CANCEL_NS)) {
        recorder_join_thread(recorder);
        for (int f = 0; f < RECORDER_FILES; f++) {
            line_file_abandon(&recorder->file[f]);
        }
    } else {
        pthread_detach(recorder->thread);
    }
    counters->frames_unwritten = ring_count(&recorder->frames);
    counters->rows_unwritten = ring_count(&recorder->rows);
    counters->events_unwritten = ring_count(&recorder->events) + recorder->order.count;
}

enum error_code recorder_close(struct recorder *recorder, struct recorder_counters *counters,
                               struct error *error)
{
    struct recorder_counters *c = counters;

    *c = (struct recorder_counters){0};
    recorder_end_thread(recorder, c);

    /* Count the items accepted by each ring and the items missing in each file */
    const struct line_file *file = recorder->file;

    c->frames = atomic_load(&recorder->tally.frames);
    c->rows = atomic_load(&recorder->tally.rows);
    c->events = atomic_load(&recorder->tally.events);
    c->frames_dropped = atomic_load(&recorder->tally.frames_dropped);
    c->rows_dropped = atomic_load(&recorder->tally.rows_dropped);
    c->events_dropped = atomic_load(&recorder->tally.events_dropped);
    c->frames_unwritten += file[FILE_FRAMES].unwritten;
    c->rows_unwritten += file[FILE_SIGNALS].unwritten;
    c->events_unwritten += file[FILE_EVENTS].unwritten;

    /* Report the first file that ended early; if there is none, report the drops */
    for (int f = 0; f < RECORDER_FILES; f++) {
        if (atomic_load(&recorder->file[f].ended)) {
            *error = recorder->file[f].error;
            return error->code;
        }
    }
    if (c->frames_dropped + c->rows_dropped + c->events_dropped + c->frames_unwritten +
        c->rows_unwritten + c->events_unwritten) {
        return error_set(
            error, ERROR_SYSTEM,
            "the recording in %s is not whole: of %" PRIu64 " frames, %" PRIu64 " rows and %" PRIu64
            " events %" PRIu64 ", %" PRIu64 " and %" PRIu64
            " were dropped, because the disk did not keep up",
            recorder->config.directory, c->frames + c->frames_dropped, c->rows + c->rows_dropped,
            c->events + c->events_dropped, c->frames_dropped + c->frames_unwritten,
            c->rows_dropped + c->rows_unwritten, c->events_dropped + c->events_unwritten);
    }
    return ERROR_NONE;
}

void recorder_discard(struct recorder *recorder)
{
    struct recorder_counters counters = {0};

    recorder_end_thread(recorder, &counters);
    recorder_remove_files(recorder);
}
