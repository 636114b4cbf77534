/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Client library for controllers. Link it, or copy this file and coman_hil_client.c. A client
 * connects to the buses of a run through the run's TCP gateway or through SocketCAN. Joints and
 * force-torque sensors have names. In lockstep the client advances virtual time. C11 and C++,
 * Linux.
 *
 *     const struct hil_client_options options = {.ready = "ready", .lockstep = true};
 *     struct hil_client client;
 *     struct hil_client_joint elbow;
 *
 *     if (hil_client_open(&client, &options) ||
 *         hil_client_enable(&client, NULL, 0, HIL_CLIENT_VOLTAGE)) {
 *         fprintf(stderr, "%s\n", client.message);
 *     }
 *     int joint = hil_client_find_joint(&client, "LElbj");
 *     hil_client_command(&client, joint, HIL_CLIENT_VOLTAGE, 2.0);
 *     hil_client_step(&client, 4);
 *     hil_client_read(&client, joint, &elbow);
 *     hil_client_close(&client);
 *
 * Client table. The run tells the client how its boards are switched, commanded and read, and what
 * the messages of its DBC files are; the client knows no protocol. With SocketCAN, the client reads
 * this table from the file RIG.joints of `coman-hil dbc RIG -o FOLDER`. Write this file again after
 * each change of the rig. Joints and sensors have the names of the rig.
 *
 * Units: rad, rad/s, A, V, N m, N; times in ns or ms, as the names say. Angles, currents and
 * torques refer to the link side of the gear, positive along the joint's axis. Forces and moments
 * are in the sensor's frame.
 *
 * Commands and reports per joint, by protocol (one row per protocol, commands | reports):
 *
 *              volt.  curr.  pos.   vel.   torque | angle  motor angle  velocity  current  torque
 *     icub     yes    gains  gains  -      -      | yes    yes          -         yes      sensor
 *     foc      yes    yes    -      -      -      | -      yes          yes       yes      sensor
 *     compact  yes    yes    -      -      -      | yes    yes          FD        yes      yes
 *     cia402   yes    -      yes    yes    yes    | yes    yes          -         -        yes
 *     moteus   -      -      yes    yes    yes    | yes    yes          yes       -        yes
 *     a file   what its states, laws and frames have
 *
 * "gains": the board runs its own control loop, and its gains are 0 at first. Set them in the rig
 * or with hil_client_send (SET_CURRENT_PID, SET_POSITION_PID). Until then hil_client_enable fails
 * with HIL_CLIENT_BOARD. "sensor": only if a board of the rig measures the joint's torque.
 *
 * Errors. A function that can fail returns HIL_CLIENT_OK (0) or an error code, and writes the
 * reason to client->message. After HIL_CLIENT_CONNECTION or HIL_CLIENT_SYSTEM, only
 * hil_client_close is allowed.
 *
 * Ownership. The caller owns struct hil_client; hil_client_close frees the memory of
 * hil_client_open. The client keeps no pointer that the caller passes. Returned strings are valid
 * until hil_client_close. Only one thread at a time may use a client.
 *
 * Trips. A step succeeds even if a motor's board trips: call hil_client_find_tripped after it.
 *
 * Real time. Only open and close allocate memory. find, read, command and signal are RT-safe and
 * make no system calls. The other functions send and receive without allocation; they can block
 * until their timeout (HIL_CLIENT_TIMEOUT).
 */
#ifndef COMAN_HIL_CLIENT_H
#define COMAN_HIL_CLIENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum hil_client_code {
    HIL_CLIENT_OK,
    HIL_CLIENT_INPUT,      /* unknown name, number out of range, or wrong kind of clock */
    HIL_CLIENT_TABLES,     /* client table missing or invalid (FILE:LINE) */
    HIL_CLIENT_SYSTEM,     /* system call failed, or out of memory */
    HIL_CLIENT_CONNECTION, /* gateway unreachable, refused a command, or closed the connection */
    HIL_CLIENT_TIMEOUT,    /* no answer before the timeout */
    HIL_CLIENT_MOVED,      /* another client advances time; the next step starts at the new tick */
    HIL_CLIENT_STOPPED,    /* the run has ended */
    HIL_CLIENT_BOARD,      /* motor does not switch on, or its board lacks this set-point */
};

/* Kinds of set-points of a motor. */
enum hil_client_quantity {
    HIL_CLIENT_OFF,
    HIL_CLIENT_VOLTAGE,
    HIL_CLIENT_CURRENT,
    HIL_CLIENT_POSITION,
    HIL_CLIENT_VELOCITY,
    HIL_CLIENT_TORQUE,
    HIL_CLIENT_QUANTITIES
};

/* The client connects to the first of these that is set: the gateway that the file of
 * `coman-hil run --ready FILE` names, the gateway at host and port, or SocketCAN interfaces. A
 * member of 0 or NULL has its default. */
struct hil_client_options {
    const char *ready; /* FILE of --ready; open waits for it and its gateway; NULL = unused */
    const char *host;  /* IPv4 or IPv6 address, no name; NULL = 127.0.0.1 */
    uint16_t port;     /* 0 = SocketCAN */
    const char *table; /* SocketCAN: the file RIG.joints of coman-hil dbc; else unused */
    const char *const *interfaces; /* "BUS=INTERFACE", ..., NULL; default: those of the rig */
    bool lockstep;                 /* hil_client_step advances virtual time */
    int timeout_ms;                /* wall time per answer; 0 = 10,000 */
    int refresh_ticks; /* ticks between set-points in a long step; 0 = 10; some boards get 1 */
};

