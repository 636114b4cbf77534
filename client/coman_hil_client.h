/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A controller's side of coman-hil, to link or to copy: this file and coman_hil_client.c are all of
 * it. A client connects to the buses of a run, through its TCP gateway or through SocketCAN, knows
 * joints and force-torque sensors by name, and in lockstep drives the time. C11 and C++, Linux.
 *
 *     const struct hil_client_options options = {
 *         .tables = "tables", .ready = "ready", .lockstep = true};
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
 * Tables. What frames mean is read from the DBC files that `coman-hil dbc RIG -o FOLDER` writes,
 * the same that the Python package reads. Joints and sensors have the names of the rig. Write them
 * anew whenever the rig changes: scales depend on it. A client that finds the run by options.ready
 * compares its files with the rig that runs, and HIL_CLIENT_TABLES names one that differs. By a
 * port or through SocketCAN nothing says what runs, and nothing is compared.
 *
 * Units: rad, rad/s, A, V, N m, N; times in ns or ms, as the names say. Angles, currents and
 * torques are those of the link's side of the gear, positive along the joint's axis; forces and
 * moments are in the sensor's frame.
 *
 * What the boards of each protocol take by joint, and say of it:
 *
 *              voltage  current  position  torque | angle  motor angle  velocity  current  torque
 *     icub     yes      gains    gains     -      | yes    yes          -         yes      sensor
 *     foc      yes      yes      -         -      | -      yes          yes       yes      sensor
 *     compact  yes      yes      -         -      | yes    yes          FD        yes      yes
 *
 * "gains": the board's own loop, whose gains are 0 until the rig or the controller sets them
 * (hil_client_send: SET_CURRENT_PID, SET_POSITION_PID); until then hil_client_enable fails with
 * HIL_CLIENT_BOARD. "sensor": where a board of the rig measures the joint. No protocol takes a
 * torque by joint in N m: command currents. Buses of cia402, moteus and other described boards have
 * no joints here (the Python package has them); hil_client_send and hil_client_signal do their
 * messages.
 *
 * Errors. What can fail returns HIL_CLIENT_OK, which is 0, or a code, and leaves a sentence in
 * client->message. After HIL_CLIENT_CONNECTION and HIL_CLIENT_SYSTEM a client can only be closed.
 *
 * Ownership. The struct is the caller's; hil_client_close frees what hil_client_open allocates.
 * What a caller passes is not kept; strings that are returned live until hil_client_close. A client
 * belongs to one thread at a time.
 *
 * A motor whose board trips is no error of a step: hil_client_find_tripped names it.
 *
 * Real time. Only open and close allocate. find, read, command and signal are RT-safe: no system
 * call. The others send and receive without allocating, and end with HIL_CLIENT_TIMEOUT.
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
    HIL_CLIENT_INPUT,      /* a name that is not there, a number out of its range, another clock */
    HIL_CLIENT_TABLES,     /* a DBC file that is missing, wrong (FILE:LINE) or older than the rig */
    HIL_CLIENT_SYSTEM,     /* a call of the system failed; no memory */
    HIL_CLIENT_CONNECTION, /* the gateway is not there, refuses, or has closed */
    HIL_CLIENT_TIMEOUT,    /* nothing came in time */
    HIL_CLIENT_MOVED,      /* somebody else moves the time; the next step goes on from there */
    HIL_CLIENT_STOPPED,    /* the run is over */
    HIL_CLIENT_BOARD,      /* a motor does not switch on, or its board cannot do that */
};

/* The kind of set-point that a motor gets. */
enum hil_client_quantity {
    HIL_CLIENT_OFF,
    HIL_CLIENT_VOLTAGE,
    HIL_CLIENT_CURRENT,
    HIL_CLIENT_POSITION,
    HIL_CLIENT_QUANTITIES
};

/* What 2FOC boards must be told of their motors before they obey: encoder, currents (A), and the
 * law that limits the current (counts; kp and ki are divided by 2^shift). */
struct hil_client_foc_motor {
    double encoder_ticks_per_rev, poles, nominal_a, peak_a, overload_a;
    double current_kp, current_ki, current_shift;
};

/* The buses are those of the gateway that `coman-hil run --ready FILE` names in FILE, else of the
 * one at host and port, else interfaces of SocketCAN. What is 0 or NULL has the default. */
struct hil_client_options {
    const char *tables; /* folder of the DBC files; they must be there */
    const char *rig;    /* whose files; needed when the folder has those of several rigs */
    const char *ready; /* it and its gateway are waited for until the time-out; NULL = host, port */
    const char *host;  /* IPv4 or IPv6 address, no name; NULL = 127.0.0.1 */
    uint16_t port;     /* 0 = SocketCAN */
    const char *const *interfaces; /* "BUS=INTERFACE", ..., NULL; others are as the rig says */
    bool lockstep;                 /* the client drives the time by hil_client_step */
    int timeout_ms;                /* of wall time, for each answer; 0 = 10,000 */
    int refresh_ticks; /* how often a long step sends the set-points; 0 = 10, of foc always 1 */
    const struct hil_client_foc_motor *foc; /* NULL = COMAN's motors */
};

