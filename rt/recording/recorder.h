/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records a run into a directory: candump.log (every frame of every bus in both directions, the
 * format of candump -L, stamped with virtual time), signals.csv (one row every so many ticks, for
 * plots), poses.csv (where each body is, at the same times) and events.log (what happened, in the
 * order of time); instead of or beside the two CSV files recording.mcap, which holds all of it for
 * viewers (rt/recording/recorder_mcap.h). A thread of its own formats and writes; the loop only
 * copies into rings. SI units, times in ns.
 *
 * Frames received in a tick carry the virtual time at which the tick begins, frames sent that at
 * which it ends; so the log depends on the run alone, and equal runs give equal bytes. With the
 * real clock this is the time of the grid, not wall time.
 *
 * What is guaranteed when the disk fails or is slow:
 *
 * - Slow, real clock. The loop never waits: what finds a ring full is dropped and counted, and
 *   reported once a second. When the disk has caught up the recording goes on after the gap.
 * - Slow, lockstep and free run (lossless). The loop waits, since virtual time can. A disk that
 *   accepts nothing for stall_ns is given up: from then on everything is dropped and counted.
 * - Full, broken, at the limit of a file's size, or a pipe that nobody reads any more. The file
 *   ends there, the others and the run go on. It ends with a whole line: what a partial write
 *   has left is cut off; where that is impossible, in a pipe, it is reported.
 * - Removed. The file ends there too, and its space on the disk is freed.
 * - Renamed, as a log rotation does it. Recording goes on into the same file; reported.
 * - Everything is written within 250 ms, events, which are put into order, within 750 ms; a program
 *   that is killed leaves the rest unwritten and perhaps half a line. The MCAP file is written in
 *   chunks of at most a second; of one without an end all whole chunks can be read.
 *
 * All of it is reported within a second (recorder_next_event), counted, and makes recorder_close
 * fail. The accounts balance: frames offered = frames + frames_dropped, lines in candump.log =
 * frames - frames_unwritten, rows (of signals.csv) and events alike, except when a disk hangs
 * beyond all signals until the program ends: what its thread was writing is then not counted.
 */
#ifndef RT_RECORDING_RECORDER_H
#define RT_RECORDING_RECORDER_H

#include "base/arena.h"
#include "base/journal.h"
#include "base/enum_names.h"
#include "canbus/frame.h"

#include <stdbool.h>
#include <stddef.h>

/* Name of the summary that a program writes beside its recording when it ends. */
#define RECORDER_SUMMARY "summary.json"

/* Version of the format, "format_version" in the summary; a summary without it has version 1. A
 * newer one is not read. */
#define RECORDING_FORMAT_VERSION 1

#define RECORDER_STALL_NS INT64_C(10000000000)

/* What rows are written to; a sum. */
enum recorder_format {
    RECORDER_CSV = 1, /* signals.csv and poses.csv */
    RECORDER_MCAP = 2 /* recording.mcap, with frames and events (rt/recording/recorder_mcap.h) */
};

/* The words for these formats and their sum. */
extern const struct word recorder_format_words[];

enum {
    RECORDER_POSE = 7,         /* position (m), quaternion wxyz, body to world */
    RECORDER_EVENT_TEXT = 320, /* longer texts of events are cut */
};

/* A channel of the MCAP file beside the recorder's own; messages in JSON. */
struct recorder_channel {
    const char *topic, *type; /* "/scene", "foxglove.SceneUpdate" */
    const char *schema;       /* of the messages; one text for all channels of a type */
    const char *first;        /* the first message, written when the file begins; NULL = none */
    size_t longest;           /* bytes of what print writes */

    /* Writes the message of a row at AT and returns its end, AT when the row has none; value, pose:
     * as given to recorder_row. Called by the recorder's thread. NULL = no message a row. */
    char *(*print)(void *context, int64_t time_ns, const double *value, const double *pose,
                   char *at);
    void *context;
};

struct recorder_config {
    const char *directory; /* created when missing; must be empty unless overwrite */
    bool overwrite;        /* replace the files of an earlier recording */
    bool lossless;         /* wait instead of dropping */
    size_t nbus;
    const char *const *bus; /* names as they stand in candump.log */
    size_t nsignal;
    const char *const *signal; /* column titles after time_s */
    size_t nbody;              /* 0 = there is no poses.csv */
    const char *const *body;   /* names */
    unsigned format;           /* of rows; 0 = RECORDER_CSV */
    size_t nchannel;
    const struct recorder_channel *channel;
    size_t frame_ring; /* frames held between loop and thread, a power of two; 0 = 65536 */
    int64_t stall_ns;  /* a disk that accepts nothing for so long is given up; 0 =
                       * RECORDER_STALL_NS */
};

struct recorder_counters {
    uint64_t frames, rows, events; /* accepted */
    /* Found the ring full, or the disk given up */
    uint64_t frames_dropped, rows_dropped, events_dropped;
    /* Accepted, and then not written */
    uint64_t frames_unwritten, rows_unwritten, events_unwritten;
};

enum { RECORDER_EVENTS = 7 }; /* kinds of reports */

struct recorder;

/* Creates the directory and the files, removes the summary of an earlier recording and starts the
 * thread. ERROR_INPUT when the directory is not empty and overwrite is not set; on any error what
 * it has created is removed again. Rings come from arena. Not RT-safe. */
enum error_code recorder_open(const struct recorder_config *config, struct arena *arena,
                              struct recorder **recorder, struct error *error);

/* From the loop's thread only; RT-safe unless lossless. value: of each signal, then RECORDER_POSE
 * for each body. */
void recorder_frame(struct recorder *recorder, size_t bus, const struct bus_frame *frame,
                    int64_t time_ns);
void recorder_row(struct recorder *recorder, int64_t time_ns, const double *value);

/* From one thread, which may be another: something that happened at a virtual time, in a line of
 * text. Events given within half a second of wall time are written in the order of their times,
 * those of one time by their ranks, those of one rank as they were given. RT-safe unless lossless.
 */
void recorder_event(struct recorder *recorder, int64_t time_ns, unsigned rank,
                    enum journal_priority priority, const char *text);

/* What went wrong since the last call, as a sentence; kind (below RECORDER_EVENTS) distinguishes
 * the files, a disk given up, and drops, which are reported at most once a second. False when
 * there is nothing new. From one thread. Not RT-safe. */
bool recorder_next_event(struct recorder *recorder, unsigned *kind, char *text, size_t size);

/* Writes what is left and closes the files; a disk that accepts nothing for stall_ns is abandoned
 * with its thread. Fails when the recording is incomplete, with the first thing that went wrong.
 * Not RT-safe. */
enum error_code recorder_close(struct recorder *recorder, struct recorder_counters *counters,
                               struct error *error);

/* Instead of recorder_close when the run never began: removes what recorder_open has created, so
 * that the next start finds the directory as this one did. Not RT-safe. */
void recorder_discard(struct recorder *recorder);

#endif
