/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions and state that the files of the recorder share. recorder.c opens and closes the
 * recording, fills the rings, and reports problems. recorder_thread.c formats and writes;
 * recorder_mcap.c writes the MCAP file. Not RT-safe unless noted.
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

/* Kinds of reports of recorder_next_event. Values below RECORDER_FILES are numbers of files. */
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

/* Counts of items offered to the rings. The pushing thread writes a count; any thread may read
 * it. */
struct recorder_tally {
    _Atomic uint64_t frames, rows, events, frames_dropped, rows_dropped, events_dropped;
};

/* Events sorted by time. They wait, because an earlier event may still arrive. */
struct recorder_order {
    struct event_item *item;
    size_t count;
    int64_t settled_ns; /* time of the latest event that has waited long enough */
};

/* Problems of a file that have been reported. */
struct file_reports {
    bool moved, ended;
};

struct recorder {
    struct recorder_config config;
    struct ring frames, rows, events;
    size_t nvalue; /* numbers in a row: signals, then poses */
    double *row;   /* scratch of the loop: time in whole ns, then the values */
    char *line;    /* scratch of the recorder's thread: one line of any file */
    struct recorder_order order;
    struct recorder_tally tally;
    struct line_file file[RECORDER_FILES];
    bool has[RECORDER_FILES];   /* the files of this recording */
    struct recorder_mcap *mcap; /* NULL = none */
    bool made_directory;
    pthread_t thread;
    _Atomic uint64_t beat; /* changes while the thread makes progress */
    int64_t tend_ns;       /* time of the next flush and check of the files */
    atomic_bool stop, ended;
    atomic_bool given_up;

    /* Used only by the thread that asks for reports */
    struct file_reports reports[RECORDER_FILES];
    bool given_up_reported;
    uint64_t drops_reported;
    int64_t drops_reported_ns;
};

/* ---- recorder_thread.c ---- */

enum {
    RECORDER_NUMBER = 32, /* most bytes of a number and its comma in a line */
    RECORDER_HELD = 1024, /* most events that wait to be sorted */
    RECORDER_LINE = 512,  /* buffer for a line of candump.log or events.log */
};

/* The thread's function; context is the recorder. */
void *recorder_thread_main(void *context);

#endif
