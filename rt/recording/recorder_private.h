/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the recorder share: recorder.c opens, takes from the loop, reports and closes;
 * recorder_thread.c formats and writes, recorder_mcap.c into the MCAP file. Not RT-safe but where
 * it says so.
 */
#ifndef RT_RECORDING_RECORDER_PRIVATE_H
#define RT_RECORDING_RECORDER_PRIVATE_H

#include "base/ring.h"
#include "rt/recording/line_file.h"
#include "rt/recording/recorder.h"

#include <pthread.h>

enum recorder_file {
    FILE_FRAMES,
    FILE_SIGNALS,
    FILE_POSES,
    FILE_EVENTS,
    FILE_MCAP,
    RECORDER_FILES
};

/* What went wrong, as reported by recorder_next_event: a file's number, or one of these. */
enum recorder_report { REPORT_DROPS = RECORDER_FILES, REPORT_GIVEN_UP };

struct frame_item {
    struct bus_frame frame;
    uint32_t bus;
};

struct event_item {
    int64_t time_ns;
    unsigned rank;
    enum journal_priority priority;
    char text[RECORDER_EVENT_TEXT];
};

/* Items offered to the rings; counted by the threads that push, read by any. */
struct recorder_tally {
    _Atomic uint64_t frames, rows, events, frames_dropped, rows_dropped, events_dropped;
};

/* Events that wait for others with earlier times, in the order of their times. */
struct recorder_order {
    struct event_item *item;
    size_t count;
    int64_t settled_ns; /* of the latest that has waited for long enough */
};

/* Which events of a file have been reported. */
struct file_reports {
    bool moved, ended;
};

struct recorder {
    struct recorder_config config;
    struct ring frames, rows, events;
    size_t nvalue; /* of a row: signals, then poses */
    double *row;   /* the loop's scratch: time in whole ns, then the values */
    char *line;    /* the thread's scratch, for one line of any file */
    struct recorder_order order;
    struct recorder_tally tally;
    struct line_file file[RECORDER_FILES];
    bool has[RECORDER_FILES];   /* those that this recording consists of */
    struct recorder_mcap *mcap; /* NULL = none */
    bool made_directory;
    pthread_t thread;
    _Atomic uint64_t beat; /* moves while the thread does */
    int64_t tend_ns;       /* when the thread flushes and checks its files again */
    atomic_bool stop, ended;
    atomic_bool given_up;

    /* Of the thread that asks for reports */
    struct file_reports reports[RECORDER_FILES];
    bool given_up_reported;
    uint64_t drops_reported;
    int64_t drops_reported_ns;
};

/* ---- recorder_thread.c ---- */

enum {
    RECORDER_NUMBER = 32, /* bytes of a value in a line, with its comma */
    RECORDER_HELD = 1024, /* events that wait for earlier ones */
    RECORDER_LINE = 512,  /* bytes of a line of candump.log or events.log, or more */
};

/* The thread's function; context is the recorder. */
void *recorder_thread_main(void *context);

#endif
