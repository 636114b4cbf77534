/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control socket: other programs observe and control a running simulator over a unix stream
 * socket. Only its owner and root may use the socket (control/socket.h). `coman-hil ctl` is one of
 * these programs.
 *
 * Protocol. Each line is one JSON object (RFC 8259, UTF-8, unique keys, at most CONTROL_LINE
 * bytes). The client sends a request:
 *
 *     {"id": 7, "cmd": "set", "name": "supply_v", "value": 40}
 *
 * The server sends an answer that repeats the id. The id is a number or a string of at most 256
 * bytes. Without an id in the request, the id of the answer is null.
 *
 *     {"id": 7, "ok": true, "tick": 1250, "time_s": 1.25, "state_hash": "90c2f0e2d9a74b11"}
 *     {"id": 7, "ok": false, "code": "input", "error": "found ..., expected ..."}
 *
 * The server carries out and answers the requests of a client in order, one at a time. To pause a
 * long step, use a second connection. The server refuses unknown commands, unknown keys and values
 * out of range with the code "input", and suggests the nearest name. The other codes are "memory"
 * and the refusals by the simulation loop: "empty", "recording", "clock", "busy", "unavailable",
 * "cut" (a pause has ended the step) and "ended" (the run is over). Times are virtual; keys that
 * end in _s are in seconds. Numbers have 15 digits. NaN and infinities are null. Hashes are strings
 * of 16 hexadecimal digits.
 *
 * Commands, with their keys or the keys of their answers:
 *
 *   hello         program, version, protocol (1), rig, pid
 *   status        rig, file, robot_hash, task, recording, clock, speed, paused, clamped, tick,
 *                 tick_s, time_s, elapsed_s, overruns, lost_ticks, buses (load: mean since this
 *                 client's last status, or since the start), joints (rad) and contacts (force up,
 *                 N), both empty before the first tick, faults (the active ones), control (counters
 *                 of this socket)
 *   statistics    phases, wakeup and work: count, min, median, p99, max, mean in us, read while the
 *                 loop runs, so that one may include a tick more than another; overruns by phase,
 *                 late ticks, pauses, lockstep counters, all of the tick in the key tick
 *   list          what: "tunables", "faults", "bodies", "signals", "checkpoints" or "commands";
 *                 match: a pattern of names with * and ? (optional)
 *   get           name: of a tunable; answers value, unit, min, max
 *   set           name, value
 *   fault         name, on: true or false; the fault's time window then has no effect
 *   push          body; force_n, moment_nm: [x, y, z] in the world frame at the body's origin
 *                 (optional, 0); duration_s (optional; 0: until the next push). The answer has
 *                 ended_n and ended_nm, force and moment of the push that it ended; 0: none acted
 *   pause, resume take effect after the present tick
 *   step          count (optional, 1): number of ticks; answered when they have run
 *   speed         factor: virtual seconds per second, 0.001 to 1000; 0: as fast as possible
 *   reset         returns to the start
 *   checkpoint    slot (optional, 1): 1 to 3
 *   restore       slot (optional, 1): 0 to 3; 0 is the start
 *   wait          tick or time_s: answered when the simulation has reached it
 *   subscribe     signals: array of names or patterns with * and ?; period_ms (optional, 10): a
 *                 multiple of the tick. Its answer has signals: the names in the order of the
 *                 values. Replaces an earlier subscription of this connection.
 *   unsubscribe   its answer has the totals rows and missed
 *   stop          ends the run cleanly
 *
 * The simulation loop carries out set and the commands from fault to restore. Their answers have
 * the tick, time_s and state_hash at which they took effect. After a subscribe, the server sends
 * rows between the answers. Rows have no id:
 *
 *     {"time_s": 1.25, "tick": 1250, "values": [...]}
 *
 * There is one row for every tick that is a multiple of the period. The rows of a step come before
 * its answer. If the client or the server is too slow, rows are lost. The next row has their
 * number: "missed": 3.
 *
 * Limits. The server disconnects a client, with a message that has line and column, when the client
 *
 *   - sends CONTROL_JUNK_MAX invalid lines in a row (each CONTROL_LINE bytes of an endless line
 *     count as one line);
 *   - sends an incomplete line and then nothing for 30 s;
 *   - does not read its answers for 30 s.
 *
 * The server receives no further requests of a client while more than half of the client's
 * CONTROL_OUTBOX bytes are unsent. At most CONTROL_CLIENTS clients are connected. A further client
 * replaces the client that has been idle for the longest time. An idle client waits for no answer
 * and has no subscription. If no client is idle, one further client is accepted, which may only
 * pause, resume and stop the run. The server serves a half-closed connection until it has sent the
 * last answer or row.
 *
 * The server has its own thread. It uses only rt/requests.h and data that the loop publishes
 * (simulator_read, stream, histograms). So no client can delay a tick. Not RT-safe.
 */
#ifndef CONTROL_CONTROL_H
#define CONTROL_CONTROL_H

#include "rt/requests.h"
#include "sim/simulator.h"

enum {
    CONTROL_CLIENTS = 16,
    CONTROL_LINE = 64 * 1024,
    CONTROL_OUTBOX = 256 * 1024,
    CONTROL_JUNK_MAX = 16,
    CONTROL_PROTOCOL = 1,
};

struct control_config {
    struct simulator *simulator;
    struct requests *requests; /* the request queue of the simulator's loop */
    const char *path;          /* path of the socket; NULL = the default path for name */
    const char *name;          /* name of the instance, normally of the rig */
    /* timeout for an incomplete line and for unread answers, ns; 0 = 30 s */
    int64_t patience_ns;
};

struct control_counters {
    uint64_t clients; /* clients that have sent a request */
    uint64_t requests, refused_requests;
    uint64_t refused; /* connections refused: no place was free, or the user may not connect */
    uint64_t cut_junk, cut_slow, cut_silent, cut_idle;
    uint64_t rows, missed_rows;
};

struct control;

/* Opens the socket and starts the thread. Call it after simulator_create and before
 * simulator_start, so that the thread has normal priority and processors. Returns the errors of
 * control_socket_open and control_socket_open_default. */
enum error_code control_start(const struct control_config *config, struct control **control,
                              struct error *error);

/* Starts to serve clients. Call it after simulator_start: until then, no other thread may touch the
 * simulator's memory. Clients that connect earlier wait. NULL is allowed. */
void control_serve(struct control *control);

const char *control_path(const struct control *control);

/* Takes one line for the log: a client was disconnected, with the reason, or a client has stopped
 * the run. Returns false if there is none. Call it from one thread only. */
bool control_next_event(struct control *control, uint64_t *key, char *text, size_t size);

/* Returns whether a client has requested the end of the run, even after the run had ended. NULL is
 * allowed. */
bool control_has_stopped(const struct control *control);

/* Answers every waiting request with "ended", closes every connection and removes the socket. Call
 * it after the loop has ended. NULL is allowed. */
void control_stop(struct control *control);

/* control_counters copies the counters; control_destroy frees the memory. Call them after
 * control_stop. */
void control_counters(const struct control *control, struct control_counters *counters);
void control_destroy(struct control *control); /* NULL is allowed */

#endif
