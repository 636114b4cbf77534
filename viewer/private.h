/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the page's server share: server.c has the thread, connection.c the bytes
 * from and to a client, http_respond.c answers requests of HTTP, message.c carries out what a
 * client asks, or passes it on to the control socket; hello.c describes run and scene,
 * state_message.c makes the binary states, series.c sends rows, trace.c hears the buses. All in
 * the server's thread but for what viewer.h says. Not RT-safe.
 */
#ifndef VIEWER_PRIVATE_H
#define VIEWER_PRIVATE_H

#include "base/arena.h"
#include "sim/simulator.h"
#include "viewer/history.h"
#include "viewer/message.h"
#include "viewer/recorded.h"
#include "viewer/http_request.h"
#include "viewer/viewer.h"
#include "viewer/websocket.h"

#include <jansson.h>
#include <pthread.h>
#include <string.h>

enum {
    VIEWER_EVENTS = 256,       /* that a page gets which comes late; a power of two */
    VIEWER_SIGNALS = 64,       /* that a client may choose */
    VIEWER_TRACE = 128 * 1024, /* bytes of frames that wait for the next state */
    VIEWER_LINE = 256 * 1024,  /* longest answer of the control socket */
    VIEWER_MESHES = 1024,
    VIEWER_VISUAL_BYTES = 128 << 20, /* of the files of all visuals together */
    VIEWER_FILES = 6,                /* of a recording */
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

/* Where in a recording a client is, and how it goes on from there. */
struct viewer_playback {
    bool paused;
    double speed;              /* recorded seconds a second */
    int64_t from_ns, since_ns; /* the recorded time at a time of the clock */
    int64_t traced_ns;         /* frames up to this time have been sent */
};

/* Where a connection comes from: an IPv6 address, or an IPv4 one mapped to such. */
struct viewer_origin {
    uint8_t byte[16];
};

struct viewer_client {
    int socket; /* -1 = free place */
    struct viewer_origin origin;
    enum viewer_mode mode;
    enum viewer_right right;
    bool stays;       /* goes on when the run has ended */
    bool end_told;    /* the end of the run has been sent to it */
    int64_t since_ns; /* when it connected */
    int64_t taken_ns; /* when the last byte was taken, or the outbox began to fill */

    size_t received;
    uint8_t *inbox;   /* VIEWER_INBOX */
    size_t gathered;  /* of a message in fragments */
    uint8_t *message; /* VIEWER_INBOX */
    bool fragmented;

    size_t sent, filled;
    uint8_t *outbox;  /* VIEWER_OUTBOX; sent to filled wait */
    const void *body; /* what follows the outbox: memory of the viewer's that does not change */
    size_t body_size;

    struct viewer_watch watch;
    struct viewer_playback playback;
    uint8_t *trace; /* VIEWER_TRACE */
    size_t traced;  /* bytes */
    uint32_t ntraced, trace_lost;
    uint64_t events; /* the number of the next event to tell it */
    uint64_t row;    /* of the history, the next to tell it; rows before it that it has not got: */
    uint64_t rows_lost;

    int control; /* connection to the control socket, -1 = none */
    char *line;  /* VIEWER_LINE, of its answers */
    size_t line_size;
};

struct viewer_event {
    enum journal_priority priority;
    char text[VIEWER_EVENT_TEXT];
};

/* A file that the server has: bytes and what they are. */
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
    char token[2][VIEWER_TOKEN]; /* to look, to control */
    char address[2][256];
    int listener, event;
    _Atomic int order; /* enum viewer_order */
    pthread_t thread;
    int64_t now_ns;
    struct viewer_counters counters;

    struct simulator_view view;
    bool wanted;                /* views are made */
    bool awaited;               /* none has been made since they are wanted */
    uint64_t views_before;      /* how many had been made then */
    int64_t awaited_till_ns;    /* the one that there is will do */
    struct body_motion *motion; /* of the robot's bodies */
    uint8_t *state;             /* one under construction */
    size_t state_max;
    size_t *torque, *wrench, *free; /* columns of signals, by joint, contact and free body */
    const char *const *signal;      /* names */
    size_t nsignal;
    struct playback *playback; /* NULL: the simulator is shown */
    struct stream *stream;     /* rows of the loop; NULL = none */
    struct history *history;   /* of them; NULL likewise */
    uint64_t rows_lost;        /* that found the stream full */
    bool rows_hurry;           /* many waited in it the last time */

