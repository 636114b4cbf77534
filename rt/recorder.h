/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records a run into a directory: candump.log (every frame of every bus in both directions, the
 * format of candump -L, stamped with virtual time) and signals.csv (one row every so many ticks,
 * for plots). A thread of its own formats and writes; the loop only copies into rings.
 *
 * Frames received in a tick carry the virtual time at which the tick begins, frames sent that at
 * which it ends; so the log depends on nothing but the run, and equal runs give equal bytes. With
 * the real clock this is the time of the grid, not of the wall.
 *
 * When a ring is full, a lossless recorder (lockstep, free run) waits for its thread; otherwise the
 * item is dropped and counted. A write error is reported once, counted, and ends the writing of
 * that file, not the run.
 */
#ifndef RT_RECORDER_H
#define RT_RECORDER_H

#include "base/arena.h"
#include "canbus/frame.h"

#include <stdbool.h>
#include <stddef.h>

struct recorder_config {
    const char *directory; /* made when missing; must be empty or ours to overwrite */
    bool overwrite;        /* replace the files of an earlier recording */
    bool lossless;         /* wait instead of dropping */
    size_t nbus;
    const char *const *bus; /* names as they stand in candump.log */
    size_t nsignal;
    const char *const *signal; /* column titles after time_s */
    size_t frame_ring;         /* frames held between loop and thread, a power of two; 0 = 65536 */
};

struct recorder_counters {
    uint64_t frames, rows;                 /* taken from the loop */
    uint64_t frames_dropped, rows_dropped; /* found the ring full */
    uint64_t unwritten;                    /* lost to write errors */
};

struct recorder;

/* Makes the directory and the files and starts the thread. ERROR_INPUT when the directory holds
 * something and overwrite is not set. Rings come from arena. Not RT-safe. */
enum error_code recorder_open(const struct recorder_config *config, struct arena *arena,
                              struct recorder **recorder, struct error *error);

/* From the loop's thread only; RT-safe unless lossless. */
void recorder_frame(struct recorder *recorder, size_t bus, const struct bus_frame *frame,
                    int64_t time_ns);
void recorder_row(struct recorder *recorder, int64_t time_ns, const double *value);

/* The first write error, once; from any thread. */
bool recorder_failure(struct recorder *recorder, struct error *error);

/* Writes what is left and closes the files. The first write error, if any, comes back here too. */
enum error_code recorder_close(struct recorder *recorder, struct recorder_counters *counters,
                               struct error *error);

#endif
