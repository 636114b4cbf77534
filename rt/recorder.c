/* SPDX-License-Identifier: Apache-2.0 */
/* The recorder's rings and its writing thread. */
#include "rt/recorder.h"

#include "base/ring.h"
#include "canbus/candump.h"
#include "rt/clock.h"
#include "rt/line_file.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum {
    FRAME_RING = 65536, /* about a second of a fully loaded rig */
    ROW_RING = 1024,
    NUMBER_SIZE = 32, /* of a value in a row, with its comma */
    ROUND = 4096,     /* items written before the thread tends its files again */
    IDLE_NS = 2000000,
    WAIT_NS = 100000, /* the loop's, for room in a ring */
};

#define TEND_NS (250 * CLOCK_MS)
/* A system call that a signal has not ended by then hangs */
#define CANCEL_NS (5 * CLOCK_SECOND)

/* What went wrong, as reported by recorder_next_event. */
enum recorder_event { EVENT_LOG, EVENT_CSV, EVENT_DROPS, EVENT_GIVEN_UP };

struct frame_item {
    struct bus_frame frame;
    uint32_t bus;
};

/* Counted by the loop, read by any thread. */
struct recorder_tally {
    _Atomic uint64_t frames, rows, frames_dropped, rows_dropped;
};

/* What has been reported of a file. */
struct file_reports {
    bool moved, ended;
};

struct recorder {
    struct recorder_config config;
    struct ring frames, rows;
    double *row; /* the loop's scratch: time in whole ns, then the signals */
    char *line;  /* the thread's scratch, for one line of either file */
    struct recorder_tally tally;
    struct line_file log, csv;
    bool made_directory;
    pthread_t thread;
    _Atomic uint64_t beat; /* moves while the thread does */
    int64_t tend_ns;       /* when the thread flushes and checks its files again */
    atomic_bool stop, ended;
    atomic_bool given_up;

    /* Of the thread that asks for events */
    struct file_reports log_reports, csv_reports;
    bool given_up_reported;
    uint64_t drops_reported;
    int64_t drops_reported_ns;
};

static int64_t recorder_clock_now(void)
{
    return clock_now(clock_monotonic());
}

static void recorder_nap(int64_t ns)
{
    nanosleep(&(struct timespec){.tv_nsec = ns}, NULL);
}

/* ---- the writing thread ---- */

static void recorder_write_frame(struct recorder *recorder, const struct frame_item *item)
{
    size_t size = candump_format(&item->frame, recorder->config.bus[item->bus], recorder->line);

    line_file_put(&recorder->log, recorder->line, size);
}

static void recorder_write_row(struct recorder *recorder, const double *row)
{
    char *line = recorder->line;
    size_t size = (size_t)sprintf(line, "%.6f", row[0] * 1e-9);

    for (size_t i = 0; i < recorder->config.nsignal; i++) {
        size += (size_t)sprintf(line + size, ",%.9g", row[1 + i]);
    }
    line[size++] = '\n';
    line_file_put(&recorder->csv, line, size);
}

/* Writes what waits, a round of it. An item leaves its ring when it is written, so that what a hung
 * thread leaves behind is counted. False when nothing waited. */
static bool recorder_drain_rings(struct recorder *recorder)
{
    const void *item;
    int count = 0;

    for (; count < ROUND && (item = ring_front(&recorder->frames)); count++) {
        recorder_write_frame(recorder, item);
        ring_drop(&recorder->frames);
    }
    for (; count < 2 * ROUND && (item = ring_front(&recorder->rows)); count++) {
        recorder_write_row(recorder, item);
        ring_drop(&recorder->rows);
    }
    return count > 0;
}

/* Moves the beat; a few times a second flushes the files and checks that they still exist. */
static void recorder_tend_files(struct recorder *recorder)
{
    int64_t now = recorder_clock_now();

    atomic_fetch_add_explicit(&recorder->beat, 1, memory_order_relaxed);
    if (now >= recorder->tend_ns) {
        recorder->tend_ns = now + TEND_NS;
        line_file_flush(&recorder->log);
        line_file_flush(&recorder->csv);
        line_file_look(&recorder->log);
        line_file_look(&recorder->csv);
    }
}

static void recorder_thread_ended(void *context)
{
    atomic_store(&((struct recorder *)context)->ended, true);
}

