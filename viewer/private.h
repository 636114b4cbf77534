/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the files of the page's server. server.c has the thread. connection.c
 * moves bytes from and to clients. http_respond.c answers HTTP requests. message.c executes
 * messages of clients, or passes them to the control socket. hello.c describes run and scene.
 * state_message.c writes the binary states. series.c sends rows. trace.c receives frames from the
 * buses. All functions run in the server's thread, unless viewer.h says otherwise. Not RT-safe.
 */
#ifndef VIEWER_PRIVATE_H
#define VIEWER_PRIVATE_H

#include "viewer/history.h"
#include "viewer/message.h"
#include "viewer/recorded.h"
#include "viewer/http_request.h"
#include "viewer/viewer.h"
#include "viewer/websocket.h"

#include <pthread.h>
#include <string.h>

enum {
    VIEWER_EVENTS = 256,       /* stored events, for pages that connect late; a power of two */
    VIEWER_SIGNALS = 64,       /* maximum number of signals of a client */
    VIEWER_TRACE = 128 * 1024, /* bytes of frames that wait for the next state */
    VIEWER_LINE = 256 * 1024,  /* longest answer of the control socket, bytes */
    VIEWER_MESHES = 1024,
    VIEWER_VISUAL_BYTES = 128 << 20, /* bytes of the files of all visuals together */
    VIEWER_FILES = 6,                /* files of a recording */
};

enum viewer_mode { CLIENT_HTTP, CLIENT_SOCKET, CLIENT_CLOSING };
enum viewer_right { RIGHT_NONE, RIGHT_LOOK, RIGHT_CONTROL };
enum viewer_order { VIEWER_ORDER_WAIT, VIEWER_ORDER_SERVE, VIEWER_ORDER_END, VIEWER_ORDER_STOP };

struct viewer_watch {
    bool on;
    int64_t period_ns, due_ns;
    bool trace, rows;
    size_t nsignal;
    uint16_t signal[VIEWER_SIGNALS];
    uint32_t skipped;
};

/* A client's position and speed in a recording. */
struct viewer_playback {
    bool paused;
    double speed;              /* recorded seconds per second */
    int64_t from_ns, since_ns; /* recorded time from_ns was shown at clock time since_ns */
    int64_t traced_ns;         /* frames up to this time have been sent */
};

/* Source address of a connection: an IPv6 address, or a mapped IPv4 address. */
struct viewer_origin {
    uint8_t byte[16];
};

struct viewer_client {
    int socket; /* -1 = unused */
    struct viewer_origin origin;
    enum viewer_mode mode;
    enum viewer_right right;
    bool stays;       /* stays connected when the run has ended */
    bool end_told;    /* the end of the run was sent to it */
    int64_t since_ns; /* time of the connection */
    int64_t taken_ns; /* time at which the last byte was sent, or the outbox began to fill */

    size_t received;
    uint8_t *inbox;   /* size VIEWER_INBOX */
    size_t gathered;  /* bytes of a fragmented message */
    uint8_t *message; /* size VIEWER_INBOX */
    bool fragmented;

    size_t sent, filled;
    uint8_t *outbox;  /* size VIEWER_OUTBOX; bytes from sent to filled are waiting */
    const void *body; /* data after the outbox: constant memory of the viewer */
    size_t body_size;

    struct viewer_watch watch;
    struct viewer_playback playback;
    uint8_t *trace; /* size VIEWER_TRACE */
    size_t traced;  /* bytes in trace */
    uint32_t ntraced, trace_lost;
    uint64_t events;    /* number of the next event to send */
    uint64_t row;       /* next row of the history to send */
    uint64_t rows_lost; /* viewer->rows_lost when rows were last sent */

    int control; /* connection to the control socket, -1 = none */
    char *line;  /* size VIEWER_LINE, for answers of the control socket */
    size_t line_size;
};

struct viewer_event {
    enum journal_priority priority;
    char text[VIEWER_EVENT_TEXT];
};

/* The content of an HTTP answer: bytes and their media type. */
struct viewer_file {
    const char *type;
    const void *data;
    size_t size;
    bool gzip;
};

struct viewer {
    struct viewer_config config;
    const struct rig *rig;
    struct arena arena;
    struct http_bound bound;
    char token[2][VIEWER_TOKEN]; /* tokens of the rights to look and to control */
    char address[2][256];
    int listener, event;
    _Atomic int order; /* enum viewer_order */
    pthread_t thread;
    int64_t now_ns;
    struct viewer_counters counters;

    struct simulator_view view;
    bool wanted;                /* the simulator is requested to make views */
    bool awaited;               /* the simulator has made no view since the request */
    uint64_t views_before;      /* number of views at the time of the request */
    int64_t awaited_till_ns;    /* until then the old view is accepted */
    struct body_motion *motion; /* motion of the robot's bodies */
    uint8_t *state;             /* the state under construction */
    size_t state_max;
    size_t *torque, *wrench, *free; /* columns of signals, by joint, contact and free body */
    const char *const *signal;      /* names of the signals */
    size_t nsignal;
    struct playback *playback; /* NULL: shows the simulator */
    struct stream *stream;     /* rows of the loop; NULL = none */
    struct history *history;   /* history of these rows; NULL = none */
    uint64_t rows_lost;        /* rows lost because the stream was full */
    bool rows_hurry;           /* many rows were waiting at the last read */

