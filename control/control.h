/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control socket: other programs observe and control a running simulator over a unix stream
 * socket that only its owner and root may use (control/socket.h). `coman-hil ctl` is such a
 * program.
 *
 * The protocol. A line is a JSON object (RFC 8259, UTF-8, no key twice, at most CONTROL_LINE
 * bytes), of a request
 *
 *     {"id": 7, "cmd": "set", "name": "supply_v", "value": 40}
 *
 * and of its answer, which repeats the id (any number or a string of at most 256 bytes; null
 * without):
 *
 *     {"id": 7, "ok": true, "tick": 1250, "time_s": 1.25, "state_hash": "90c2f0e2d9a74b11"}
 *     {"id": 7, "ok": false, "code": "input", "error": "found ..., expected ..."}
 *
 * The server carries out and answers the requests of a client in order, one at a time. To pause a
 * long step use a second connection. It refuses unknown commands, unknown keys and values out of
 * range with code "input", and suggests the nearest name. The other codes are refusals by the loop:
 * "empty", "recording", "clock", "busy", "unavailable", "cut" (a pause has ended the step), "ended"
 * (the run is over) and "memory". Times are virtual, _s in seconds. Numbers have 15 digits, NaN and
 * infinities are null, hashes are strings of 16 hexadecimal digits.
 *
 *   hello         program, version, protocol (1), rig, pid
 *   status        rig, file, robot_hash, task, recording, clock, speed, paused, clamped, tick,
 *                 tick_s, time_s, elapsed_s, overruns, lost_ticks, buses (load: mean since this
 *                 client's last status, or since the start), joints (rad) and contacts (force up,
 *                 N), both empty before the first tick, faults (the active ones), control (counters
 *                 of this socket)
 *   statistics    phases, wakeup and work: count, min, median, p99, max, mean in us, live: one may
 *                 be a tick ahead of another; overruns by phase, late ticks, pauses, lockstep
 *                 counters, all as of tick
 *   list          what: "tunables", "faults", "bodies", "signals", "checkpoints" or "commands";
 *                 match: a pattern of names with * and ? (optional)
 *   get           name: of a tunable; answers value, unit, min, max
 *   set           name, value
 *   fault         name, on: true or false; from then on its window is ignored
 *   push          body; force_n, moment_nm: [x, y, z] in the world frame at its origin (optional,
 *                 0); duration_s (optional; 0: until the next push)
 *   pause, resume after the tick that runs
 *   step          count (optional, 1): ticks; answered when they have run
 *   speed         factor: virtual seconds a second, 0.001 to 1000; 0: as fast as possible
 *   reset         to the start
 *   checkpoint    slot (optional, 1): 1 to 3
 *   restore       slot (optional, 1): 0 to 3; 0 is the start
 *   wait          tick or time_s: answered when it has been reached
 *   subscribe     signals: array of names or patterns with * and ?; period_ms (optional, 10): a
 *                 multiple of the tick. Answers signals, the names in the order of the values.
 *                 Replaces an earlier subscription of this connection.
 *   unsubscribe   answers rows and missed, the totals
 *   stop          ends the run cleanly
 *
 * Commands of the loop (fault to restore, and set) answer with the tick, time_s and state_hash of
 * their effect. After a subscribe, lines without id come between answers,
 *
 *     {"time_s": 1.25, "tick": 1250, "values": [...]}
 *
 * one at every tick that is a multiple of the period. The rows of a step come before its answer.
 * When the client or the server is too slow, rows are dropped; the next row counts them:
 * "missed": 3.
 *
 * Limits. The server disconnects a client, with a message that has line and column,
 *
 *   - after CONTROL_JUNK_MAX invalid lines in a row (each CONTROL_LINE bytes of an endless line
 *     count as one);
 *   - after half a line and 30 s of silence;
 *   - when it does not read its answers for 30 s.
 *
 * It receives no further requests of a client while more than half of the client's CONTROL_OUTBOX
 * bytes are unsent. At most CONTROL_CLIENTS are connected. One more takes the place of the client
 * that has been idle for the longest time. An idle client waits for no answer and has no
 * subscription. If none is idle, one more may pause, resume and stop the run. A half-closed
 * connection is served until its last answer or row has been sent.
 *
 * The server has its own thread. It uses only rt/requests.h and data that the loop publishes
 * (simulator_read, stream, histograms), so that no client can delay a tick. Not RT-safe.
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
    struct requests *requests; /* of the simulator's loop */
    const char *path;          /* path of the socket; NULL = the default path for name */
    const char *name;          /* name of the instance: the rig's */
    /* longest time for half a line and for undrained answers; 0 = 30 s */
    int64_t patience_ns;
};

struct control_counters {
    uint64_t clients; /* clients that have sent a request */
    uint64_t requests, refused_requests;
    uint64_t refused; /* refused connections: too many that are busy, or of another user */
    uint64_t cut_junk, cut_slow, cut_silent, cut_idle;
    uint64_t rows, missed_rows;
};

struct control;

/* Listens and starts the thread. Call it after simulator_create and before simulator_start, so that
 * the thread has normal priority and processors. Errors are those of control_socket_open and
 * control_socket_open_default. */
enum error_code control_start(const struct control_config *config, struct control **control,
                              struct error *error);

/* Starts to serve clients. Call it after simulator_start, which touches all of the simulator's
 * memory while no other thread may. Earlier clients wait until then. NULL is allowed. */
void control_serve(struct control *control);

const char *control_path(const struct control *control);

/* Takes one line for the log: which client was disconnected and why, or which has stopped the run;
 * false = none waits. From one thread. */
bool control_next_event(struct control *control, uint64_t *key, char *text, size_t size);

/* Checks whether a client has stopped the run, or tried to after its end. NULL is allowed. */
bool control_has_stopped(const struct control *control);

/* Call it after the loop has ended. Answers every waiting request with "ended", closes every
 * connection and removes the socket. NULL is allowed. */
void control_stop(struct control *control);

/* Copy the counters; free the memory. Call them after control_stop. */
void control_counters(const struct control *control, struct control_counters *counters);
void control_destroy(struct control *control); /* NULL is allowed */

#endif