    int64_t measured_ns, measured_at_ns; /* virtual time and clock of the last measure */
    uint64_t measured_bits[RIG_BUSES_MAX];
    double load[RIG_BUSES_MAX]; /* share of a bus's time */
    uint64_t work_count;        /* ticks up to then */
    int64_t work_sum;
    double work_us[3]; /* of a tick: mean of late, 99th percentile and maximum of all */
    struct histogram *histogram;

    char *hello; /* JSON, made once; on the heap */
    size_t hello_size;
    char *database; /* JSON of the buses' messages, made when first asked for; on the heap */
    size_t database_size;
    struct viewer_file *mesh;   /* by surface; data NULL = not made yet */
    struct viewer_file *visual; /* by visual of the robot, likewise */
    size_t visual_bytes;        /* of all of them */

    bool ended; /* the run is over, and viewer_end has set the following: */
    char *end;  /* JSON; on the heap */
    size_t end_size;
    struct recorded_file file[VIEWER_FILES]; /* of its recording */
    _Atomic unsigned staying;                /* clients */
    char run[VIEWER_TOKEN]; /* distinguishes the run from others at the same address */

    struct viewer_counters told; /* counters, for other threads */
    pthread_mutex_t events_lock; /* protects told and what follows */
    uint64_t nevent;             /* in all */
    struct viewer_event events[VIEWER_EVENTS];

    int64_t frame_ns[RIG_BUSES_MAX]; /* newest time of a frame */
    struct viewer_client client[VIEWER_CLIENTS];
};

/* ---- connection.c ---- */

/* Returns room for so many bytes at the outbox's end, to be counted in filled; NULL = there is
 * none. */
uint8_t *client_room(struct viewer *viewer, struct viewer_client *client, size_t size);

void client_flush(struct viewer *viewer, struct viewer_client *client);
size_t client_waiting(const struct viewer_client *client);
void client_close(struct viewer *viewer, struct viewer_client *client);

/* Sends a whole WebSocket message; false = there was no room and it is dropped. */
bool client_send_message(struct viewer *viewer, struct viewer_client *client,
                         enum websocket_opcode opcode, const void *data, size_t size);

/* Sends an object, which is taken over, as a message; NULL counts as no memory. */
bool client_send_object(struct viewer *viewer, struct viewer_client *client, json_t *object);

/* Tells the client why it is disconnected, and closes when what waits has been sent. */
void client_bye(struct viewer *viewer, struct viewer_client *client, enum websocket_status status,
                const char *reason);

/* Reads bytes that have come, or the end of the connection. */
void client_read(struct viewer *viewer, struct viewer_client *client);

/* Once a turn: drops a client that has ended or was too slow. */
void client_check(struct viewer *viewer, struct viewer_client *client);

void viewer_accept_client(struct viewer *viewer);

/* Gives a client that has shown a token a place among those that have; false = there is none. */
bool viewer_give_place(struct viewer *viewer, struct viewer_client *client,
                       enum viewer_right right);

/* ---- server.c ---- */

void viewer_give_order(struct viewer *viewer, enum viewer_order order);

/* ---- run_end.c ---- */

/* Tells a client how the run has ended, once; it is disconnected unless it stays. */
void client_tell_end(struct viewer *viewer, struct viewer_client *client);

/* Finds a file of the recording by its name; false = there is none. */
bool viewer_find_file(const struct viewer *viewer, const char *name, struct viewer_file *file);

/* Publishes how many clients stay. */
void viewer_count_staying(struct viewer *viewer);

/* ---- http_respond.c ---- */

/* Answers a request of HTTP, or makes a WebSocket of its connection. */
void viewer_respond(struct viewer *viewer, struct viewer_client *client, int status,
                    const struct http_request *request);

/* Returns the right that a token gives. */
enum viewer_right viewer_token_right(const struct viewer *viewer, const char *token);

/* ---- message.c ---- */

/* Carries out a message of a client, which should be JSON. */
void viewer_obey(struct viewer *viewer, struct viewer_client *client, const char *text,
                 size_t size);

