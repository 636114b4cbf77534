/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The controller's side of the bus. A task uses only CAN frames and the map of the rig. A task is a
 * step function, which its runner calls. In lockstep and free run, the runner calls it in the
 * simulator's thread after each tick. In real time, the runner calls it in a separate thread or
 * process. Units: SI; times are int64_t nanoseconds. Configurations are borrowed and must outlive
 * the task.
 */
#ifndef TASKS_TASK_H
#define TASKS_TASK_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/port.h"
#include "tasks/body_model.h"

/* Data for 2FOC boards. The host sends motor data and limits to the boards. It computes the link's
 * angle from the rotor's angle. */
struct host_drive {
    bool valve;           /* servo valve (docs/hydraulics.md): no current, no spring */
    double gear;          /* rotor turns per link turn */
    double spring_nm_rad; /* stiffness of the series spring, link side */
    double winding_ohm, winding_h;
    double current_limit_a;           /* continuous limit; 1.5 times as much for some seconds */
    int poles;                        /* poles of the rotor */
    double torque_nm_a, bemf_v_s_rad; /* link side; described: converts a voltage to a torque */
};

/* Addresses of a joint on the buses, and the scales of its values. */
struct host_axis {
    const char *joint;
    int bus;
    uint8_t address, axis, model; /* model: described, of the drive */
    double joint_ticks_per_rad, motor_ticks_per_rad;
    int torque_address, torque_channel; /* pseudo-STRAIN, -1 = none */
    double torque_full_scale_nm;
    int64_t torque_period_ns; /* 0 = the board's own */
    struct host_drive drive;  /* foc, described */
    double lower_rad, upper_rad;
};

struct host_ft {
    const char *name;
    int bus;
    uint8_t address;
    int64_t period_ns; /* 0 = the board's own */
};

/* The board with the robot's inertial sensor. */
struct host_imu {
    bool present;
    int bus;
    uint8_t address;
    int64_t period_ns; /* 0 = the board's own */
};

struct described_protocol;

struct host_bus {
    const char *protocol;                       /* name of the protocol; NULL = icub */
    bool fd;                                    /* use CAN FD frames, if the protocol has them */
    const struct described_protocol *described; /* for a protocol that a file describes */
};

struct host_config {
    size_t nbus;
    struct can_port **port;     /* one per bus */
    const struct host_bus *bus; /* nbus entries; NULL = all icub */
    size_t naxis;
    const struct host_axis *axis;
    size_t nft;
    const struct host_ft *ft;
    struct host_imu imu;
    double supply_v;
    int64_t period_ns; /* period of the step function */
    bool lockstep;
    int lockstep_bus; /* bus of the STEP frame */
    uint32_t step_id, done_id;
};

/* Squats: in each cycle, the knees bend, and the hips sink vertically above flat feet and rise. */
struct squat_config {
    double thigh_m;  /* length from hip pitch axis to knee axis */
    double shank_m;  /* length from knee axis to ankle pitch axis */
    double depth_m;  /* vertical motion of the hips */
    double period_s; /* duration of one cycle, down and up */
    int cycles;
};

enum { GRASP_JOINTS = 4 };

struct grasp_phase {
    const char *name; /* name for messages */
    double until_s;   /* end of the phase, time since the arms began to move */
    double
        /* right arm at the end of the phase: shoulder pitch, roll, yaw, elbow; the left arm mirrors
         * roll and yaw */
        arm_rad[GRASP_JOINTS];
    bool closed; /* both wrists must press on the object during the phase */
};

/* Grasps an object between the wrists and lifts it, along piecewise linear joint angles. */
struct grasp_config {
    double settle_s; /* time of standing still before the motion */
    size_t nphase;
    const struct grasp_phase *phase;
    double hold_s;        /* time of standing still after the motion */
    double least_press_n; /* minimum force of the grip; below it the grip is lost; 0 = no check */
    /* minimum force that both wrists carry, mean over hold_s; below it the task fails; 0 = no
     * check */
    double least_carry_n;
};

