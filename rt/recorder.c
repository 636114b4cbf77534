/* SPDX-License-Identifier: Apache-2.0 */
/* The recorder's rings and its writing thread. */
#include "rt/recorder.h"

#include "base/ring.h"
#include "canbus/candump.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum {
    FRAME_RING = 65536, /* about a second of a fully loaded rig */
    ROW_RING = 1024,
    PATH_SIZE = 4096,
    IDLE_NS = 2000000,
};

struct frame_item {
    struct bus_frame frame;
    uint32_t bus;
};

/* One file and what has become of it. */
struct output {
    FILE *file;
    const char *name;
    bool failed;
};

struct recorder {
    struct recorder_config config;
    struct ring frames, rows;
    double *row; /* the loop's scratch: time in whole ns, then the signals */
    double *row_out;
    struct recorder_counters counters; /* of the loop */
    uint64_t unwritten;                /* of the thread */
    struct output log, csv;
    pthread_t thread;
    atomic_bool stop;
    atomic_bool failed, failure_taken;
    struct error failure;
};

/* ---- the writing thread ---- */

static void fail(struct recorder *recorder, struct output *output)
{
    int reason = errno;

    output->failed = true;
    if (!atomic_load(&recorder->failed)) {
        error_set_errno(&recorder->failure, reason,
                        "cannot write %s/%s: recording of it ends here, the run goes on",
                        recorder->config.directory, output->name);
        atomic_store(&recorder->failed, true);
    }
}

static void write_text(struct recorder *recorder, struct output *output, const char *text,
                       size_t size)
{
    if (!output->failed && fwrite(text, 1, size, output->file) != size) {
        fail(recorder, output);
    }
}

static void write_frame(struct recorder *recorder, const struct frame_item *item)
{
    char line[CANDUMP_LINE_MAX];
    size_t size = candump_format(&item->frame, recorder->config.bus[item->bus], line);

    write_text(recorder, &recorder->log, line, size);
    recorder->unwritten += recorder->log.failed;
}

static void write_row(struct recorder *recorder, const double *row)
{
    char text[32];
    int size = snprintf(text, sizeof text, "%.6f", row[0] * 1e-9);

    write_text(recorder, &recorder->csv, text, (size_t)size);
    for (size_t i = 0; i < recorder->config.nsignal; i++) {
        size = snprintf(text, sizeof text, ",%.9g", row[1 + i]);
        write_text(recorder, &recorder->csv, text, (size_t)size);
    }
    write_text(recorder, &recorder->csv, "\n", 1);
    recorder->unwritten += recorder->csv.failed;
}

static bool drain(struct recorder *recorder)
{
    struct frame_item item;
    bool any = false;

    while (ring_pop(&recorder->frames, &item)) {
        write_frame(recorder, &item);
        any = true;
    }
    while (ring_pop(&recorder->rows, recorder->row_out)) {
        write_row(recorder, recorder->row_out);
        any = true;
    }
    return any;
}

static void nap(int64_t ns)
{
    nanosleep(&(struct timespec){.tv_nsec = ns}, NULL);
}

