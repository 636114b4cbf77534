/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tables of the words in a fault's line (faults/faults.h): the targets, their kinds, the parameters
 * with units and ranges, and the sensor channels. Immutable data; RT-safe.
 */
#ifndef FAULTS_KINDS_H
#define FAULTS_KINDS_H

#include "faults/faults.h"

enum { FAULT_RULES = 36, FAULT_TARGETS = 7 };

/* A parameter of a kind. key is NULL in unused entries. The parser refuses values outside [min,
 * max]. */
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

/* Words of the targets, indexed by enum fault_target. Then the words of the sensor channels of a
 * joint, a force-torque sensor and the inertial sensor, in the order of enum sensor_channel. */
extern const char *const fault_target_words[FAULT_TARGETS];
extern const char *const sensor_joint_channels[SENSOR_JOINT_CHANNELS];
extern const char *const sensor_ft_channels[SENSOR_FT_CHANNELS];
extern const char *const sensor_imu_channels[SENSOR_IMU_CHANNELS];

#endif