void control_link_close(struct viewer_client *client);
/* Reads answers of the control socket and passes them to the client. */
void control_link_read(struct viewer *viewer, struct viewer_client *client);

/* ---- hello.c, database.c, stl_file.c ---- */

/* Describes what does not change during a run; NULL = no memory. */
json_t *viewer_hello(const struct viewer *viewer);
json_t *hello_scene(const struct viewer *viewer);

/* Describes what the frames of all buses mean; false = no memory. */
bool viewer_make_database(struct viewer *viewer);

/* Returns the file of a surface's triangles; NULL = it has none, or no memory. */
const struct viewer_file *viewer_mesh_file(struct viewer *viewer, size_t surface);

/* Returns the STL file of a visual, read when first asked for; NULL with the reason, for people. */
const struct viewer_file *viewer_visual_file(struct viewer *viewer, size_t visual,
                                             struct error *error);

/* Returns the first visual with the same file. */
size_t viewer_visual_source(const struct robot *robot, size_t visual);

/* ---- state_message.c ---- */

/* Finds the column whose title is before + name + after; SIZE_MAX = none. */
size_t viewer_find_column(const char *const *title, size_t count, const char *before,
                          const char *name, const char *after);

enum error_code viewer_create_state(struct viewer *viewer, struct error *error);

/* Sends the events since those that the client was sent last. */
void client_send_events(struct viewer *viewer, struct viewer_client *client);

/* Sends what is due to every client that watches. */
void viewer_send_states(struct viewer *viewer);

/* ---- trace.c ---- */

/* Receives what the buses have carried, and keeps it for clients that trace. */
void viewer_hear_buses(struct viewer *viewer);
void viewer_trace_frame(struct viewer *viewer, size_t bus, const struct bus_frame *frame,
                        bool ours);
void client_trace_frame(struct viewer_client *client, size_t bus, const struct bus_frame *frame,
                        uint8_t flags);
void client_send_trace(struct viewer *viewer, struct viewer_client *client);

/* ---- rows.c ---- */

/* Begins the history of a simulator's rows. */
enum error_code viewer_create_history(struct viewer *viewer, struct error *error);

/* Moves the rows that wait in the loop's stream to the history. */
void viewer_take_rows(struct viewer *viewer);

/* Sends a client that wants them the rows of its signals since the last time. */
void client_send_rows(struct viewer *viewer, struct viewer_client *client);

/* ---- playback.c, series.c ---- */

/* A recording that is open. */
struct recording {
    struct recording_config config;
    struct recorded_table signals, poses;
    struct recorded_log log;     /* without a file where there is none */
    struct recorded_file events; /* likewise */
    int64_t first_ns, last_ns;   /* what is shown */
    int64_t period_ns;           /* of rows */
    size_t *angle;               /* columns of the joints' angles */
};

/* What playing back needs beside: room for a row of each table, and what the buses carried. */
struct playback {
    double *signal, *pose; /* whoever reads a row leaves it there */
    size_t *body;          /* first column of each body's pose */
    struct recorded_traffic now[RIG_BUSES_MAX], before[RIG_BUSES_MAX];
    int64_t counted_ns; /* the time of now */
};

/* Creates what playing back needs, instead of a view of a simulator. */
enum error_code viewer_create_playback(struct viewer *viewer, struct error *error);

/* Sets a client that has just come to the beginning of the recording. */
void playback_begin(const struct viewer *viewer, struct viewer_client *client);

/* Fills viewer->view with the recording at the client's time. */
void playback_view(struct viewer *viewer, struct viewer_client *client);

/* Returns the pose of a body in that view: position (m), quaternion wxyz. */
const double *playback_pose(const struct viewer *viewer, size_t body);

/* Keeps the frames since the last state, or the last ones before a jump, for the client. */
void playback_trace(struct viewer *viewer, struct viewer_client *client);

/* Pauses, resumes, jumps or changes the speed of a client's playback; false with the reason: a
 * recording cannot do what the message asks. */
bool playback_obey(struct viewer *viewer, struct viewer_client *client,
                   const struct viewer_message *message, struct error *error);

/* Sends the values of signals between two times; false with the reason. */
bool client_send_series(struct viewer *viewer, struct viewer_client *client,
                        const struct viewer_message *message, struct error *error);

/* ---- little-endian numbers into a buffer; each returns where the next goes ---- */

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