/* Gains of a position loop on the motor angle qm, which the controller closes with the voltage
 *
 *     V = kp (ref - qm) + ki integral + kd (ref' - qm') + kw ref' + load_v_per_nm load.
 *
 * load is the joint's torque at the start, until servo_set_load changes it.
 * A slow outer loop on the link angle q compensates the deflection of the series spring: ref =
 * wanted + trim,
 *
 *     trim' = trim_per_s (wanted - q) - sway_damping_per_s (d - mean of d)
 *
 * d = qm - q is the spring's deflection. If the torque is measured, d is computed from the torque.
 * The mean of d is over about 0.3 s. With the first term alone, a robot that stands on its springs
 * oscillates until it falls. For a pendulum I q'' = -(K - m g h) q + K trim with trim' = -k q, the
 * oscillation grows for any k > 0 if there is no other damping. The second term adds damping. The
 * motor yields to the spring's force like a damper in series with the spring, which dissipates
 * energy at every frequency. sway_damping_per_s must exceed trim_per_s. */
struct servo_gains {
    double kp_v_per_rad;
    double ki_v_per_rad_s;
    double kd_v_s_per_rad;     /* qm' is the difference of two reported motor angles */
    double kw_v_s_per_rad;     /* back-EMF feed-forward of the reference rate */
    double trim_per_s;         /* 0 = the reference is the motor angle itself */
    double sway_damping_per_s; /* 0 = no sway damping */
    double load_v_per_nm;      /* R/Kt: voltage per load torque; 0 = none */
    double limit_v;            /* voltage limit below the supply voltage; 0 = none */
    /* torque limit, applied to the voltage beyond the back-EMF; 0 = none. Needs load_v_per_nm and
     * kw_v_s_per_rad */
    double torque_limit_nm;
};

struct servo_config {
    const struct servo_gains *gains; /* one entry per axis */
    int64_t command_period_ns; /* period of voltage commands (a multiple of the host's period) */
};

/* Holds every joint in the initial pose. */
struct hold_config {
    double duration_s;    /* holding time, after two seconds to reach the pose */
    double tolerance_rad; /* largest error of a link's angle before the task fails */
};

/* ---- stand and walk; docs/walking.md ---- */

struct estimate_config {
    /* rate at which the board's attitude, or gravity, corrects the integrated attitude */
    double attitude_per_s;
    /* rate at which the feet's forces correct the tilt of the inertial board; 0 = no correction */
    double lean_per_s;
    double com_per_s;         /* bandwidth of the observer of the center of mass */
    double com_walking_per_s; /* its bandwidth in a fast walk; 0 = com_per_s */
    /* commanded speed from which com_walking_per_s applies; com_per_s applies up to half of this
     * speed, with linear interpolation between; 0 = com_walking_per_s at any speed */
    double com_walking_m_s;
    double loaded_n; /* minimum load of a foot for a valid center of pressure */
};

struct gait_config {
    double swing_s, transfer_s; /* durations of the phases: one foot stands; both stand */
    /* duration of the first transfer, from both feet to one foot, and of the last transfer back */
    double start_s;
    double clearance_m;            /* height of the foot in the air */
    double width_m, least_width_m; /* distance between the feet: nominal, minimum */
    double zmp_ahead_m;            /* planned zero-moment point, forward of the sole's origin */
    double zmp_inward_m;           /* planned zero-moment point, offset toward the other foot */
    /* maximum step forward, backward, and outward (beyond width_m) */
    double reach_ahead_m, reach_back_m, reach_out_m;
    /* gain from the DCM's error to the foothold, 0 to 1; 0 = no adjustment */
    double adjust;
    /* reach of the center of pressure; errors that it can remove need no step */
    double ankle_m;
    double lower_m_s, lower_m; /* rate and maximum distance at which a late foot is lowered */
    double press_n;            /* load on a foot that lands early, until its swing ends */
    /* weight of the standing sole's plane, 0 to 1, in the prediction of height and tilt of the next
     * foothold */
    double ground_follow;
    /* time constant with which a sole's target follows the ground's tilt */
    double tilt_s;
    /* distance of the sole's edges from its origin */
    double sole_front_m, sole_back_m, sole_side_m;
    /* minimum distance of the center of pressure from the edges */
    double sole_margin_m;
    /* duration of a swing that catches a standing robot; 0 = no catching step */
    double catch_swing_s;
    /* the robot steps if the DCM is this close to the limit of the center of pressure */
    double catch_margin_m;
    double catch_reach_m; /* reach of a catching step, forward and backward */
    double catch_clearance_m;
};

