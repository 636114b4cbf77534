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
    double latency_s;
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
    bool incremental;
    bool link_given, motor_given, current_given, torque_given, temperature_given, winding_given,
        incremental_given;
};

struct raw_ft_sensors {
    struct yaml_mark mark;
    const char *name;
    struct raw_channel force, torque;
    double crosstalk;
    bool force_given, torque_given, crosstalk_given;
};

struct raw_imu_sensors {
    struct yaml_mark mark;
    struct raw_channel gyro, accel, magnetic, orientation;
};

struct raw_sensors {
    struct yaml_mark mark;
    struct raw_joint_sensors every_joint, *joint;
    size_t njoint;
    struct raw_ft_sensors every_ft, *ft;
    size_t nft;
    struct raw_imu_sensors imu;
};

extern const struct yaml_schema rig_sensors_schema;

#endif
