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
    ROUND = 4096,     /* items written before the thread looks about again */
    IDLE_NS = 2000000,
    WAIT_NS = 100000, /* the loop's, for room in a ring */
};

#define ATTEND_NS (250 * CLOCK_MS)
#define CANCEL_NS                                                                                  \
    (5 * CLOCK_SECOND) /* a call of the system that a signal does not end by then hangs */

/* What has gone wrong, as of recorder_next_event. */
enum recorder_event { EVENT_LOG, EVENT_CSV, EVENT_DROPS, EVENT_GIVEN_UP };

struct frame_item {
    struct bus_frame frame;
    uint32_t bus;
};

/* Counted by the loop, read by anybody. */
struct tally {
    _Atomic uint64_t frames, rows, frames_dropped, rows_dropped;
};

/* What was told of a file. */
struct told {
    bool moved, ended;
};

struct recorder {
    struct recorder_config config;
    struct ring frames, rows;
    double *row; /* the loop's scratch: time in whole ns, then the signals */
    char *line;  /* the thread's, for one line of either file */
    struct tally tally;
    struct line_file log, csv;
    bool made_directory;
    pthread_t thread;
    _Atomic uint64_t beat; /* moves while the thread does */
    int64_t attend_ns;     /* when the thread looks after its files again */
    atomic_bool stop, ended;
    atomic_bool given_up;

    /* of the thread that asks for events */
    struct told log_told, csv_told;
    bool given_up_told;
    uint64_t drops_told;
    int64_t drops_told_ns;
};

static int64_t now_ns(void)
{
    return clock_now(clock_monotonic());
}

static void nap(int64_t ns)
{
    nanosleep(&(struct timespec){.tv_nsec = ns}, NULL);
}

/* ---- the writing thread ---- */

static void write_frame(struct recorder *recorder, const struct frame_item *item)
{
    size_t size = candump_format(&item->frame, recorder->config.bus[item->bus], recorder->line);

    line_file_put(&recorder->log, recorder->line, size);
}

static void write_row(struct recorder *recorder, const double *row)
{
    char *line = recorder->line;
    size_t size = (size_t)sprintf(line, "%.6f", row[0] * 1e-9);

    for (size_t i = 0; i < recorder->config.nsignal; i++) {
        size += (size_t)sprintf(line + size, ",%.9g", row[1 + i]);
    }
    line[size++] = '\n';
    line_file_put(&recorder->csv, line, size);
}

/* An item leaves its ring when it is written: what a thread that hangs leaves behind is counted. */
static bool drain(struct recorder *recorder)
{
    const void *item;
    int count = 0;

    for (; count < ROUND && (item = ring_front(&recorder->frames)); count++) {
        write_frame(recorder, item);
        ring_drop(&recorder->frames);
    }
    for (; count < 2 * ROUND && (item = ring_front(&recorder->rows)); count++) {
        write_row(recorder, item);
        ring_drop(&recorder->rows);
    }
    return count > 0;
}

/* Now and then: what waits goes to the disk, and the files are looked after. */
static void attend(struct recorder *recorder)
{
    int64_t now = now_ns();

    atomic_fetch_add_explicit(&recorder->beat, 1, memory_order_relaxed);
    if (now >= recorder->attend_ns) {
        recorder->attend_ns = now + ATTEND_NS;
        line_file_flush(&recorder->log);
        line_file_flush(&recorder->csv);
        line_file_look(&recorder->log);
        line_file_look(&recorder->csv);
    }
}

static void thread_ended(void *context)
{
    atomic_store(&((struct recorder *)context)->ended, true);
}

