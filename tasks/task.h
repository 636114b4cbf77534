/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The other side of the bus: a controller sees CAN frames and the map of the rig, nothing else. A
 * task is a step function; the runner decides when it is called (in the simulator's thread after
 * each tick in lockstep and free run, or by its own thread or process in real time). Units: SI;
 * times are int64_t nanoseconds. What a configuration points to stays the caller's and must outlive
 * the task.
 */
#ifndef TASKS_TASK_H
#define TASKS_TASK_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/port.h"
#include "tasks/body_model.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What 2FOC boards need from their host: it tells them the motor and its limits, and computes the
 * link's angle from the rotor's. */
struct host_drive {
    bool valve;           /* a servo valve (docs/hydraulics.md): no current, no spring */
    double gear;          /* rotor turns a link turn */
    double spring_nm_rad; /* stiffness of the series spring, at the link */
    double winding_ohm, winding_h;
    double current_limit_a;           /* continuous; half as much again for some seconds */
    int poles;                        /* of the rotor */
    double torque_nm_a, bemf_v_s_rad; /* link-side; described: what a voltage is as torque */
};

/* The place of a joint on the buses, and its scales. */
struct host_axis {
    const char *joint;
    int bus;
    uint8_t address, axis;
    double joint_ticks_per_rad, motor_ticks_per_rad;
    int torque_address, torque_channel; /* pseudo-STRAIN, -1 = none */
    double torque_full_scale_nm;
    int64_t torque_period_ns; /* 0: the board's own */
    struct host_drive drive;  /* foc, described */
    double lower_rad, upper_rad;
};

struct host_ft {
    const char *name;
    int bus;
    uint8_t address;
    int64_t period_ns; /* 0: the board's own */
};

/* The board with the robot's inertial sensor. */
struct host_imu {
    bool present;
    int bus;
    uint8_t address;
    int64_t period_ns; /* 0: the board's own */
};

struct described_protocol;

struct host_bus {
    const char *protocol;                       /* name of what the boards speak; NULL: icub */
    bool fd;                                    /* CAN FD frames, where the protocol has them */
    const struct described_protocol *described; /* of a protocol that a file describes */
};

struct host_config {
    size_t nbus;
    struct can_port **port;     /* one a bus */
    const struct host_bus *bus; /* nbus entries; NULL: icub everywhere */
    size_t naxis;
    const struct host_axis *axis;
    size_t nft;
    const struct host_ft *ft;
    struct host_imu imu;
    double supply_v;
    int64_t period_ns; /* how often the step function is called */
    bool lockstep;
    int lockstep_bus; /* bus of the STEP frame */
    uint32_t step_id, done_id;
};

/* Knees bend and the hips sink vertically over flat feet, then rise again; cycle after cycle. */
struct squat_config {
    double thigh_m;  /* hip pitch axis to knee axis */
    double shank_m;  /* knee axis to ankle pitch axis */
    double depth_m;  /* how far the hips sink */
    double period_s; /* of one cycle down and back */
    int cycles;
};

enum { GRASP_JOINTS = 4 };

struct grasp_phase {
    const char *name; /* in messages */
    double until_s;   /* after the arms began to move */
    double
        arm_rad[GRASP_JOINTS]; /* right arm at its end: shoulder pitch, roll, yaw, elbow; the left
                                   * arm mirrors roll and yaw */
    bool closed;               /* the object is held all the while: both wrists must press */
};

/* Both arms take an object between the wrists and lift it, on a piecewise linear path of angles. */
struct grasp_config {
    double settle_s; /* standing still before */
    size_t nphase;
    const struct grasp_phase *phase;
    double hold_s;        /* standing still after */
    double least_press_n; /* with less the grip counts as lost; 0: it may be */
    double
        least_carry_n; /* by the wrists together, on average over hold_s; with less it failed; 0: it
                           * may */
};

/* Voltage loop on a motor angle, closed here: V = kp (ref - qm) + ki integral + kd (ref' - qm') +
 * kw ref' + load torque(start). Outside it a slow loop on the link angle takes out what the series
 * spring yields: ref = wanted + trim,
 *
 *     trim' = trim_per_s (wanted - q) - sway_damping_per_s (d - mean of d)
 *
 * with the spring's deflection d = qm - q, by the measured torque where there is one, and its
 * mean over some 0.3 s. The first part alone rocks a robot over that stands on its springs: of a
 * pendulum I q'' = -(K - m g h) q + K trim, trim' = -k q, the oscillation grows for any k > 0
 * unless something else damps it. The motor that gives way to the spring's force does: a damper
 * in series with the spring, which takes energy at every frequency; more than trim_per_s of it
 * is enough. */
