/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host of the boards: discovers and configures them over CAN ports, keeps their latest
 * telemetry, switches motors and sends voltages. Each bus speaks one protocol; a host may have
 * several. It knows the map of the rig and the protocols, nothing else. One thread; RT-safe after
 * creation. Units: SI, angles at the link side of the gear.
 */
#ifndef TASKS_HOST_H
#define TASKS_HOST_H

#include "tasks/task.h"

#include <stdbool.h>

struct host;

enum host_phase {
    HOST_DISCOVERING, /* waiting for every board's answer to discovery */
    HOST_CONFIGURING, /* versions, periods, full scales, one request a board and period */
    HOST_ENABLING,    /* motors switched to voltage mode, waiting for the boards to say so */
    HOST_READY,
    HOST_FAILED, /* host_message says why */
};

enum host_motor {
    HOST_MOTOR_UNKNOWN, /* the board has not reported it */
    HOST_MOTOR_OFF,
    HOST_MOTOR_ON,    /* obeys voltages */
    HOST_MOTOR_OTHER, /* on in a mode that the host did not ask for */
    HOST_MOTOR_FAULT,
};

/* Latest telemetry of one joint. */
struct host_joint {
    /* Link and rotor encoder (rotor on the link side of the gear). foc boards have no link encoder:
     * there joint_rad is the rotor's angle less the spring's deflection under the measured
     * torque. */
    double joint_rad, motor_rad;
    double current_a, torque_nm; /* cia402: no current */
    enum host_motor motor;
    uint32_t fault;   /* bits of the protocol */
    bool torque_told; /* some board reports the torque */
    /* Host time of the last angle of rotor and link, and of the last torque; -1 = none yet */
    int64_t motor_time_ns, joint_time_ns, torque_time_ns;
};

struct host_force {
    double force_n[3], torque_nm[3];
    int64_t force_time_ns, torque_time_ns; /* host time of the last of each; -1 = none yet */
    bool overflow;
};

/* Latest telemetry of the inertial sensor, in its own axes; all 0 until the first frame. */
struct host_motion {
    double acceleration_m_s2[3]; /* specific force: 9.81 up at rest */
    double rate_rad_s[3];
    double quaternion[4]; /* wxyz, sensor to world, w not negative; 0 0 0 0: not known */
    /* Host time of the last of each; -1 = none yet */
    int64_t acceleration_time_ns, rate_time_ns, quaternion_time_ns;
};

/* Creates a host in the arena; the ports stay the caller's. */
enum error_code host_create(const struct host_config *config, struct arena *arena,
                            struct host **host, struct error *error);

/* Reads the frames that have arrived. In lockstep returns false until DONE has come on every
 * bus; otherwise always true. now_ns is the caller's clock. */
bool host_receive(struct host *host, int64_t now_ns);

/* Returns the host time: virtual time of the last DONE in lockstep, else the now_ns of the last
 * receive. */
int64_t host_time_ns(const struct host *host);

/* Continues the start-up by one period; returns the phase reached. */
enum host_phase host_start_up(struct host *host);

/* For whoever only listens, beside a host that commands: prepares a new host for boards that
 * somebody else has started (it sends nothing and asks nothing; its ports may be NULL), and reads a
 * frame, whoever sent it. */
void host_begin_listening(struct host *host);
void host_listen(struct host *host, size_t bus, const struct bus_frame *frame, int64_t now_ns);

/* Set the commands of this period. A motor that is switched, on or off, gets 0 V. Where a
 * protocol wants set-points every period the last voltage is repeated. */
void host_set_motor(struct host *host, size_t axis, bool on);
void host_set_voltage(struct host *host, size_t axis, double volts);

/* Returns the last voltage of an axis, as limited by the supply. */
double host_voltage(const struct host *host, size_t axis);

/* Sets where the motor of an axis is to be under that voltage, for protocols whose boards close
 * a position loop; the others ignore it. rad at the link side, rad/s. */
void host_set_reference(struct host *host, size_t axis, double rad, double rad_s);

/* Ends the period: sends what is queued, bus by bus, and in lockstep the STEP frame last. */
void host_send(struct host *host);

/* Sends the STEP again when DONE has not come within 100 ms of now_ns; a simulator that had it
 * already answers with its tick. Does nothing without lockstep. */
void host_repeat_step(struct host *host, int64_t now_ns);

const struct host_joint *host_joint(const struct host *host, size_t axis);
const struct host_force *host_force(const struct host *host, size_t ft);
const struct host_motion *host_motion(const struct host *host);
const struct host_config *host_configuration(const struct host *host);

/* Returns the axis of a joint by name, -1 when there is none. Not RT-safe. */
int host_find_axis(const struct host *host, const char *joint);

/* For a task that cannot do without a sensor: from now on a force-torque board, or the inertial
 * board, that is silent for 100 ms, or for ten of its periods if that is longer, is not healthy.
 * Of the inertial board these are the rate and what tells of the attitude: the quaternion, or the
 * acceleration when no quaternion has come. */
void host_watch_force(struct host *host, size_t ft);
void host_watch_motion(struct host *host);

/* Checks that every motor is on, without fault, and that telemetry is fresh, that of watched
 * sensors too; false with a message otherwise. */
bool host_healthy(struct host *host);

const char *host_message(const struct host *host);

/* Returns whether it failed because boards do not answer, stopped transmitting or were
 * restarted: then a new host may find them again. */
bool host_lost(const struct host *host);

#endif