struct balance_config {
    struct estimate_config estimate;
    struct gait_config gait;
    const struct servo_gains *gains; /* one entry per axis; trim, integral and sway damping are 0 */
    /* gain of the ankle rolls; a larger gain tips the foot before the compliance reacts */
    double ankle_roll_kp_v_per_rad;
    double pelvis_height_m;  /* height of the pelvis's origin above the soles */
    double lean_rad;         /* forward lean of the pelvis */
    double touch_n, touch_s; /* load, and its duration, that count as ground contact */
    /* minimum load of a flat sole; its center of pressure must also be inside the edges */
    double flat_n;
    double height_s;           /* time constant of the pelvis's height, which follows the feet */
    double dcm_gain;           /* r = r_ref + dcm_gain (xi - xi_ref) */
    double cop_pitch_rad_s_nm; /* rate of a foot's tilt per error of its moment */
    double cop_roll_rad_s_nm;
    double land_turn_rad_s_nm; /* the same rate, for a landed foot with little load */
    double cop_leak_per_s;     /* rate at which the tilt decays */
    double force_m_s_n;        /* rate of leg lengths per error of the force difference */
    double force_leak_per_s;   /* rate at which the leg lengths decay */
    /* fraction of the pelvis's measured height error that a foot in the air corrects, 0 to 1 */
    double swing_follow;
    double carry_s;      /* time constant with which a landed foot moves to the plan */
    double swing_torque; /* share of the leg's swing torque that both hips apply, 0 to 1 */
    /* fraction, 0 to 1, by which standing ankles follow their measured link angles */
    double ankle_follow;
};

struct walk_config {
    struct balance_config balance;
    double begin_s;    /* time from motors on to the first step */
    int64_t steps;     /* number of steps before the robot stands; 0 = no end */
    double distance_m; /* distance from the first step at which the task ends; 0 = no end */
    double forward_m_s, left_m_s, turn_rad_s;
};

/* ---- sweep and follow; docs/tasks.md ---- */

struct trajectory;

/* Input of the tasks in addition to the rig. It is borrowed and must outlive the task. */
struct task_input {
    /* sweep, excite: joint; NULL = not given, the task refuses */
    const char *joint;
    /* follow (tasks/trajectory.h); NULL = not given, the task refuses */
    const struct trajectory *trajectory;
};

enum sweep_response_of { SWEEP_JOINT, SWEEP_MOTOR, SWEEP_TORQUE, SWEEP_RESPONSES };
enum { SWEEP_POINTS_MAX = 200 };

/* A response per unit of input: of the link's angle, of the rotor's angle (both rad at the link),
 * or of the joint's torque (N m). The phase is within -pi to pi; positive = the response leads. */
struct sweep_response {
    double magnitude, phase_rad;
    double coherence; /* fraction of the signal's variance that is the response; 0 = no response */
};

struct sweep_point {
    double frequency_hz;
    bool by_angle; /* input: the reference angle, else the voltage */
    double input;  /* amplitude, V or rad */
    struct sweep_response response[SWEEP_RESPONSES];
};

/* Error of a joint: measured minus reference, at the times of its link angle's frames. */
struct follow_error {
    const char *joint;
    bool moves; /* has a column in the file */
    size_t count;
    double rms_rad, worst_rad, worst_s;
};