static void *recorder_thread_main(void *context)
{
    struct recorder *recorder = context;
    sigset_t of_writing;

    /* A pipe without a reader and a file at its size limit are errors of write, not signals */
    sigemptyset(&of_writing);
    sigaddset(&of_writing, SIGPIPE);
    sigaddset(&of_writing, SIGXFSZ);
    pthread_sigmask(SIG_BLOCK, &of_writing, NULL);
    pthread_cleanup_push(recorder_thread_ended, recorder);
    while (!atomic_load(&recorder->stop)) {
        if (!recorder_drain_rings(recorder)) {
            recorder_nap(IDLE_NS);
        }
        recorder_tend_files(recorder);
    }
    while (recorder_drain_rings(recorder)) {
        recorder_tend_files(recorder);
    }
    line_file_look(&recorder->log);
    line_file_look(&recorder->csv);
    line_file_close(&recorder->log);
    line_file_close(&recorder->csv);
    pthread_cleanup_pop(1);
    return NULL;
}

/* ---- opening ---- */

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

static enum error_code recorder_prepare_directory(const struct recorder_config *config, bool *made,
                                                  struct error *error)
{
    bool empty = false;

    *made = mkdir(config->directory, 0777) == 0;
    if (*made) {
        return ERROR_NONE;
    }
    if (errno != EEXIST) {
        return error_set_errno(error, errno, "cannot make the directory %s", config->directory);
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

/* The titles of the columns as the first line of signals.csv; NULL when memory is used up. */
static const char *recorder_make_title(const struct recorder_config *config, struct arena *arena)
{
    size_t size = sizeof "time_s\n", used;
    char *title;

    for (size_t i = 0; i < config->nsignal; i++) {
        size += 1 + strlen(config->signal[i]);
    }
    title = arena_alloc(arena, size, 1);
    if (!title) {
        return NULL;
    }
    used = (size_t)sprintf(title, "time_s");
    for (size_t i = 0; i < config->nsignal; i++) {
        used += (size_t)sprintf(title + used, ",%s", config->signal[i]);
    }
    strcpy(title + used, "\n");
    return title;
}

static struct recorder *recorder_allocate(const struct recorder_config *config, struct arena *arena)
{
    struct recorder *made = arena_alloc(arena, 1, sizeof *made);
    uint32_t count = config->frame_ring ? (uint32_t)config->frame_ring : FRAME_RING;
    size_t row_size = (1 + config->nsignal) * sizeof(double);
    void *frames = arena_alloc(arena, count, sizeof(struct frame_item));
    void *rows = arena_alloc(arena, ROW_RING, row_size);
    double *row = arena_alloc(arena, 1, row_size);
    char *line = arena_alloc(arena, CANDUMP_LINE_MAX + (1 + config->nsignal) * NUMBER_SIZE, 1);

    if (!made || !frames || !rows || !row || !line) {
        return NULL;
    }
    made->config = *config;
    made->config.stall_ns = config->stall_ns ? config->stall_ns : RECORDER_STALL_NS;
    made->log.descriptor = made->csv.descriptor = -1;
    made->row = row;
    made->line = line;
    ring_init(&made->frames, frames, sizeof(struct frame_item), count);
    ring_init(&made->rows, rows, row_size, ROW_RING);
    return made;
}

/* That of a recording which is overwritten; not beside the new one, also should that be lost. */
static enum error_code recorder_remove_summary(const char *directory, struct error *error)
{
    char path[LINE_FILE_PATH];

    snprintf(path, sizeof path, "%s/" RECORDER_SUMMARY, directory);
    if (unlink(path) && errno != ENOENT) {
        return error_set_errno(error, errno, "cannot remove %s of an earlier recording", path);
    }
    return ERROR_NONE;
}

static enum error_code recorder_open_files(struct recorder *recorder, struct arena *arena,
                                           struct error *error)
{
    const struct recorder_config *config = &recorder->config;
    size_t longest = (1 + config->nsignal) * NUMBER_SIZE;
    const char *title = recorder_make_title(config, arena);
    enum error_code code;

    if (!title) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder");
    }
    longest = strlen(title) > longest ? strlen(title) : longest;
    code = line_file_open(&recorder->log, config->directory, "candump.log", "", CANDUMP_LINE_MAX,
                          &recorder->beat, arena, error);
    return code ? code
                : line_file_open(&recorder->csv, config->directory, "signals.csv", title, longest,
                                 &recorder->beat, arena, error);
}

/* Removes the files and the directory if it was made; when no thread writes them. */
static void recorder_remove_files(struct recorder *recorder)
{
    line_file_remove(&recorder->csv);
    line_file_remove(&recorder->log);
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

/* Whether the writing thread has made no progress for so long; *beat and *since_ns carry over from
 * call to call. */
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

/* Waits for room in a ring; false when the disk is given up. */
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

static void recorder_push(struct recorder *recorder, struct ring *ring, const void *item,
                          _Atomic uint64_t *taken, _Atomic uint64_t *dropped)
{
    bool pushed = !atomic_load_explicit(&recorder->given_up, memory_order_relaxed) &&
                  (ring_push(ring, item) ||
                   (recorder->config.lossless && recorder_wait_for_room(recorder, ring, item)));
    _Atomic uint64_t *count = pushed ? taken : dropped;

    /* No other thread writes it: no need for an atomic increment */
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
    memcpy(recorder->row + 1, value, recorder->config.nsignal * sizeof *value);
    recorder_push(recorder, &recorder->rows, recorder->row, &recorder->tally.rows,
                  &recorder->tally.rows_dropped);
}

/* ---- reports of what went wrong ---- */

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

static bool recorder_drop_event(struct recorder *recorder, char *text, size_t size)
{
    uint64_t frames = atomic_load_explicit(&recorder->tally.frames_dropped, memory_order_relaxed);
    uint64_t rows = atomic_load_explicit(&recorder->tally.rows_dropped, memory_order_relaxed);
    int64_t now = recorder_clock_now();

    if (frames + rows == recorder->drops_reported ||
        (recorder->drops_reported && now - recorder->drops_reported_ns < CLOCK_SECOND)) {
        return false;
    }
    recorder->drops_reported = frames + rows;
    recorder->drops_reported_ns = now;
    snprintf(text, size,
             "the disk does not keep up with the recording: %" PRIu64 " frames and %" PRIu64
             " rows dropped until now",
             frames, rows);
    return true;
}

bool recorder_next_event(struct recorder *recorder, unsigned *kind, char *text, size_t size)
{
    if (recorder_file_event(&recorder->log, &recorder->log_reports, text, size)) {
        *kind = EVENT_LOG;
        return true;
    }
    if (recorder_file_event(&recorder->csv, &recorder->csv_reports, text, size)) {
        *kind = EVENT_CSV;
        return true;
    }
    if (atomic_load(&recorder->given_up) && !recorder->given_up_reported) {
        recorder->given_up_reported = true;
        *kind = EVENT_GIVEN_UP;
        snprintf(text, size,
                 "the disk of %s took nothing for %.1f s: recording ends here, the run goes on",
                 recorder->config.directory, (double)recorder->config.stall_ns * 1e-9);
        return true;
    }
    *kind = EVENT_DROPS;
    return recorder_drop_event(recorder, text, size);
}

/* ---- the end ---- */

/* Waits until the writing thread has ended; false when it hangs. */
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

/* Ends the thread; one that hangs in a system call is cancelled, and dies when that returns, before
 * it touches the recorder again. */
static void recorder_end_thread(struct recorder *recorder, struct recorder_counters *counters)
{
    int64_t stall = recorder->config.stall_ns;

    atomic_store(&recorder->stop, true);
    if (recorder_wait_for_thread(recorder, atomic_load(&recorder->given_up) ? stall / 10 : stall)) {
        pthread_join(recorder->thread, NULL);
        return;
    }
    pthread_cancel(recorder->thread);
    if (recorder_wait_for_thread(recorder, CANCEL_NS)) {
        pthread_join(recorder->thread, NULL);
        line_file_abandon(&recorder->log);
        line_file_abandon(&recorder->csv);
    } else {
        pthread_detach(recorder->thread);
    }
    counters->frames_unwritten = ring_count(&recorder->frames);
    counters->rows_unwritten = ring_count(&recorder->rows);
}

enum error_code recorder_close(struct recorder *recorder, struct recorder_counters *counters,
                               struct error *error)
{
    *counters = (struct recorder_counters){0};
    recorder_end_thread(recorder, counters);
    counters->frames = atomic_load(&recorder->tally.frames);
    counters->rows = atomic_load(&recorder->tally.rows);
    counters->frames_dropped = atomic_load(&recorder->tally.frames_dropped);
    counters->rows_dropped = atomic_load(&recorder->tally.rows_dropped);
    counters->frames_unwritten += recorder->log.unwritten;
    counters->rows_unwritten += recorder->csv.unwritten;
    if (atomic_load(&recorder->log.ended) || atomic_load(&recorder->csv.ended)) {
        *error = atomic_load(&recorder->log.ended) ? recorder->log.error : recorder->csv.error;
        return error->code;
    }
    if (counters->frames_dropped + counters->rows_dropped + counters->frames_unwritten +
        counters->rows_unwritten) {
        return error_set(error, ERROR_SYSTEM,
                         "the recording in %s is not whole: of %" PRIu64 " frames and %" PRIu64
                         " rows %" PRIu64 " and %" PRIu64 " were dropped, because the disk did "
                         "not keep up",
                         recorder->config.directory, counters->frames + counters->frames_dropped,
                         counters->rows + counters->rows_dropped,
                         counters->frames_dropped + counters->frames_unwritten,
                         counters->rows_dropped + counters->rows_unwritten);
    }
    return ERROR_NONE;
}

void recorder_discard(struct recorder *recorder)
{
    struct recorder_counters counters = {0};

    recorder_end_thread(recorder, &counters);
    recorder_remove_files(recorder);
}
