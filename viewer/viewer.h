/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Serves the page, which shows a running simulator in a browser. A client with the right to control
 * can also control the simulator. A client is a browser or any program. HTTP and WebSockets share
 * one address. docs/page.md is the manual and lists all messages.
 *
 * There are two rights, each with its own token: to look, and to control. A page finds its token in
 * the fragment of its address, which browsers do not send to servers. The page sends the token in
 * its first message. A client with only the right to look can neither change the simulator nor send
 * frames. The Host of a request must be the server's bound address, and its Origin must be the
 * origin of the server's own pages (viewer/http_request.h).
 *
 * The control socket (control/control.h) executes the requests of clients. The viewer connects to
 * it once for each client with the right to control, as `coman-hil ctl` does. The viewer has its
 * own ports to send and receive frames, like any participant of the buses.
 *
 * One thread does all the work. It reads the data that the loop publishes (sim/simulator.h), and
 * never blocks the loop. Its memory is bounded: VIEWER_CLIENTS connections with an inbox and an
 * outbox each. If a slow client's outbox has no space for a state, the state is skipped and
 * counted. A client that reads nothing for 10 s is disconnected and counted. Not RT-safe.
 *
 * A recording is served in the same way, with states, frames and events from its files. Each client
 * chooses its own time in the recording. A recording cannot be controlled.
 */
#ifndef VIEWER_VIEWER_H
#define VIEWER_VIEWER_H

#include "base/arena.h"
#include "base/error.h"
#include "base/journal.h"
#include "sim/buses.h"
#include "sim/simulator.h"

enum {
    VIEWER_CLIENTS = 32, /* maximum number of connections */
    VIEWER_ENTERED = 16, /* maximum number of clients with a token, */
    /* of these, with the right to look: one place is reserved for control */
    VIEWER_LOOKING = 15,
    VIEWER_OF_ONE = 8,          /* with the right to look, from one remote address */
    VIEWER_ASKING = 12,         /* without a token, from one address */
    VIEWER_INBOX = 32 * 1024,   /* longest message of a client, with its header, bytes */
    VIEWER_OUTBOX = 512 * 1024, /* waiting data for a client, bytes */
    VIEWER_TOKEN = 33,          /* letters of a token, and a terminating zero */
    VIEWER_RATE_HZ = 60,        /* maximum number of states per second */
    VIEWER_EVENT_TEXT = 240,
    VIEWER_PROTOCOL = 1,
    VIEWER_POINTS = 8000, /* maximum number of rows in a series */
};

#define VIEWER_TIME_S 9e9 /* largest time in a message */

struct viewer_config {
    struct simulator *simulator;
    const char *host;        /* numeric; NULL = 127.0.0.1 */
    uint16_t port;           /* 0 = any free port */
    const char *control;     /* path of the control socket; NULL = no control */
    const char *token[2];    /* tokens to look and to control; NULL = make new ones */
    struct bus_ports *ports; /* from simulator_join; NULL = no trace and no sending of frames */

    /* For playback: a recording and its rig; simulator, control and ports are then unused */
    const struct recording *recording;
    const struct rig *rig;
    /* a second recording of the same rig, for comparison; NULL = none */
    const struct recording *with;
};

struct viewer_counters {
    uint64_t clients; /* clients with a token */
    /* refused: connections without a free place; requests with a wrong Host, Origin or token */
    uint64_t refused;
    uint64_t cut_junk, cut_slow, cut_silent;
    uint64_t cut_idle; /* connections without a token that were closed to make room */
    uint64_t states, skipped_states;
    uint64_t frames_sent, frames_untaken; /* clients' frames: sent, and refused by a bus */
};

struct viewer;

/* Checks whether the page can show the mesh of a visual, from the header and the size of its file.
 * Returns ERROR_INPUT or ERROR_SYSTEM with a reason to display. Not RT-safe. */
enum error_code viewer_check_visual(const struct robot_visual *visual, struct error *error);

/* ---- a recording ---- */

struct recording_config {
    const char *directory;
    const struct rig *rig;
    double from_s, to_s; /* the shown part; infinite = all */
    double speed;        /* initial speed of clients */
};

struct recording;

/* Opens the CSV files of a recording (viewer/recorded.h), and the files of frames and events
 * if they exist. All arguments are borrowed; memory is from the arena and the heap. Returns
 * ERROR_INPUT if the folder is not a recording of this rig. Close *recording also after an
 * error. */
enum error_code recording_open(const struct recording_config *config, struct arena *arena,
                               struct recording **recording, struct error *error);
void recording_close(struct recording *recording); /* NULL is allowed */

/* Return the length of a recording in seconds, and the number of its frames whose interface is not
 * in the rig. */
double recording_duration_s(const struct recording *recording);
uint64_t recording_strange_frames(const struct recording *recording);

/* ---- the server ---- */

/* Opens the socket and starts the thread. Call it after simulator_create and before
 * simulator_start, so that the thread does not inherit real-time priority and processors. All
 * arguments are borrowed until viewer_destroy. Returns ERROR_INPUT if the host is not a numeric
 * address, ERROR_SYSTEM, or ERROR_MEMORY. */
enum error_code viewer_start(const struct viewer_config *config, struct viewer **viewer,
                             struct error *error);

/* Begins to serve clients; call it after simulator_start. NULL is allowed. */
void viewer_serve(struct viewer *viewer);

/* Return the tokens to look and to control, and the port, so that the next run can use the same
 * addresses. A token has VIEWER_TOKEN - 1 lower-case hexadecimal digits. */
const char *viewer_token(const struct viewer *viewer, bool control);
uint16_t viewer_port(const struct viewer *viewer);

/* Returns the address of the page, with the token to control or to look. "" if control is not
 * possible. The viewer owns the text. */
const char *viewer_address(const struct viewer *viewer, bool control);

/* Adds an event of the run to the timeline. Call it from any thread except the loop's. */
void viewer_put_event(struct viewer *viewer, enum journal_priority priority, const char *text);

/* The end of a run. */
struct viewer_end {
    bool failed, stays;    /* stays: viewer_linger will be called */
    const char *text;      /* reason, for example "ran its length" */
    double time_s;         /* virtual time */
    const char *task;      /* name of the task; NULL = none */
    const char *task_text; /* last message of the task; NULL = none */
    const char *recording; /* folder of the recording, with complete files if stays; NULL = none */
};

/* Sends the outcome of the run to the clients, after the loop has ended. Clients that asked to stay
 * can still get the last state, the history and the files of the recording. Other clients are
 * disconnected. Returns ERROR_MEMORY. */
enum error_code viewer_end(struct viewer *viewer, const struct viewer_end *end,
                           struct error *error);

/* Returns whether a client that stays after the end of a run is connected. NULL is allowed. */
bool viewer_is_watched(const struct viewer *viewer);

/* Waits after viewer_end, while clients that stay are connected. Returns two seconds after the
 * last of them has left, after longest_s, or when stopped(context) returns true. stopped is called
 * twenty times per second. */
void viewer_linger(const struct viewer *viewer, double longest_s, bool (*stopped)(void *context),
                   void *context);

/* Sends the end to the clients, and closes all connections. Call it after the loop has ended. NULL
 * is allowed. */
void viewer_stop(struct viewer *viewer);

/* Copies the counters. They were updated in the thread's last turn. */
void viewer_counters(struct viewer *viewer, struct viewer_counters *counters);
void viewer_destroy(struct viewer *viewer); /* NULL is allowed */

#endif