struct task_config {
    struct host_config host;
    const double *initial_rad; /* naxis angles of the robot's initial pose */
    struct servo_config servo;
    struct squat_config squat;
    struct grasp_config grasp;
    struct hold_config hold;
    const struct walk_config *walk; /* stand, walk; NULL = the tasks refuse */
    const struct body_model *body;  /* stand, walk; NULL = the tasks refuse */
    struct task_input input;
};

struct task;

enum task_status {
    TASK_RUNNING,
    TASK_DONE,   /* finished successfully */
    TASK_FAILED, /* boards missing, faults, fall: task_message has the reason */
};

/* Creates the task with this name ("squat", ...) in the arena, and borrows the ports. Not
 * RT-safe. */
enum error_code task_create(const char *name, const struct task_config *config, struct arena *arena,
                            struct task **task, struct error *error);

/* Runs one control period: reads every port, computes, and sends. In lockstep, sends the STEP frame
 * too. now_ns: time of the caller's clock. RT-safe. */
enum task_status task_step(struct task *task, int64_t now_ns);

/* Returns whether the task runs until it is stopped or fails, for example a walk. RT-safe. */
bool task_is_endless(const struct task *task);

/* Switches the motors off. Call it to stop a task before its end. RT-safe. */
void task_stop(struct task *task);

/* A setting that a user may change while the task runs, such as the speed of a walk. */
struct task_setting {
    const char *name, *unit; /* "walk.forward_m_s", "m/s"; "" = dimensionless */
    double min, max;
    bool whole;     /* takes whole numbers only */
    double initial; /* its value until it is changed */
};

/* Returns the number of a task's settings. *setting receives the array, which the task owns.
 * RT-safe. */
size_t task_settings(const struct task *task, const struct task_setting **setting);

/* Changes a setting from the next step on. Returns false if the setting does not exist or the value
 * is out of range. Call it before the first step, or later from one thread, which may differ from
 * the task's thread. RT-safe. */
bool task_set(struct task *task, size_t index, double value);

/* Returns the value of a setting. Call it from any thread. RT-safe. */
double task_get(const struct task *task, size_t index);

/* Returns a counter that changes if a setting may have changed. Call it from any thread.
 * RT-safe. */
uint64_t task_changes(const struct task *task);

/* Changes settings before the first step. Each pair is "NAME=VALUE". Returns ERROR_INPUT. Not
 * RT-safe. */
enum error_code task_set_all(struct task *task, const char *const *pair, size_t npair,
                             struct error *error);

/* Returns the number of a task's estimated and planned signals, for recordings. *name receives
 * their names, which end with the unit. RT-safe. */
size_t task_signals(const struct task *task, const char *const **name);

/* Reads the values of the signals after the last step; all 0 before the boards are ready.
 * RT-safe. */
void task_read_signals(const struct task *task, double *value);

/* Return the measured points of task sweep, one per frequency, and the errors of task follow, one
 * per joint. Other tasks return 0. The task owns the arrays. Call them in the task's thread, or
 * after the task has ended. */
size_t task_sweep_points(const struct task *task, const struct sweep_point **point);
size_t task_follow_errors(const struct task *task, const struct follow_error **error);

/* Returns one line with the progress ("cycle 2 of 4, 43 mm down"), or with the reason of a failure.
 * RT-safe. */
const char *task_message(const struct task *task);

/* Returns whether the task failed because boards are gone or have restarted. A new task may find
 * the boards again. */
bool task_lost(const struct task *task);

/* Returns the names of all tasks, NULL-terminated, for --help. RT-safe. */
const char *const *task_names(void);

/* Returns a one-line description of a task; NULL = unknown task. RT-safe. */
const char *task_summary(const char *name);

/* Returns the names of a task's settings, NULL-terminated; empty for an unknown task. RT-safe. */
const char *const *task_setting_names(const char *name);

#endif