static void *thread_main(void *context)
{
    struct recorder *recorder = context;

    while (!atomic_load(&recorder->stop)) {
        if (!drain(recorder)) {
            nap(IDLE_NS);
        }
    }
    drain(recorder);
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

static enum error_code prepare_directory(const struct recorder_config *config, struct error *error)
{
    bool empty = false;

    if (mkdir(config->directory, 0777) == 0) {
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

static enum error_code open_output(const struct recorder_config *config, const char *name,
                                   struct output *output, struct error *error)
{
    char path[PATH_SIZE];

    if ((size_t)snprintf(path, sizeof path, "%s/%s", config->directory, name) >= sizeof path) {
        return error_set(error, ERROR_INPUT,
                         "the name of the directory to record into is too long");
    }
    output->name = name;
    output->file = fopen(path, "we");
    if (!output->file) {
        return error_set_errno(error, errno, "cannot open %s", path);
    }
    setvbuf(output->file, NULL, _IOFBF, 256 * 1024);
    return ERROR_NONE;
}

static void write_titles(struct recorder *recorder)
{
    fputs("time_s", recorder->csv.file);
    for (size_t i = 0; i < recorder->config.nsignal; i++) {
        fprintf(recorder->csv.file, ",%s", recorder->config.signal[i]);
    }
    fputc('\n', recorder->csv.file);
}

static struct recorder *allocate(const struct recorder_config *config, struct arena *arena)
{
    struct recorder *made = arena_alloc(arena, 1, sizeof *made);
    uint32_t count = config->frame_ring ? (uint32_t)config->frame_ring : FRAME_RING;
    size_t row_size = (1 + config->nsignal) * sizeof(double);
    void *frames = arena_alloc(arena, count, sizeof(struct frame_item));
    void *rows = arena_alloc(arena, ROW_RING, row_size);
    double *row = arena_alloc(arena, 2, row_size);

    if (!made || !frames || !rows || !row) {
        return NULL;
    }
    made->config = *config;
    made->row = row;
    made->row_out = row + 1 + config->nsignal;
    ring_init(&made->frames, frames, sizeof(struct frame_item), count);
    ring_init(&made->rows, rows, row_size, ROW_RING);
    return made;
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
    code = prepare_directory(config, error);
    if (!code) {
        code = open_output(config, "candump.log", &made->log, error);
    }
    if (code) {
        return code;
    }
    code = open_output(config, "signals.csv", &made->csv, error);
    if (code) {
        goto error_csv;
    }
    write_titles(made);
    reason = pthread_create(&made->thread, NULL, thread_main, made);
    if (reason) {
        code = error_set_errno(error, reason, "cannot start the recorder's thread");
        goto error_thread;
    }
    *recorder = made;
    return ERROR_NONE;

error_thread:
    fclose(made->csv.file);
error_csv:
    fclose(made->log.file);
    return code;
}

/* ---- the loop's side ---- */

/* false when the item was dropped */
static bool push(struct recorder *recorder, struct ring *ring, const void *item)
{
    while (!ring_push(ring, item)) {
        if (!recorder->config.lossless) {
            return false;
        }
        nap(IDLE_NS / 20);
    }
    return true;
}

void recorder_frame(struct recorder *recorder, size_t bus, const struct bus_frame *frame,
                    int64_t time_ns)
{
    struct frame_item item = {.frame = *frame, .bus = (uint32_t)bus};

    item.frame.time_ns = time_ns;
    if (push(recorder, &recorder->frames, &item)) {
        recorder->counters.frames++;
    } else {
        recorder->counters.frames_dropped++;
    }
}

void recorder_row(struct recorder *recorder, int64_t time_ns, const double *value)
{
    recorder->row[0] = (double)time_ns;
    memcpy(recorder->row + 1, value, recorder->config.nsignal * sizeof *value);
    if (push(recorder, &recorder->rows, recorder->row)) {
        recorder->counters.rows++;
    } else {
        recorder->counters.rows_dropped++;
    }
}

bool recorder_failure(struct recorder *recorder, struct error *error)
{
    if (!atomic_load(&recorder->failed) || atomic_exchange(&recorder->failure_taken, true)) {
        return false;
    }
    *error = recorder->failure;
    return true;
}

static void close_output(struct recorder *recorder, struct output *output)
{
    if (fclose(output->file) && !output->failed) {
        fail(recorder, output);
    }
}

enum error_code recorder_close(struct recorder *recorder, struct recorder_counters *counters,
                               struct error *error)
{
    atomic_store(&recorder->stop, true);
    pthread_join(recorder->thread, NULL);
    close_output(recorder, &recorder->log);
    close_output(recorder, &recorder->csv);
    *counters = recorder->counters;
    counters->unwritten = recorder->unwritten;
    if (recorder->failed) {
        *error = recorder->failure;
        return recorder->failure.code;
    }
    return ERROR_NONE;
}