    int64_t measured_ns, measured_at_ns; /* virtual time and clock time of the last measurement */
    uint64_t measured_bits[RIG_BUSES_MAX];
    double load[RIG_BUSES_MAX]; /* busy share of a bus */
    uint64_t work_count;        /* number of ticks until the last measurement */
    int64_t work_sum;
    /* tick duration: mean since the last measurement; 99th percentile and maximum of the run */
    double work_us[3];
    struct histogram *histogram;

    char *hello; /* JSON, made once; on the heap */
    size_t hello_size;
    char *database; /* JSON of the buses' messages, made on first use; on the heap */
    size_t database_size;
    struct viewer_file *mesh;   /* by surface; data NULL = not made yet */
    struct viewer_file *visual; /* by visual of the robot; data NULL = not made yet */
    size_t visual_bytes;        /* bytes of all visuals */

    bool ended; /* the run has ended, and viewer_end has set the following: */
    char *end;  /* JSON; on the heap */
    size_t end_size;
    struct recorded_file file[VIEWER_FILES]; /* files of its recording */
    _Atomic unsigned staying;                /* number of clients that stay */
    char run[VIEWER_TOKEN];                  /* identifies the run; pages reload when it changes */

    struct viewer_counters told; /* counters, for other threads */
    pthread_mutex_t events_lock; /* protects told and the members after it */
    uint64_t nevent;             /* total number of events */
    struct viewer_event events[VIEWER_EVENTS];

    int64_t frame_ns[RIG_BUSES_MAX]; /* newest time of a frame */
    struct viewer_client client[VIEWER_CLIENTS];
};

/* ---- connection.c ---- */

/* Returns space for this many bytes at the outbox's end; the caller adds them to filled. NULL = no
 * space. */
uint8_t *client_room(struct viewer *viewer, struct viewer_client *client, size_t size);

void client_flush(struct viewer *viewer, struct viewer_client *client);
size_t client_waiting(const struct viewer_client *client);
void client_close(struct viewer *viewer, struct viewer_client *client);

/* Sends a complete WebSocket message; returns false and drops it if there is no space. */
bool client_send_message(struct viewer *viewer, struct viewer_client *client,
                         enum websocket_opcode opcode, const void *data, size_t size);

/* Sends an object as a message and takes ownership of it; NULL counts as no memory. */
bool client_send_object(struct viewer *viewer, struct viewer_client *client, json_t *object);

/* Sends the client the reason for closing, and closes after all waiting bytes are sent. */
void client_bye(struct viewer *viewer, struct viewer_client *client, enum websocket_status status,
                const char *reason);

/* Reads received bytes, or the end of the connection. */
void client_read(struct viewer *viewer, struct viewer_client *client);

/* Drops a client whose connection has ended or that was too slow; called once per turn. */
void client_check(struct viewer *viewer, struct viewer_client *client);

void viewer_accept_client(struct viewer *viewer);

/* Reserves a place for a client with a valid token; returns false if no place is free. */
bool viewer_give_place(struct viewer *viewer, struct viewer_client *client,
                       enum viewer_right right);

/* ---- server.c ---- */

void viewer_give_order(struct viewer *viewer, enum viewer_order order);

/* ---- run_end.c ---- */

/* Sends a client the end of the run, once; disconnects it unless it stays. */
void client_tell_end(struct viewer *viewer, struct viewer_client *client);

/* Finds a file of the recording by its name; returns false if there is none. */
bool viewer_find_file(const struct viewer *viewer, const char *name, struct viewer_file *file);

/* Publishes the number of clients that stay. */
void viewer_count_staying(struct viewer *viewer);

/* ---- http_respond.c ---- */

/* Answers an HTTP request, or changes its connection to a WebSocket. */
void viewer_respond(struct viewer *viewer, struct viewer_client *client, int status,
                    const struct http_request *request);

/* Returns the right that a token gives. */
enum viewer_right viewer_token_right(const struct viewer *viewer, const char *token);

/* ---- message.c ---- */

/* Executes a client's message, which should be JSON. */
void viewer_obey(struct viewer *viewer, struct viewer_client *client, const char *text,
                 size_t size);

void control_link_close(struct viewer_client *client);
/* Reads answers of the control socket and passes them to the client. */
void control_link_read(struct viewer *viewer, struct viewer_client *client);

/* ---- hello.c, database.c, stl_file.c ---- */

/* Returns the description of a run, without its changing values; NULL = no memory. */
json_t *viewer_hello(const struct viewer *viewer);
json_t *hello_scene(const struct viewer *viewer);

