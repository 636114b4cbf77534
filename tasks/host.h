/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host of the boards. It discovers and configures the boards over CAN ports, stores their
 * latest telemetry, switches motors and sends voltages. Each bus has one protocol; buses of a host
 * may have different protocols. The host uses only CAN frames and the map of the rig. Call it from
 * one thread. RT-safe after creation. Units: SI; angles at the link side of the gear.
 */
#ifndef TASKS_HOST_H
#define TASKS_HOST_H

#include "tasks/task.h"

struct host;

enum host_phase {
    HOST_DISCOVERING, /* waits for the discovery answers of all boards */
    /* requests versions, periods and full scales, one request per board and period */
    HOST_CONFIGURING,
    HOST_ENABLING, /* switches motors to voltage mode and waits for the boards' reports */
    HOST_READY,
    HOST_FAILED, /* host_message has the reason */
};

enum host_motor {
    HOST_MOTOR_UNKNOWN, /* not reported yet */
    HOST_MOTOR_OFF,
    HOST_MOTOR_ON,    /* applies voltages */
    HOST_MOTOR_OTHER, /* on, but in another mode than requested */
    HOST_MOTOR_FAULT,
};

/* Latest telemetry of one joint. */
struct host_joint {
    /* Link encoder and rotor encoder, both at the link side of the gear. foc boards have no link
     * encoder: joint_rad is then the rotor's angle minus the spring's deflection, computed from the
     * measured torque. */
    double joint_rad, motor_rad;
    double current_a, torque_nm; /* cia402 reports no current */
    enum host_motor motor;
    uint32_t fault;   /* fault bits of the protocol */
    bool torque_told; /* a board reports the torque */
    /* Host time of the last rotor angle, link angle and torque; -1 = none yet */
    int64_t motor_time_ns, joint_time_ns, torque_time_ns;
};

struct host_force {
    double force_n[3], torque_nm[3];
    int64_t force_time_ns, torque_time_ns; /* host time of the last values; -1 = none yet */
    bool overflow;
};

/* Latest telemetry of the inertial sensor, in its own axes; all 0 before the first frame. */
struct host_motion {
    double acceleration_m_s2[3]; /* specific force: 9.81 upwards at rest */
    double rate_rad_s[3];
    double quaternion[4]; /* wxyz, from sensor to world, w >= 0; 0 0 0 0 = unknown */
    /* Host time of the last values; -1 = none yet */
    int64_t acceleration_time_ns, rate_time_ns, quaternion_time_ns;
};

/* Creates a host in the arena, and borrows the ports. */
enum error_code host_create(const struct host_config *config, struct arena *arena,
                            struct host **host, struct error *error);

/* Reads the frames that have arrived. In lockstep, returns false until DONE has arrived on every
 * bus. Without lockstep, returns true. now_ns: time of the caller's clock. */
bool host_receive(struct host *host, int64_t now_ns);

/* Returns the host time: in lockstep, the virtual time of the last DONE; otherwise, now_ns of the
 * last host_receive. */
int64_t host_time_ns(const struct host *host);

/* Continues the start-up by one period. Returns the phase. */
enum host_phase host_start_up(struct host *host);

/* Returns the round trip time of the slowest bus, ns. The round trip time of a bus is the shortest
 * host time from a request of the start-up to its answer. 0 = no board answers requests. */
int64_t host_round_trip_ns(const struct host *host);

/* Visits the frames that discover and configure the boards of a bus, in the order of sending.
 * Frames of one stage need no time between them. restart_stages: stages until boards answer that
 * the discovery restarts. For a new host, whose ports may be NULL; it sends nothing. Not
 * RT-safe. */
void host_visit_start_up(struct host *host, size_t bus, unsigned restart_stages,
                         void (*visit)(void *context, unsigned stage, const struct bus_frame *),
                         void *context);

/* Make a passive host, which listens on buses that another host commands. host_begin_listening
 * makes a new host passive: it sends nothing, and its ports may be NULL. The second function reads
 * a frame of any sender. */
void host_begin_listening(struct host *host);
void host_listen(struct host *host, size_t bus, const struct bus_frame *frame, int64_t now_ns);

/* Set the commands of this period. Switching a motor on or off sets its voltage to 0 V. The host
 * repeats the last voltage in every period if the protocol requires it. */
void host_set_motor(struct host *host, size_t axis, bool on);
void host_set_voltage(struct host *host, size_t axis, double volts);

/* Returns the last commanded voltage of an axis, limited to the supply voltage. */
double host_voltage(const struct host *host, size_t axis);

/* Sets the motor's reference: position (rad) and rate (rad/s) at the link side. Protocols whose
 * boards close a position loop use it. Other protocols ignore it. */
void host_set_reference(struct host *host, size_t axis, double rad, double rad_s);

/* Ends the period: sends the queued frames bus by bus. In lockstep, sends the STEP frame last. */
void host_send(struct host *host);

/* Repeats the STEP if DONE has not arrived within 100 ms. A simulator that has already received the
 * STEP answers with its tick. Has no effect without lockstep. */
void host_repeat_step(struct host *host, int64_t now_ns);

const struct host_joint *host_joint(const struct host *host, size_t axis);
const struct host_force *host_force(const struct host *host, size_t ft);
const struct host_motion *host_motion(const struct host *host);
const struct host_config *host_configuration(const struct host *host);

/* Returns the axis of a joint by name; -1 = none. Not RT-safe. */
int host_find_axis(const struct host *host, const char *joint);

/* Watch a sensor that the task requires. host_healthy then fails if the force-torque board or the
 * inertial board is silent for 100 ms, or for ten of its periods if this is longer. The inertial
 * board must send the angular rate, and either the quaternion or the acceleration. */
void host_watch_force(struct host *host, size_t ft);
void host_watch_motion(struct host *host);

/* Checks that every motor is on and without a fault, and that the telemetry of motors and watched
 * sensors is recent. If it returns false, host_message has the reason. */
bool host_healthy(struct host *host);

const char *host_message(const struct host *host);

/* Returns whether the host failed because boards do not answer, have stopped transmitting, or have
 * restarted. A new host may then find the boards again. */
bool host_lost(const struct host *host);

#endif
