/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interface between the boards and the plant: terminal voltages in, true physical quantities
 * out. The boards see nothing else of the model. Quantization, noise and delay are the boards'. SI
 * units; angles and torques on the link side of the gear. Arrays are owned by the plant and live as
 * long as it does. Plain data, RT-safe.
 */
#ifndef MODEL_PLANT_IO_H
#define MODEL_PLANT_IO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Conditions of a drive; bits, 0 = sound. */
enum drive_condition {
    DRIVE_OPEN_PHASE = 1 << 0,   /* no current, whatever the bridge does */
    DRIVE_SHORT = 1 << 1,        /* the winding is shorted: 0 V across it, so that it brakes */
    DRIVE_JAM = 1 << 2,          /* the rotor is locked where it is */
    DRIVE_SPRING_BREAK = 1 << 3, /* Ks = Ds = 0, no stop: the link hangs loose */
    DRIVE_VALVE_OFF = 1 << 4,    /* a servo valve without current: its spool goes to the middle */
    DRIVE_VALVE_STUCK = 1 << 5,  /* the spool stays where it is */
    DRIVE_IMPOSED = 1 << 6,      /* not broken: the rotor turns at rotor_rad_s, whatever loads it */
};

/* One drive's bridge for the coming tick. */
struct motor_command {
    bool bridge_on;      /* false: the bridge is open, the winding carries no current */
    double voltage_v;    /* average terminal voltage; the plant clips it to +-supply */
    double pretension_m; /* p of the parallel spring, paper eq. (5) */
    unsigned condition;  /* condition of the drive: bits of enum drive_condition */
    double rotor_rad_s;  /* DRIVE_IMPOSED: speed of the rotor, link side; a jam is stronger */
    /* Of a hydraulic joint: the spool's middle is off by that share of the full opening, positive
     * as a voltage; oil leaks past the piston, m3/s per Pa, beside the cylinder's own leakage */
    double valve_shift, piston_leak;
};

/* Condition of the hydraulic joints' supply; all 0 = sound. */
struct hydraulic_supply_condition {
    double pump_loss; /* share of the pump's flow that is missing */
    double leak;      /* from the supply to the return, m3/s per Pa */
    bool relief_shut; /* the relief valve does not open */
};

struct plant_command {
    size_t njoint;
    struct motor_command *motor; /* by joint index of the robot */
    double supply_sag_v;         /* how far the source is below its nominal voltage (brown-out) */
    struct hydraulic_supply_condition oil;
};

/* True state of one joint; link side of the gear. */
struct motor_sense {
    double q, qd;     /* joint, rad, rad/s */
    double qm, qmd;   /* motor behind the gear (the paper's q^m), rad, rad/s */
    double current_a; /* motor current I^m */
    double torque_nm; /* on the link: Ks (qm - q) + Ds (qm' - q'), and the spring's stop; of a joint
                       * that follows another, its coupling's */
    double bending_nm[2]; /* moments on the link across its joint's axis, about two axes that are
                           * fixed in the link; 0 unless plant_config's bending asks for them */
    double voltage_v;     /* applied, after saturation */
    double winding_c;     /* deg C; where the drive's effects or boards/sensing/ model it */
    /* Of a hydraulic joint, whose motor angle is the joint's and whose current is 0: */
    double pressure_pa[2]; /* of the piston's and the rod's side, above the air's */
    double valve_opening;  /* -1 to 1 of its full opening, positive towards the piston's side */
};

struct ft_sense {
    double force_n[3]; /* force that the part below the sensor exerts through it, sensor frame */
    double torque_nm[3];
    /* The same with the contact wrench that was largest within the tick, where that is more: what
     * overloads the sensor (plant_contact_peaks) */
    double peak_n[3], peak_nm[3];
};

struct imu_sense {
    double gyro_rad_s[3];
    double accel_m_s2[3]; /* specific force: +g along up at rest */
    double magnetic_t[3]; /* the Earth's field, see model/plant_sample.c */
    double quaternion[4]; /* wxyz, sensor to world, of unit length, w not negative */
};

struct plant_sensors {
    int64_t time_ns;
    double supply_v;
    double oil_pa; /* pressure of the hydraulic joints' supply; 0 without them */
    size_t njoint, nft;
    struct motor_sense *motor;
    struct ft_sense *ft;
    struct imu_sense imu;
};

#endif