static void *thread_main(void *context)
{
    struct recorder *recorder = context;
    sigset_t of_writing;

    /* a pipe without a reader and a file at its limit are errors of write */
    sigemptyset(&of_writing);
    sigaddset(&of_writing, SIGPIPE);
    sigaddset(&of_writing, SIGXFSZ);
    pthread_sigmask(SIG_BLOCK, &of_writing, NULL);
    pthread_cleanup_push(thread_ended, recorder);
    while (!atomic_load(&recorder->stop)) {
        if (!drain(recorder)) {
            nap(IDLE_NS);
        }
        attend(recorder);
    }
    while (drain(recorder)) {
        attend(recorder);
    }
    line_file_look(&recorder->log);
    line_file_look(&recorder->csv);
    line_file_close(&recorder->log);
    line_file_close(&recorder->csv);
    pthread_cleanup_pop(1);
    return NULL;
}

/* ---- opening ---- */

static bool is_empty(const char *directory, bool *empty)
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

static enum error_code prepare_directory(const struct recorder_config *config, bool *made,
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
    if (!is_empty(config->directory, &empty)) {
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

/* The titles of the columns as the first line of signals.csv; NULL when memory is short. */
static const char *make_title(const struct recorder_config *config, struct arena *arena)
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

static struct recorder *allocate(const struct recorder_config *config, struct arena *arena)
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

static enum error_code open_files(struct recorder *recorder, struct arena *arena,
                                  struct error *error)
{
    const struct recorder_config *config = &recorder->config;
    size_t longest = (1 + config->nsignal) * NUMBER_SIZE;
    const char *title = make_title(config, arena);
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

/* What was made, when no thread writes it. */
static void remove_all(struct recorder *recorder)
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
    struct recorder *made = allocate(config, arena);
    enum error_code code;
    int reason;

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder");
    }
    code = prepare_directory(config, &made->made_directory, error);
    if (!code) {
        code = open_files(made, arena, error);
    }
    if (code) {
        remove_all(made);
        return code;
    }
    reason = pthread_create(&made->thread, NULL, thread_main, made);
    if (reason) {
        remove_all(made);
        return error_set_errno(error, reason, "cannot start the recorder's thread");
    }
    *recorder = made;
    return ERROR_NONE;
}

/* ---- the loop's side ---- */

/* Whether the thread has stood still for so long; *beat and *since_ns are of the last call. */
static bool stands_still(const struct recorder *recorder, int64_t patience_ns, uint64_t *beat,
                         int64_t *since_ns)
{
    uint64_t now_at = atomic_load_explicit(&recorder->beat, memory_order_relaxed);
    int64_t now = now_ns();

    if (now_at != *beat) {
        *beat = now_at;
        *since_ns = now;
    }
    return now - *since_ns > patience_ns;
}

/* false: the disk is given up */
static bool wait_for_room(struct recorder *recorder, struct ring *ring, const void *item)
{
    uint64_t beat = atomic_load_explicit(&recorder->beat, memory_order_relaxed);
    int64_t since = now_ns();

    while (!ring_push(ring, item)) {
        if (stands_still(recorder, recorder->config.stall_ns, &beat, &since)) {
            atomic_store(&recorder->given_up, true);
            return false;
        }
        nap(WAIT_NS);
    }
    return true;
}

static void push(struct recorder *recorder, struct ring *ring, const void *item,
                 _Atomic uint64_t *taken, _Atomic uint64_t *dropped)
{
    bool pushed = !atomic_load_explicit(&recorder->given_up, memory_order_relaxed) &&
                  (ring_push(ring, item) ||
                   (recorder->config.lossless && wait_for_room(recorder, ring, item)));
    _Atomic uint64_t *count = pushed ? taken : dropped;

    /* nobody else writes it */
    atomic_store_explicit(count, atomic_load_explicit(count, memory_order_relaxed) + 1,
                          memory_order_relaxed);
}

void recorder_frame(struct recorder *recorder, size_t bus, const struct bus_frame *frame,
                    int64_t time_ns)
{
    struct frame_item item = {.frame = *frame, .bus = (uint32_t)bus};

    item.frame.time_ns = time_ns;
    push(recorder, &recorder->frames, &item, &recorder->tally.frames,
         &recorder->tally.frames_dropped);
}

void recorder_row(struct recorder *recorder, int64_t time_ns, const double *value)
{
    recorder->row[0] = (double)time_ns;
    memcpy(recorder->row + 1, value, recorder->config.nsignal * sizeof *value);
    push(recorder, &recorder->rows, recorder->row, &recorder->tally.rows,
         &recorder->tally.rows_dropped);
}

/* ---- what has gone wrong ---- */

static bool file_event(const struct line_file *file, struct told *told, char *text, size_t size)
{
    if (atomic_load(&file->ended) && !told->ended) {
        told->ended = true;
        snprintf(text, size, "%s", file->error.text);
        return true;
    }
    if (atomic_load(&file->moved) && !told->moved) {
        told->moved = true;
        snprintf(text, size, "%s has another name now: recording goes on in the same file",
                 file->path);
        return true;
    }
    return false;
}

static bool drop_event(struct recorder *recorder, char *text, size_t size)
{
    uint64_t frames = atomic_load_explicit(&recorder->tally.frames_dropped, memory_order_relaxed);
    uint64_t rows = atomic_load_explicit(&recorder->tally.rows_dropped, memory_order_relaxed);
    int64_t now = now_ns();

    if (frames + rows == recorder->drops_told ||
        (recorder->drops_told && now - recorder->drops_told_ns < CLOCK_SECOND)) {
        return false;
    }
    recorder->drops_told = frames + rows;
    recorder->drops_told_ns = now;
    snprintf(text, size,
             "the disk does not keep up with the recording: %" PRIu64 " frames and %" PRIu64
             " rows dropped until now",
             frames, rows);
    return true;
}

bool recorder_next_event(struct recorder *recorder, unsigned *kind, char *text, size_t size)
{
    if (file_event(&recorder->log, &recorder->log_told, text, size)) {
        *kind = EVENT_LOG;
        return true;
    }
    if (file_event(&recorder->csv, &recorder->csv_told, text, size)) {
        *kind = EVENT_CSV;
        return true;
    }
    if (atomic_load(&recorder->given_up) && !recorder->given_up_told) {
        recorder->given_up_told = true;
        *kind = EVENT_GIVEN_UP;
        snprintf(text, size,
                 "the disk of %s took nothing for %.1f s: recording ends here, the run goes on",
                 recorder->config.directory, (double)recorder->config.stall_ns * 1e-9);
        return true;
    }
    *kind = EVENT_DROPS;
    return drop_event(recorder, text, size);
}

/* ---- the end ---- */

/* false: it hangs */
static bool wait_for_thread(const struct recorder *recorder, int64_t patience_ns)
{
    uint64_t beat = atomic_load_explicit(&recorder->beat, memory_order_relaxed);
    int64_t since = now_ns();

    while (!atomic_load(&recorder->ended)) {
        if (stands_still(recorder, patience_ns, &beat, &since)) {
            return false;
        }
        nap(WAIT_NS);
    }
    return true;
}

/* Ends the thread; one that hangs in a call of the system is cancelled, and dies when that returns,
 * before it touches anything of ours. */
static void end_thread(struct recorder *recorder, struct recorder_counters *counters)
{
    int64_t stall = recorder->config.stall_ns;

    atomic_store(&recorder->stop, true);
    if (wait_for_thread(recorder, atomic_load(&recorder->given_up) ? stall / 10 : stall)) {
        pthread_join(recorder->thread, NULL);
        return;
    }
    pthread_cancel(recorder->thread);
    if (wait_for_thread(recorder, CANCEL_NS)) {
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
    end_thread(recorder, counters);
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
                         " rows %" PRIu64 " and %" PRIu64 " were dropped, for the disk did not "
                         "keep up",
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

    end_thread(recorder, &counters);
    remove_all(recorder);
}