struct hil_client {
    char message[320];            /* last error, one line; "" = none */
    int64_t tick;                 /* lockstep: ticks since the start of the run */
    uint16_t flags;               /* of the last DONE: 1 = frames were lost, 2 = board fault */
    struct hil_client_core *core; /* private */
};

/* Last reported values of a joint; NAN = not received yet, or the board never reports the value. */
struct hil_client_joint {
    double position_rad, motor_position_rad, motor_velocity_rad_s, current_a, torque_nm;
    const char *mode; /* the board's name of the motor's mode: "open_loop", ...; "" = unknown */
    uint32_t faults;  /* bits of the protocol: `coman-hil protocol NAME` */
    bool is_on;       /* the motor is in the mode that hil_client_enable requested */
    /* time of the newest frame; gateway: virtual time; SocketCAN: CLOCK_MONOTONIC; -1 = no frame
     * received */
    int64_t time_ns;
};

/* Last reported values of a force-torque sensor; NAN = not received yet. */
struct hil_client_wrench {
    double force_n[3], moment_nm[3];
    int64_t time_ns;
};

/* Name and value of a DBC signal, in the DBC's unit. For a named value (VAL_), its number. */
struct hil_client_value {
    const char *signal;
    double value;
};

/* Connects and reads the client table. After an error, hil_client_close is not needed. */
enum hil_client_code hil_client_open(struct hil_client *client,
                                     const struct hil_client_options *options);

/* Closes the connection and frees the memory. Motors keep their state. May be called twice. */
void hil_client_close(struct hil_client *client);

/* Converts between names and indices of joints and force-torque sensors. Indices start at 0.
 * Returns -1 or NULL if the joint or sensor does not exist. RT-safe. */
int hil_client_find_joint(const struct hil_client *client, const char *name);
int hil_client_find_sensor(const struct hil_client *client, const char *name);
const char *hil_client_joint_name(const struct hil_client *client, int joint);
const char *hil_client_sensor_name(const struct hil_client *client, int sensor);

/* Configures all boards to send reports. hil_client_enable calls it. Both functions advance time by
 * some ticks (without lockstep: ms). */
enum hil_client_code hil_client_listen(struct hil_client *client);

/* Clears the faults of motors and switches them on for one kind of set-point. njoint 0 = all
 * joints. Waits until the boards report the new mode, at most 1,000 ticks (without lockstep: ms).
 * Set-points start at 0, positions at the present position. HIL_CLIENT_OFF switches off. */
enum hil_client_code hil_client_enable(struct hil_client *client, const char *const *joints,
                                       size_t njoint, enum hil_client_quantity quantity);

/* Stores the set-point (V, A, rad, rad/s, N m) of a motor that is on for this quantity. The next
 * step or write sends it. Limits a voltage to the supply of the rig, and any value to the range of
 * its signal. RT-safe. */
enum hil_client_code hil_client_command(struct hil_client *client, int joint,
                                        enum hil_client_quantity quantity, double value);

/* Lockstep: sends the set-points, advances the run by `ticks`, and receives the boards' frames. The
 * first step starts at the current tick of the run. */
enum hil_client_code hil_client_step(struct hil_client *client, int ticks);

/* Without lockstep. hil_client_write sends the set-points. A board switches the voltage off 100 ms
 * (foc: 50 ms) after the last set-point. hil_client_receive waits up to timeout_ms for a frame, and
 * then receives all frames that have arrived. */
enum hil_client_code hil_client_write(struct hil_client *client);
enum hil_client_code hil_client_receive(struct hil_client *client, int timeout_ms);

/* Returns the index of a tripped joint at or after `first`; -1 = none. A joint is tripped if
 * hil_client_enable switched it on and its board no longer reports this mode. Call it after each
 * step, because a step does not fail on a trip. RT-safe. */
int hil_client_find_tripped(const struct hil_client *client, int first);

/* Reads the last reported values of a joint or sensor. HIL_CLIENT_INPUT = no joint or sensor with
 * this index; client->message does not change. RT-safe. */
enum hil_client_code hil_client_read(const struct hil_client *client, int joint,
                                     struct hil_client_joint *state);
enum hil_client_code hil_client_read_wrench(const struct hil_client *client, int sensor,
                                            struct hil_client_wrench *wrench);

/* Reads how many commands boards have dropped, for a wrong length, value, checksum or counter or as
 * unknown. client->message gets the log's line about the last one; "" = none yet. Only through a
 * gateway. */
enum hil_client_code hil_client_read_dropped(struct hil_client *client, uint64_t *count);

/* Sends a message of the DBC. Missing signals are 0; counter, checksum and constants of a protocol
 * file are filled in unless given. In a multiplexed message, the given signals select the command.
 * For a command without signals, give the signal "command" and its number. */
enum hil_client_code hil_client_send(struct hil_client *client, const char *bus,
                                     const char *message, const struct hil_client_value *values,
                                     size_t nvalue);

/* Returns the value of a signal in the last frame of its message; NAN = unknown signal, or no such
 * frame received yet. RT-safe. */
double hil_client_signal(const struct hil_client *client, const char *bus, const char *message,
                         const char *signal);

#ifdef __cplusplus
}
#endif

#endif
