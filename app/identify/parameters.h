/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numbers that an identification may change: those of an electric drive by their keys in a
 * drive's file, and those of the bench around it. SI units, link side. Not RT-safe.
 */
#ifndef APP_IDENTIFY_PARAMETERS_H
#define APP_IDENTIFY_PARAMETERS_H

#include "base/arena.h"
#include "base/error.h"
#include "model/robot.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { IDENTIFY_FREE_MAX = 24 };

/* A number of the drive or of its bench; its index stands for it. */
enum { IDENTIFY_NONE = -1 };

/* Returns the index of the parameter of that key, or IDENTIFY_NONE. */
int parameter_find(const char *key);

/* Returns the number of parameters, the key of one ("R_ohm"), and what it is for a reader. */
size_t parameter_count(void);
const char *parameter_key(int parameter);
const char *parameter_meaning(int parameter);

/* What surrounds the drive in a simulated recording, beside the robot's own description. */
struct bench_numbers {
    double offset_rad; /* the joint's angle where the recording says 0 */
    double delay_s;    /* of the command, until it acts */
    double arm_kg;     /* of a uniform rod between the axis and the center of mass it carries */
};

/* A robot of one driven joint that may be changed: a copy, in memory of its own. */
struct trial_robot {
    struct robot robot;
    struct robot_body body[2];
    struct robot_joint joint;
    struct robot_effects effects;
    struct bench_numbers bench;
};

/* Copies a robot; one of other than one joint with an electric drive is refused. */
enum error_code trial_robot_copy(const struct robot *robot, struct trial_robot *trial,
                                 struct error *error);

/* Return and set a number. Setting one sets those that follow it too, unless they are in the list
 * of the free ones: NKw_v_s_rad follows NKt_nm_a in proportion, load_external load_motor,
 * load_external_stribeck load_motor_stribeck, breakaway_nm is no less than coulomb_nm. */
double parameter_get(const struct trial_robot *trial, int parameter);
void parameter_set(struct trial_robot *trial, const int *parameter, const double *value,
                   size_t count);

/* Computes bounds within which a parameter is looked for, from what the drive is like. */
void parameter_bounds(const struct trial_robot *trial, int parameter, double supply_v,
                      double *lower, double *upper);

/* Returns whether a key of a drive's file is used by that drive. */
bool parameter_is_written(const struct trial_robot *trial, int parameter);

#endif