struct servo_gains {
    double kp_v_per_rad;
    double ki_v_per_rad_s;
    double kd_v_s_per_rad;     /* qm' is the difference between two messages of the motor's angle */
    double kw_v_s_per_rad;     /* back-EMF feed-forward of the reference's rate */
    double trim_per_s;         /* 0: the motor angle itself is what is wanted */
    double sway_damping_per_s; /* 0: the motors do not give way */
    double load_v_per_nm; /* R/Kt: voltage that carries the joint's torque at the start; 0: none */
    double limit_v;       /* of a drive that takes less than the supply; 0: none */
    double torque_limit_nm; /* that the voltage beyond the back-EMF may make; 0: none. Needs
                             * load_v_per_nm and kw_v_s_per_rad */
};

struct servo_config {
    const struct servo_gains *gains; /* one an axis */
    int64_t command_period_ns; /* voltages are sent this often (a multiple of the host's period) */
};

/* Every joint stays in the initial pose. */
struct hold_config {
    double duration_s;    /* after two seconds to get there */
    double tolerance_rad; /* of a link's angle; more has failed */
};

/* ---- stand and walk; docs/walking.md ---- */

struct estimate_config {
    double attitude_per_s;    /* rate at which the gyro's attitude is corrected toward the
                               * board's, or toward gravity */
    double lean_per_s;        /* rate at which the tilt of the board's attitude is found by the
                               * forces of the feet; 0: it has none */
    double com_per_s;         /* bandwidth of the correction of the center of mass by the
                               * encoders */
    double com_walking_per_s; /* the same while it is told to walk fast; 0: com_per_s */
    double com_walking_m_s;   /* that fast or faster; com_per_s up to half of it, between the two a
                               * straight line; 0: whatever the speed */
    double loaded_n;          /* least load of a foot that has a center of pressure */
};

struct gait_config {
    double swing_s, transfer_s; /* durations in a step: one foot stands; both do */
    double start_s;             /* first transfer, from both feet to one, and the last one back */
    double clearance_m;         /* height of the foot in the air */
    double width_m, least_width_m; /* distance between the feet: wanted, least */
    double zmp_ahead_m;  /* where the plan puts the zero-moment point, from the sole's origin */
    double zmp_inward_m; /* and towards the other foot */
    double reach_ahead_m, reach_back_m, reach_out_m; /* largest step ahead, back, outward (beyond
                                                      * width_m) */
    double adjust;             /* gain with which a foothold follows the DCM's error, 0 to 1; 0:
                                * never */
    double ankle_m;            /* reach of the center of pressure: errors up to what it takes out
                                * need no step */
    double lower_m_s, lower_m; /* a foot that comes down late is lowered at that rate, so far */
    double press_n;            /* load of a foot that came down early, until its time */
    double ground_follow;      /* how far the next foothold is expected in the plane of the
                                * standing sole, 0 to 1 */
    double tilt_s;             /* time constant with which a sole's target takes the ground's
                                * tilt */
    double sole_front_m, sole_back_m, sole_side_m; /* edges of the sole from its origin */
    double sole_margin_m;                          /* distance that the center of pressure keeps
                                                    * from them */
    double catch_swing_s; /* of a step that catches a robot that stands; 0: it does not step */
    double
        catch_margin_m; /* it steps when the DCM is so near to where the center of pressure ends */
    double catch_reach_m; /* ahead and back, of such a step */
    double catch_clearance_m;
};

struct balance_config {
    struct estimate_config estimate;
    struct gait_config gait;
    const struct servo_gains *gains; /* one an axis; trim, integral and sway damping are 0 */
    double ankle_roll_kp_v_per_rad;  /* gain of these two: with more the foot tips before it
                                      * yields */
    double pelvis_height_m;          /* height of its origin over the soles */
    double lean_rad;                 /* lean of the pelvis, forward */
    double touch_n, touch_s;         /* load and time after which the foot has met the ground */
    double flat_n;             /* a sole with more, its center of pressure within, lies flat */
    double height_s;           /* time constant with which the pelvis follows the feet's heights */
    double dcm_gain;           /* r = r_ref + dcm_gain (xi - xi_ref) */
    double cop_pitch_rad_s_nm; /* rate of a foot's tilt for an error of its moment */
    double cop_roll_rad_s_nm;
    double land_turn_rad_s_nm; /* the same, of a foot with little load yet */
    double cop_leak_per_s;     /* rate at which the tilt decays */
    double force_m_s_n;        /* rate of the legs' lengths for an error of the difference ... */
    double force_leak_per_s;   /* ... of the feet's forces; rate at which they decay */
    double swing_follow;       /* how far a foot in the air allows for the pelvis's true height */
    double carry_s;            /* time constant with which a foot that touches down goes over to
                                * the plan */
    double swing_torque;       /* share of the torque that swings a leg that both hips give, 0 to
                                * 1 */
    double ankle_follow;       /* how far standing ankles go along with their links, 0 to 1 */
};

struct walk_config {
    struct balance_config balance;
    double begin_s;    /* time of the first step, after the motors are on */
    int64_t steps;     /* number of steps, then it stands; 0: no end */
    double distance_m; /* distance from where its steps begin at which it stops and is done; 0:
                        * never */
    double forward_m_s, left_m_s, turn_rad_s;
};

