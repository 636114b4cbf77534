/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The section `sensors` of a rig file as it is written: the errors of its sensors, in the units
 * that the keys name. For the rig reader. Not RT-safe.
 */
#ifndef RIG_SENSORS_H
#define RIG_SENSORS_H

#include "base/yaml.h"

#include <stdint.h>

/* struct sensor_error, in the unit that the key of the channel names. */
struct raw_channel {
    struct yaml_mark mark;
    double gain_error, offset, noise_rms, drift_per_sqrt_s, ramp_per_s, full_scale, lsb;
    double latency_s, bandwidth_hz, hysteresis, instability_rms, instability_s, offset_per_k,
        gain_per_k;
};

struct raw_warm_up {
    struct yaml_mark mark;
    double rise_k, time_constant_s;
};

struct raw_winding {
    struct yaml_mark mark;
    double ambient_c, k_per_w, time_constant_s;
};

/* Of all joints, or of one that differs: a channel that it gives replaces the whole channel. */
struct raw_joint_sensors {
    struct yaml_mark mark;
    const char *name;
    struct raw_channel link_encoder, motor_encoder, current, torque, temperature;
    struct raw_winding winding;
    struct raw_warm_up warm_up;
    double eccentricity_rad[2], crosstalk;
    bool incremental;
    bool link_given, motor_given, current_given, torque_given, temperature_given, winding_given,
        warm_up_given, eccentricity_given, crosstalk_given, incremental_given;
};

/* What hangs beyond a force-torque sensor, in its frame. */
struct raw_tool {
    struct yaml_mark mark;
    double mass_kg, com_m[3], inertia_kg_m2[6];
};

struct raw_ft_sensors {
    struct yaml_mark mark;
    const char *name;
    struct raw_channel force, torque;
    struct raw_warm_up warm_up;
    struct raw_tool tool;
    double crosstalk;
    bool force_given, torque_given, crosstalk_given, warm_up_given, tool_given;
};

struct raw_ahrs {
    struct yaml_mark mark;
    double accel_per_s, magnetic_per_s, bias_per_s2;
};

struct raw_imu_sensors {
    struct yaml_mark mark;
    struct raw_channel gyro, accel, magnetic, orientation;
    double gyro_misalignment_rad[3], accel_misalignment_rad[3];
    struct raw_warm_up warm_up;
    struct raw_ahrs ahrs;
    bool ahrs_given;
};

struct raw_clocks {
    struct yaml_mark mark;
    double period_s, drift_ppm;
};

struct raw_sensors {
    struct yaml_mark mark;
    struct raw_joint_sensors every_joint, *joint;
    size_t njoint;
    struct raw_ft_sensors every_ft, *ft;
    size_t nft;
    struct raw_imu_sensors imu;
    struct raw_clocks clocks;
};

extern const struct yaml_schema rig_sensors_schema;

#endif
