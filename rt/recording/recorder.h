/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records a run into a directory:
 *
 *   candump.log     every frame of every bus in both directions, in the format of candump -L
 *   signals.csv     one row of signals every few ticks, for plots
 *   poses.csv       position and attitude of each body, at the same times
 *   events.log      events in order of time
 *   recording.mcap  all of it for viewers, instead of or beside the two CSV files
 *                   (rt/recording/recorder_mcap.h)
 *
 * A separate thread formats and writes; the loop only copies into rings. SI units, times in ns.
 *
 * All times are virtual. A received frame has the time at which its tick begins, a sent frame the
 * time at which its tick ends. The log therefore depends on the run alone, and equal runs give
 * equal bytes. With the real clock this is the time of the grid, not wall time.
 *
 * Guarantees when the disk fails or is slow:
 *
 * - Slow, real clock. The loop never waits. Items that find their ring full are dropped, counted,
 *   and reported once a second. When the disk has caught up, recording continues after the gap.
 * - Slow, lockstep and free run (lossless). The loop waits, because virtual time can stand still.
 *   The recorder gives up a disk that accepts nothing for stall_ns: it then drops and counts
 *   everything.
 * - Disk full, broken or at its file size limit, or a pipe without a reader. This file ends; the
 *   other files and the run continue. The file ends with a whole line, because the rest of a
 *   partial write is cut off. A pipe cannot be cut; this is reported.
 * - File removed. The file ends, and its space on the disk is freed.
 * - File renamed, as by log rotation. Recording continues into the same file; this is reported.
 * - Delay. The recorder writes everything within 250 ms, and events within 750 ms because it sorts
 *   them. A killed program loses the unwritten rest and may leave half a line. The MCAP file grows
 *   in chunks of at most a second; without its end, all whole chunks are readable.
 *
 * Each failure is reported within a second (recorder_next_event), counted, and makes recorder_close
 * fail. The accounts balance: frames offered = frames + frames_dropped, lines in candump.log =
 * frames - frames_unwritten. The same holds for rows (of signals.csv) and events. One exception:
 * when a system call hangs until the program ends, the items that the thread was writing are not
 * counted.
 */
#ifndef RT_RECORDING_RECORDER_H
#define RT_RECORDING_RECORDER_H

#include "base/arena.h"
#include "base/journal.h"
#include "base/enum_names.h"
#include "canbus/frame.h"

/* Name of the summary file that a program writes beside its recording at the end. */
#define RECORDER_SUMMARY "summary.json"

/* Version of the format, "format_version" in the summary. A summary without the key has version 1.
 * Readers refuse a newer version. */
#define RECORDING_FORMAT_VERSION 1

#define RECORDER_STALL_NS INT64_C(10000000000)

/* File formats of rows; a bit mask. */
enum recorder_format {
    RECORDER_CSV = 1, /* signals.csv and poses.csv */
    RECORDER_MCAP = 2 /* recording.mcap, with frames and events (rt/recording/recorder_mcap.h) */
};

/* Names of the formats and of their combination. */
extern const struct word recorder_format_words[];

enum {
    RECORDER_POSE = 7,         /* position (m), quaternion wxyz, body to world */
    RECORDER_EVENT_TEXT = 320, /* longer event texts are cut */
};

/* The JSON Schema of foxglove.SceneUpdate. */
extern const char recorder_schema_scene[];

/* An additional channel of the MCAP file; messages in JSON. */
struct recorder_channel {
    const char *topic, *type; /* "/scene", "foxglove.SceneUpdate" */
    const char *schema;       /* JSON Schema; channels of one type share the pointer */
    const char *first;        /* message written at the beginning of the file; NULL = none */
    size_t longest;           /* most bytes that print writes */

    /* Writes the message for a row to `at`. Returns the end of the message, or `at` for no message.
     * value, pose: arguments of recorder_row. Called in the recorder's thread. NULL = no message
     * per row. */
    char *(*print)(void *context, int64_t time_ns, const double *value, const double *pose,
                   char *at);
    void *context;
};

struct recorder_config {
    const char *directory; /* created if missing; must be empty unless overwrite */
    bool overwrite;        /* replace the files of an earlier recording */
    bool lossless;         /* wait instead of dropping */
    size_t nbus;
    const char *const *bus; /* names as written in candump.log */
    size_t nsignal;
    const char *const *signal; /* column titles after time_s */
    size_t nbody;              /* 0 = no poses.csv */
    const char *const *body;   /* names of the bodies */
    unsigned format;           /* format of rows, enum recorder_format; 0 = RECORDER_CSV */
    size_t nchannel;
    const struct recorder_channel *channel;
    size_t frame_ring; /* capacity in frames, a power of two; 0 = 65536 */
    /* time without progress after which the disk is given up; 0 = RECORDER_STALL_NS */
    int64_t stall_ns;
};

struct recorder_counters {
    uint64_t frames, rows, events; /* accepted by the rings */
    /* Dropped: ring full, or disk given up */
    uint64_t frames_dropped, rows_dropped, events_dropped;
    /* Accepted but not written */
    uint64_t frames_unwritten, rows_unwritten, events_unwritten;
};

enum { RECORDER_EVENTS = 7 }; /* kinds of reports */

struct recorder;

/* Creates the directory and the files, removes the summary of an earlier recording, and starts the
 * thread. Memory from arena. ERROR_INPUT when the directory is not empty and overwrite is not set.
 * On any error it removes what it created. Not RT-safe. */
enum error_code recorder_open(const struct recorder_config *config, struct arena *arena,
                              struct recorder **recorder, struct error *error);

/* Record a frame and a row. From the loop's thread only; RT-safe unless lossless. value: one number
 * per signal, then RECORDER_POSE numbers per body. */
void recorder_frame(struct recorder *recorder, size_t bus, const struct bus_frame *frame,
                    int64_t time_ns);
void recorder_row(struct recorder *recorder, int64_t time_ns, const double *value);

/* Records an event: a line of text at a virtual time. Events recorded within half a second of wall
 * time are sorted by virtual time, then by rank, then by order of the calls. From one thread, not
 * necessarily the loop's. RT-safe unless lossless. */
void recorder_event(struct recorder *recorder, int64_t time_ns, unsigned rank,
                    enum journal_priority priority, const char *text);

/* Writes the next new problem as a sentence; false = nothing new. kind (below RECORDER_EVENTS)
 * distinguishes the files, a disk given up, and drops. It reports drops at most once a second. From
 * one thread. Not RT-safe. */
bool recorder_next_event(struct recorder *recorder, unsigned *kind, char *text, size_t size);

/* Writes the rest and closes the files. Abandons a disk that accepts nothing for stall_ns, with its
 * thread. Returns the first problem when the recording is incomplete. Not RT-safe. */
enum error_code recorder_close(struct recorder *recorder, struct recorder_counters *counters,
                               struct error *error);

/* Removes everything that recorder_open created. Call it instead of recorder_close when the run
 * never began. Not RT-safe. */
void recorder_discard(struct recorder *recorder);

#endif
