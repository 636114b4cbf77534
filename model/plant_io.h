/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interface between the boards and the plant: terminal voltages or current targets in, true
 * physical quantities out. The boards have no other access to the model; they add quantization,
 * noise and delay. SI units; angles and torques on the link side of the gear. The plant owns the
 * arrays for its lifetime. Plain data, RT-safe.
 */
#ifndef MODEL_PLANT_IO_H
#define MODEL_PLANT_IO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Conditions of a drive; bits, 0 = no fault. */
enum drive_condition {
    DRIVE_OPEN_PHASE = 1 << 0,   /* no current for any bridge state */
    DRIVE_SHORT = 1 << 1,        /* the winding is shorted: 0 V across it, so it brakes */
    DRIVE_JAM = 1 << 2,          /* the rotor is locked at its position */
    DRIVE_SPRING_BREAK = 1 << 3, /* Ks = Ds = 0, no stop: the link hangs loose */
    DRIVE_VALVE_OFF = 1 << 4,    /* servo valve without current: its spool returns to the center */
    DRIVE_VALVE_STUCK = 1 << 5,  /* the spool does not move */
    DRIVE_IMPOSED = 1 << 6,      /* not a fault: the rotor turns at rotor_rad_s under any load */
};

/* Default bandwidth of a current controller, Hz (assumed; servo drives state 0.5 to 4 kHz). */
#define CURRENT_LOOP_HZ 1000.0

/* A command to a drive's own current controller (model/drives/current_loop.h). The controller
 * follows
 *
 *     current_a + stiffness_a_rad * (position_rad - qm) + damping_a_s_rad * (speed_rad_s - qm')
 *
 * within +-limit_a at all times, also between ticks. qm' is the true speed; qm has the error that
 * reading_rad has at the start of the step. */
struct current_law {
    bool on;                   /* true: the law, not voltage_v, sets the voltage */
    double current_a, limit_a; /* limit_a: INFINITY = none, 0 = no current */
    double stiffness_a_rad, position_rad;
    double reading_rad; /* the motor's angle as the controller reads it now */
    double damping_a_s_rad, speed_rad_s;
    double bandwidth_rad_s; /* of the loop; 0 = 2 pi current_loop_hz of the drive */
    double unused;          /* share of the supply that the controller does not use */
};

/* The command of one drive's bridge for the next tick. */
struct motor_command {
    bool bridge_on;   /* false: the bridge is open, the winding carries no current */
    double voltage_v; /* average terminal voltage; the plant clips it to +-supply */
    struct current_law law;
    double pretension_m; /* p of the parallel spring, paper eq. (5) */
    unsigned condition;  /* condition of the drive: bits of enum drive_condition */
    /* speed of the rotor for DRIVE_IMPOSED, link side, rad/s; DRIVE_JAM has priority */
    double rotor_rad_s;
    /* For a hydraulic joint. valve_shift: offset of the spool's center as a share of the full
     * opening, positive like a voltage. piston_leak: leakage past the piston in addition to the
     * cylinder's own, m3/s per Pa */
    double valve_shift, piston_leak;
};

/* Condition of the hydraulic joints' supply; all 0 = no fault. */
struct hydraulic_supply_condition {
    double pump_loss; /* lost share of the pump's flow */
    double leak;      /* leak from the supply to the return, m3/s per Pa */
    bool relief_shut; /* the relief valve does not open */
};

struct plant_command {
    size_t njoint;
    struct motor_command *motor; /* by joint index of the robot */
    double supply_sag_v;         /* sag of the source below its nominal voltage (brown-out) */
    struct hydraulic_supply_condition oil;
};

/* True state of one joint; link side of the gear. */
/* Temperature of a winding without a thermal model, deg C; also the default ambient of thermal
 * models */
#define PLANT_AMBIENT_C 25.0

struct motor_sense {
    double q, qd;     /* joint, rad, rad/s */
    double qm, qmd;   /* motor behind the gear (the paper's q^m), rad, rad/s */
    double current_a; /* motor current I^m */
    /* torque on the link: Ks (qm - q) + Ds (qm' - q'), plus the spring's stop; for a joint that
     * follows another, the coupling's torque */
    double torque_nm;
    /* moments on the link across its joint's axis, about two axes fixed in the link; 0 unless
     * plant_config's bending is set */
    double bending_nm[2];
    double voltage_v; /* applied, after saturation; of a current law: now */
    double winding_c; /* deg C; PLANT_AMBIENT_C without a thermal model */
    /* For a hydraulic joint; its motor angle is the joint's angle and its current is 0 */
    double pressure_pa[2]; /* gauge pressure on the piston side and on the rod side */
    double valve_opening;  /* -1 to 1 of its full opening, positive toward the piston side */
};

struct ft_sense {
    double force_n[3]; /* force that the part below the sensor exerts through it, sensor frame */
    double torque_nm[3];
    /* Peak within the tick, to detect an overload of the sensor. Per channel: the reading, or the
     * reading with the largest contact wrench (plant_contact_peaks) if that is larger */
    double peak_n[3], peak_nm[3];
};

struct imu_sense {
    double gyro_rad_s[3];
    double accel_m_s2[3]; /* specific force: +g along up at rest */
    double magnetic_t[3]; /* the Earth's magnetic field, T; constant in model/plant_sample.c */
    double quaternion[4]; /* wxyz, sensor to world, of unit length, w not negative */
};

struct plant_sensors {
    int64_t time_ns;
    double supply_v;
    double oil_pa; /* pressure of the hydraulic joints' supply; 0 without hydraulic joints */
    size_t njoint, nft;
    struct motor_sense *motor;
    struct ft_sense *ft;
    struct imu_sense imu;
};

#endif
