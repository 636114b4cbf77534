/* SPDX-License-Identifier: Apache-2.0 */
/* The parts of the sensors, shared by their creation, which is not RT-safe, and by the chain
 * that reads them, which is. */
#ifndef BOARDS_SENSING_PRIVATE_H
#define BOARDS_SENSING_PRIVATE_H

#include "base/random.h"
#include "boards/sensing/sensing.h"

/* One quantity on its way to the boards. */
struct channel {
    struct sensor_error error;
    bool ideal;
    struct random_stream noise, walk;
    double drift, ramp;
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
};

struct sensing {
    struct sensing_config config;
    struct sensor_joint *joint;
    struct sensor_ft *ft;
    size_t nchannel;
    struct channel *channel;
    double (*mix)[SENSOR_FT_CHANNELS][SENSOR_FT_CHANNELS]; /* by F/T sensor */
    struct joint_state *state;
    struct sensor_fault *fault;
    size_t nfault;
    struct plant_sensors measured;
    double noise_scale;
    bool ideal;                /* every sensor shows the truth: nothing to do */
    double last_quaternion[4]; /* truth of the inertial sensor, its sign made continuous */
    bool started;
};

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