/* ---- sweep and follow; docs/tasks.md ---- */

struct trajectory;

/* What they get beside the rig; the caller's, must outlive the task. */
struct task_input {
    const char *joint;                   /* sweep; NULL: it refuses */
    const struct trajectory *trajectory; /* follow (tasks/trajectory.h); NULL: it refuses */
};

enum sweep_response_of { SWEEP_JOINT, SWEEP_MOTOR, SWEEP_TORQUE, SWEEP_RESPONSES };
enum { SWEEP_POINTS_MAX = 200 };

/* The response of the link's angle, the rotor's (both rad at the link) or the joint's torque (N
 * m), for a unit of input; the phase is from -pi to pi, positive when the response leads. */
struct sweep_response {
    double magnitude, phase_rad;
    double coherence; /* part of the signal's variance that is the response; 0: no response */
};

struct sweep_point {
    double frequency_hz;
    bool by_angle; /* input: the angle that was wanted, else the voltage */
    double input;  /* amplitude, V or rad */
    struct sweep_response response[SWEEP_RESPONSES];
};

/* Measured less wanted angle of a joint, at the frames of its link's angle. */
struct follow_error {
    const char *joint;
    bool moves; /* has a column in the file */
    size_t count;
    double rms_rad, worst_rad, worst_s;
};

struct task_config {
    struct host_config host;
    const double *initial_rad; /* naxis: the pose that the robot stands in at the start */
    struct servo_config servo;
    struct squat_config squat;
    struct grasp_config grasp;
    struct hold_config hold;
    const struct walk_config *walk; /* stand, walk; NULL: they refuse */
    const struct body_model *body;  /* the same */
    struct task_input input;
};

struct task;

enum task_status {
    TASK_RUNNING,
    TASK_DONE,   /* finished what it was to do */
    TASK_FAILED, /* boards missing, faults, robot fell: see task_message */
};

/* Creates the task of that name ("squat", ...) in the arena; ports stay the caller's. Not
 * RT-safe. */
enum error_code task_create(const char *name, const struct task_config *config, struct arena *arena,
                            struct task **task, struct error *error);

/* Runs one control period: reads every port, decides, sends (in lockstep also the STEP frame).
 * now_ns: the caller's time. RT-safe. */
enum task_status task_step(struct task *task, int64_t now_ns);

/* Returns whether the task goes on until it is stopped or fails, as a walk does. RT-safe. */
bool task_is_endless(const struct task *task);

/* Switches the motors off; call it when stopping early. RT-safe. */
void task_stop(struct task *task);

/* A setting that a user may change while a task runs: the wanted speed of a walk, ... */
struct task_setting {
    const char *name, *unit; /* "walk.forward_m_s", "m/s"; "" = a count */
    double min, max;
    bool whole;     /* takes whole numbers only */
    double initial; /* its value until it is changed */
};

/* Returns the number of a task's settings, and which; the task's. RT-safe. */
size_t task_settings(const struct task *task, const struct task_setting **setting);

/* Changes a setting from the next step on. Returns false when there is no such setting or the
 * value is out of its range. Before the first step, then from one thread, which need not be the
 * task's. RT-safe. */
bool task_set(struct task *task, size_t index, double value);

/* Returns the value of a setting; any thread. RT-safe. */
double task_get(const struct task *task, size_t index);

/* Returns a count that changes whenever some setting may have another value; any thread.
 * RT-safe. */
uint64_t task_changes(const struct task *task);

/* Changes settings before the first step, each "NAME=VALUE". ERROR_INPUT. Not RT-safe. */
enum error_code task_set_all(struct task *task, const char *const *pair, size_t npair,
                             struct error *error);

/* Returns the number of signals that a task estimates and plans, for recordings, and their
 * names, with the units at the end. RT-safe. */
size_t task_signals(const struct task *task, const char *const **name);

/* Reads their values after the last step; zeros before the boards are ready. RT-safe. */
void task_read_signals(const struct task *task, double *value);

/* Return the frequencies that a sweep has measured, and the errors of a task that follows, one a
 * joint: the task's; 0 of another task. In the task's thread, or when it has ended. */
size_t task_sweep_points(const struct task *task, const struct sweep_point **point);
size_t task_follow_errors(const struct task *task, const struct follow_error **error);

/* Returns one line about its progress ("cycle 2 of 4, 43 mm down") or why it failed. RT-safe. */
const char *task_message(const struct task *task);

/* Returns whether it failed because the boards are gone or were restarted: a new task may find
 * them again. */
bool task_lost(const struct task *task);

/* Returns the names of all tasks, NULL-terminated, for --help. RT-safe. */
const char *const *task_names(void);

/* Returns one line on a task, NULL when there is none of that name. RT-safe. */
const char *task_summary(const char *name);

/* Returns the names of the settings of a task, NULL-terminated; none when there is no such task.
 * RT-safe. */
const char *const *task_setting_names(const char *name);

#endif