/* Writes the JSON description of all buses' messages (database.c); returns false without memory. */
bool viewer_make_database(struct viewer *viewer);

/* Returns the file with a surface's triangles; NULL = it has none, or no memory. */
const struct viewer_file *viewer_mesh_file(struct viewer *viewer, size_t surface);

/* Returns the STL file of a visual, read on first use. Returns NULL, with a reason to display, on
 * failure. */
const struct viewer_file *viewer_visual_file(struct viewer *viewer, size_t visual,
                                             struct error *error);

/* Returns the index of the first visual that uses the same file. */
size_t viewer_visual_source(const struct robot *robot, size_t visual);

/* ---- state_message.c ---- */

/* Finds the column with the title before + name + after; SIZE_MAX = none. */
size_t viewer_find_column(const char *const *title, size_t count, const char *before,
                          const char *name, const char *after);

enum error_code viewer_create_state(struct viewer *viewer, struct error *error);

/* Sends the events since the last one that was sent to the client. */
void client_send_events(struct viewer *viewer, struct viewer_client *client);

/* Sends due states to all clients that watch. */
void viewer_send_states(struct viewer *viewer);

/* ---- trace.c ---- */

/* Receives frames from the buses and stores them for clients that trace. */
void viewer_hear_buses(struct viewer *viewer);
void viewer_trace_frame(struct viewer *viewer, size_t bus, const struct bus_frame *frame,
                        bool ours);
void client_trace_frame(struct viewer_client *client, size_t bus, const struct bus_frame *frame,
                        uint8_t flags);
void client_send_trace(struct viewer *viewer, struct viewer_client *client);

/* ---- series.c ---- */

/* Creates the history of a simulator's rows. */
enum error_code viewer_create_history(struct viewer *viewer, struct error *error);

/* Moves waiting rows from the loop's stream to the history. */
void viewer_take_rows(struct viewer *viewer);

/* Sends a client the new rows of its signals, if it wants rows. */
void client_send_rows(struct viewer *viewer, struct viewer_client *client);

/* ---- playback.c, series.c ---- */

/* An open recording. */
struct recording {
    struct recording_config config;
    struct recorded_table signals, poses;
    struct recorded_log log;     /* without data if there is no file */
    struct recorded_file events; /* without data if there is no file */
    int64_t first_ns, last_ns;   /* first and last time shown */
    int64_t period_ns;           /* period of the rows */
    size_t *angle;               /* columns of the joints' angles */
};

/* Playback state: buffers for one row of each table, and the traffic of the buses. */
struct playback {
    double *signal, *pose; /* buffers for one row */
    size_t *body;          /* first column of each body's pose */
    struct recorded_traffic now[RIG_BUSES_MAX], before[RIG_BUSES_MAX];
    int64_t counted_ns; /* recorded time of the counters in now */
};

/* Creates the playback state, which replaces the view of a simulator. */
enum error_code viewer_create_playback(struct viewer *viewer, struct error *error);

/* Sets a new client to the start of the recording. */
void playback_begin(const struct viewer *viewer, struct viewer_client *client);

/* Fills viewer->view with the recorded values at the client's time. */
void playback_view(struct viewer *viewer, struct viewer_client *client);

/* Returns the pose of a body in viewer->view: position (m), quaternion wxyz. */
const double *playback_pose(const struct viewer *viewer, size_t body);

/* Stores the frames since the client's last state. After a jump, stores the frames just before the
 * target. */
void playback_trace(struct viewer *viewer, struct viewer_client *client);

/* Executes a message that controls a client's playback: pause, resume, seek, speed. Returns false,
 * with the reason, if a recording cannot do it. */
bool playback_obey(struct viewer *viewer, struct viewer_client *client,
                   const struct viewer_message *message, struct error *error);

/* Sends the values of signals between two times. Returns false, with the reason, on failure. */
bool client_send_series(struct viewer *viewer, struct viewer_client *client,
                        const struct viewer_message *message, struct error *error);

/* ---- put_*: write a little-endian number and return the address after it ---- */

static inline uint8_t *put_u8(uint8_t *to, uint8_t value)
{
    *to = value;
    return to + 1;
}

static inline uint8_t *put_u16(uint8_t *to, uint16_t value)
{
    put_u16_le(to, value);
    return to + 2;
}

static inline uint8_t *put_u32(uint8_t *to, uint32_t value)
{
    put_u32_le(to, value);
    return to + 4;
}

static inline uint8_t *put_u64(uint8_t *to, uint64_t value)
{
    put_u32_le(to, (uint32_t)value);
    put_u32_le(to + 4, (uint32_t)(value >> 32));
    return to + 8;
}

static inline uint8_t *put_f32(uint8_t *to, double value)
{
    const float narrow = (float)value;
    uint32_t bits;

    memcpy(&bits, &narrow, sizeof bits);
    return put_u32(to, bits);
}

#endif
