/* SPDX-License-Identifier: Apache-2.0 */
/* The parts of the sensors, shared by their creation, which is not RT-safe, and by the chain
 * that reads them, which is. */
#ifndef BOARDS_SENSING_PRIVATE_H
#define BOARDS_SENSING_PRIVATE_H

#include "base/random.h"
#include "boards/sensing/sensing.h"

#define SENSING_PLAYS 6 /* operators of a hysteresis, each half as wide as the one before it */

/* Clock of a board. */
struct sampling_clock {
    double period_ns, phase_ns; /* in the simulation's time */
    int64_t age_ns;             /* of its last sample */
    bool sampled;               /* within this tick */
};

/* What the channels of a sensor have in common. */
struct sensor_device {
    const struct sampling_clock *clock;
    struct sensor_warm_up warm_up;
    double keep;   /* exp(-tick / tau) */
    double warm_k; /* above its temperature at the start */
};

/* Low pass: y = b0 (x + 2 x1 + x2) - a1 y1 - a2 y2. */
struct low_pass {
    double b0, a1, a2;
    double x[2], y[2];
};

/* One quantity on its way to the boards. */
struct channel {
    struct sensor_error error;
    bool ideal;
    struct random_stream noise, walk, wander;
    double noise_now, drift, ramp;
    double bias, bias_keep; /* instability: its value, and exp(-tick / tau) */
    double play[SENSING_PLAYS];
    struct low_pass low_pass;
    const struct sensor_device *device;
    bool clocked; /* follows the clock of its board */
    double last;  /* what came out the last time */
    double *line; /* of the delay, circular, newest at line[at] */
    size_t length, at;
};

/* A fault at work on one channel. */
struct sensor_fault {
    const struct fault *fault;
    size_t channel;
    struct random_stream random;
    bool was_active;
    double held;      /* SLOW, STUCK */
    int64_t since_ns; /* SLOW: of the value held */
    bool gap;         /* INTERMITTENT */
    double *line;     /* DELAYED, circular */
    size_t length, at;
};

struct joint_state {
    double start_rad; /* incremental encoder: its angle when counting began */
    bool restarts;    /* the counter restarts with the next sample */
    double heated_c;  /* winding above ambient */
    double keep;      /* exp(-tick/tau) */
    double last_q, last_qm;
    double eccentric_phase_rad[2];
    double bending_part[2]; /* of the moments across its axis, in the torque */
};

struct sensing {
    struct sensing_config config;
    struct sensor_joint *joint;
    struct sensor_ft *ft;
    size_t nchannel;
    struct channel *channel;
    double (*mix)[SENSOR_FT_CHANNELS][SENSOR_FT_CHANNELS]; /* by F/T sensor */
    size_t nclock;
    struct sampling_clock *clock;
    struct sensor_device *device; /* joints, F/T sensors, inertial sensor */
    double misaligned[2][9];      /* from the true axes to those of gyro and accelerometer */
    struct ahrs ahrs;
    struct joint_state *state;
    struct sensor_fault *fault;
    size_t nfault;
    struct plant_sensors measured;
    double noise_scale;
    bool ideal;                /* every sensor shows the truth: nothing to do */
    double last_quaternion[4]; /* truth of the inertial sensor, its sign made continuous */
    bool started;
};

/* ---- the chain; RT-safe ---- */

/* ---- creation; not RT-safe ---- */

/* ---- the number of a channel (faults/faults.h) ---- */

static inline size_t sensing_joint_channel(size_t joint, size_t channel)
{
    return joint * SENSOR_JOINT_CHANNELS + channel;
}

static inline size_t sensing_ft_channel(const struct sensing *s, size_t ft, size_t channel)
{
    return s->config.njoint * SENSOR_JOINT_CHANNELS + ft * SENSOR_FT_CHANNELS + channel;
}

static inline size_t sensing_imu_channel(const struct sensing *s, size_t channel)
{
    return sensing_ft_channel(s, s->config.nft, channel);
}

#endif
