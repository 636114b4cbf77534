/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The words of a fault's line (faults/faults.h): targets, their kinds, parameters with units and
 * ranges, sensor channels. Immutable; RT-safe.
 */
#ifndef FAULTS_KINDS_H
#define FAULTS_KINDS_H

#include "faults/faults.h"

enum { FAULT_RULES = 33, FAULT_TARGETS = 7 };

/* [0].key NULL = no parameters; values outside min to max are refused. */
struct fault_parameter {
    const char *key, *unit;
    double min, max;
    bool required;
    double otherwise; /* default */
};

/* A kind of fault that a target supports. */
struct fault_rule {
    enum fault_target target;
    enum fault_kind kind;
    const char *word;
    const char *means;
    bool needs_wire;
    struct fault_parameter parameter[FAULT_PARAMETERS];
};

extern const struct fault_rule fault_rules[FAULT_RULES];

/* Words of the targets, by enum fault_target, and of the sensor channels of a joint, a force-torque
 * sensor and the inertial sensor, by enum sensor_channel. */
extern const char *const fault_target_words[FAULT_TARGETS];
extern const char *const sensor_joint_channels[SENSOR_JOINT_CHANNELS];
extern const char *const sensor_ft_channels[SENSOR_FT_CHANNELS];
extern const char *const sensor_imu_channels[SENSOR_IMU_CHANNELS];

#endif