struct hil_client {
    char message[320];            /* of the last failure, one line; "" = none */
    int64_t tick;                 /* lockstep: ticks that the run has made */
    uint16_t flags;               /* of the last DONE: 1 = frames were lost, 2 = a board's fault */
    struct hil_client_core *core; /* private */
};

/* The last reports of boards about a joint; NAN = nothing yet, or they never report it. */
struct hil_client_joint {
    double position_rad, motor_position_rad, motor_velocity_rad_s, current_a, torque_nm;
    const char *mode; /* the board's word for what its motor does: "open_loop", ...; "" = unknown */
    uint32_t faults;  /* bits of the protocol: `coman-hil protocol NAME` */
    bool is_on;       /* the board does what hil_client_enable has asked for */
    /* of the newest frame: virtual time from a gateway, CLOCK_MONOTONIC from SocketCAN; -1 =
     * none has come */
    int64_t time_ns;
};

/* A force-torque sensor; NAN = nothing yet. */
struct hil_client_wrench {
    double force_n[3], moment_nm[3];
    int64_t time_ns;
};

/* A signal of the DBC and its value, in the DBC's unit, or the number of a name. */
struct hil_client_value {
    const char *signal;
    double value;
};

/* Reads the tables and connects. A client that failed here needs no hil_client_close. */
enum hil_client_code hil_client_open(struct hil_client *client,
                                     const struct hil_client_options *options);

/* Closes the connection; motors stay as they are. A client may be closed twice. */
void hil_client_close(struct hil_client *client);

/* Joints and force-torque sensors are numbered from 0; -1 or NULL = there is none. */
int hil_client_find_joint(const struct hil_client *client, const char *name);
int hil_client_find_sensor(const struct hil_client *client, const char *name);
const char *hil_client_joint_name(const struct hil_client *client, int joint);
const char *hil_client_sensor_name(const struct hil_client *client, int sensor);

/* Makes all boards report; hil_client_enable does it. Ticks (or ms) pass, here and there. */
enum hil_client_code hil_client_listen(struct hil_client *client);

/* Clears the faults of motors and switches them on for one kind of set-point, without names those
 * of all joints, until their boards say so, for 1,000 ticks (or ms) at most. The set-points are 0,
 * but for positions, which are the present ones. HIL_CLIENT_OFF switches off. */
enum hil_client_code hil_client_enable(struct hil_client *client, const char *const *joints,
                                       size_t njoint, enum hil_client_quantity quantity);

/* Sets the set-point (V, A, rad) of a motor that is on for its kind, from the next step or write
 * on; limited to the supply of the rig and to what the field takes. */
enum hil_client_code hil_client_command(struct hil_client *client, int joint,
                                        enum hil_client_quantity quantity, double value);

/* Lockstep: sends the set-points, lets the run make so many ticks, and takes in what the boards say
 * meanwhile. The first step joins a run wherever it is. */
enum hil_client_code hil_client_step(struct hil_client *client, int ticks);

/* Without lockstep: sends the set-points (boards let a voltage go after 100 ms, foc after 50 ms);
 * takes in what has come, after a wait for the first frame. */
enum hil_client_code hil_client_write(struct hil_client *client);
enum hil_client_code hil_client_receive(struct hil_client *client, int timeout_ms);

/* Returns the first joint from first on that hil_client_enable has switched on and whose board no
 * longer says so, as after a trip; -1 = none. Steps succeed all the same: ask after each. */
int hil_client_find_tripped(const struct hil_client *client, int first);

/* Reads what was reported last. HIL_CLIENT_INPUT, without a message: there is no such joint or
 * sensor. */
enum hil_client_code hil_client_read(const struct hil_client *client, int joint,
                                     struct hil_client_joint *state);
enum hil_client_code hil_client_read_wrench(const struct hil_client *client, int sensor,
                                            struct hil_client_wrench *wrench);

/* Sends a message of the DBC; signals that are not given are 0. Those of a multiplexed message say
 * which command it is; for one that has none give "command" and its number. */
enum hil_client_code hil_client_send(struct hil_client *client, const char *bus,
                                     const char *message, const struct hil_client_value *values,
                                     size_t nvalue);

/* Returns the value of a signal in the last frame of its message; NAN = there is no such signal,
 * or none has come. */
double hil_client_signal(const struct hil_client *client, const char *bus, const char *message,
                         const char *signal);

#ifdef __cplusplus
}
#endif

#endif
