/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The page: a browser, or a program, looks at a running simulator and, with the right to, controls
 * it. Serves HTTP and WebSockets at one address; docs/page.md is the manual and has every message.
 *
 * Two rights, each with a token of its own: to look, and to control. A
 * page gets its token in the fragment of its address, which no browser sends to anybody, and hands
 * it over in its first message. Who may only look can neither change the simulator nor send frames.
 * A request has to name the address that the server is bound to as its Host, and its pages as its
 * Origin (viewer/http_request.h).
 *
 * What a client asks is carried out by the control socket (control/control.h), to which the
 * viewer connects once for each client with the right to control; `coman-hil ctl` does the same.
 * Frames are sent and heard by ports of its own, as any participant of the buses has them.
 *
 * One thread does all the work. It takes what the loop publishes (sim/simulator.h) and never makes
 * it wait. Its memory is bounded: VIEWER_CLIENTS connections with an inbox and an outbox each.
 * States that a slow client has no room for are skipped and counted; one that takes nothing for
 * 10 s is disconnected and counted. Not RT-safe.
 *
 * A recording is served in the same way: states, frames and events are those of the files, at the
 * time that each client has chosen for itself, and nobody can control what is over.
 */
#ifndef VIEWER_VIEWER_H
#define VIEWER_VIEWER_H

#include "base/arena.h"
#include "base/error.h"
#include "base/journal.h"
#include "sim/buses.h"
#include "sim/simulator.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    VIEWER_CLIENTS = 32,        /* connections at a time */
    VIEWER_ENTERED = 16,        /* of them with a token, */
    VIEWER_LOOKING = 15,        /* of which with that to look: the last place is for control */
    VIEWER_OF_ONE = 8,          /* with that to look, of one address but this machine's own */
    VIEWER_ASKING = 12,         /* without a token, of one address */
    VIEWER_INBOX = 32 * 1024,   /* longest message of a client, with its header */
    VIEWER_OUTBOX = 512 * 1024, /* what waits for a client */
    VIEWER_TOKEN = 33,          /* letters of a token, and a zero */
    VIEWER_RATE_HZ = 60,        /* states a second at most */
    VIEWER_EVENT_TEXT = 240,
    VIEWER_PROTOCOL = 1,
    VIEWER_POINTS = 8000, /* rows of a series at most */
};

#define VIEWER_TIME_S 9e9 /* greatest time that a message may have */

struct viewer_config {
    struct simulator *simulator;
    const char *host;        /* numeric; NULL = 127.0.0.1 */
    uint16_t port;           /* 0 = any that is free */
    const char *control;     /* path of the control socket; NULL = nobody may control */
    const char *token[2];    /* to look and to control, of VIEWER_TOKEN; NULL = made anew */
    struct bus_ports *ports; /* of simulator_join; NULL = no trace and no frames to send */

    /* Instead of simulator, control and ports: a recording to be played back, each client at its
     * own time, and the rig that was recorded */
    const struct recording *recording;
    const struct rig *rig;
    const struct recording *with; /* to compare it with, of the same rig; NULL = none */
};

struct viewer_counters {
    uint64_t clients; /* that have given a token */
    uint64_t refused; /* connections without place, requests with a wrong Host, Origin or token */
    uint64_t cut_junk, cut_slow, cut_silent;
    uint64_t cut_idle; /* connections without a token that made room for others */
    uint64_t states, skipped_states;
    uint64_t frames_sent, frames_untaken; /* of clients, to the buses */
};

struct viewer;

/* Checks whether a mesh of a robot's looks can be shown, as far as the beginning and the size of
 * its file tell. ERROR_INPUT, ERROR_SYSTEM with the reason, for people. Not RT-safe. */
enum error_code viewer_check_visual(const struct robot_visual *visual, struct error *error);

/* ---- a recording ---- */

struct recording_config {
    const char *directory;
    const struct rig *rig;
    double from_s, to_s; /* what is shown of it; infinite = all */
    double speed;        /* with which clients begin */
};

struct recording;

/* Opens the files of a recording as CSV (viewer/recorded.h); those of frames and of events may be
 * missing. Everything given is borrowed, memory is from arena and the heap. ERROR_INPUT when the
 * recording is none, or not of this rig. *recording is to be closed in any case. */
enum error_code recording_open(const struct recording_config *config, struct arena *arena,
                               struct recording **recording, struct error *error);
void recording_close(struct recording *recording); /* NULL is allowed */

/* Return how long a recording is, and how many of its frames have an interface that the rig does
 * not. */
double recording_duration_s(const struct recording *recording);
uint64_t recording_strange_frames(const struct recording *recording);

/* ---- the server ---- */

/* Listens and starts the thread; after simulator_create and before simulator_start, so that the
 * thread has the rights and processors of any other. Everything given is borrowed until
 * viewer_destroy. ERROR_INPUT: the host is no numeric address; ERROR_SYSTEM, ERROR_MEMORY. */
enum error_code viewer_start(const struct viewer_config *config, struct viewer **viewer,
                             struct error *error);

/* Begins to serve clients; after simulator_start. NULL is allowed. */
void viewer_serve(struct viewer *viewer);

/* Return the tokens, to look and to control, and the port: what the next run needs for the same
 * addresses. A token has VIEWER_TOKEN - 1 lower-case hexadecimal digits. */
const char *viewer_token(const struct viewer *viewer, bool control);
uint16_t viewer_port(const struct viewer *viewer);

/* Returns the address of the page for those who may control, or only look: what to print. ""
 * when nobody may control. Owned by the viewer. */
const char *viewer_address(const struct viewer *viewer, bool control);

/* Adds an event of the run to the time line; from any thread but the loop's. */
void viewer_put_event(struct viewer *viewer, enum journal_priority priority, const char *text);

/* How a run has ended. */
struct viewer_end {
    bool failed, stays;    /* stays: viewer_linger follows */
    const char *text;      /* "ran its length" */
    double time_s;         /* virtual */
    const char *task;      /* NULL = none, */
    const char *task_text; /* and its message at the end; NULL = none */
    const char *recording; /* its folder, whose files are complete when stays; NULL = none */
};

/* Sends the clients the outcome of the run, after the loop has ended. Clients that asked to stay
 * are still served, with the last state, the history and the files of the recording; the others
 * are disconnected. ERROR_MEMORY. */
enum error_code viewer_end(struct viewer *viewer, const struct viewer_end *end,
                           struct error *error);

/* Checks whether a client is connected that stays at the end of a run. NULL is allowed. */
bool viewer_is_watched(const struct viewer *viewer);

/* Waits, after viewer_end, until no client that stays has been there for two seconds, for so
 * long at most, or until stopped(context), which is asked twenty times a second. */
void viewer_linger(const struct viewer *viewer, double longest_s, bool (*stopped)(void *context),
                   void *context);

/* Tells the clients, when the loop has ended, and closes every connection. NULL is allowed. */
void viewer_stop(struct viewer *viewer);

/* Copies the counters, no older than the last turn of the thread. */
void viewer_counters(struct viewer *viewer, struct viewer_counters *counters);
void viewer_destroy(struct viewer *viewer); /* NULL is allowed */

#endif
