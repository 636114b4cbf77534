/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The sensors between the plant's truth and the boards. What a sensor makes of a quantity x, each
 * tick:
 *
 *   1. hysteresis: of the part that bends or magnetizes, independent of the rate;
 *   2. bandwidth: a low pass of second order (Butterworth) that is 3 dB down at bandwidth_hz;
 *   3. latency:   x of latency_ns ago, and of the board's last sampling instant (linear between
 *                 ticks);
 *   4. error:     (1 + gain_error) x + offset + drift, the drift a random walk of drift_per_sqrt_s
 *                 and a ramp of ramp_per_s, both zero at the start; a bias that wanders about zero
 *                 (instability); gain and offset by the kelvins that the sensor has warmed up;
 *   5. noise:     white, Gaussian, noise_rms at every sample;
 *   6. converter: cut to +-full_scale, then rounded to steps of lsb;
 *   7. faults (faults/faults.h), on what comes out.
 *
 * Hysteresis is that of six play operators of equal weight (Prandtl and Ishlinskii), half as wide
 * each as the next, the widest as wide as half the full scale: a loop is as wide in parts of its
 * own amplitude whatever this is, down to 1/64 of the full scale, below which there is none. Once
 * around the full scale the branches are `hysteresis` of the full scale apart in the middle.
 *
 * Instability is a Gauss-Markov process of the first order: Gaussian, of instability_rms, its
 * correlation exp(-t / instability_s). It is at work from the start.
 *
 * Boards have clocks of their own. One that samples every period_ns of a clock that is wrong by
 * d (at most drift_ppm, drawn from the seed as is its phase) has sampled last at a whole multiple
 * of period_ns (1 + d) behind its phase: between two samples its values stand still.
 *
 * The inertial sensor's gyro and accelerometer are turned by the small angles of their
 * misalignment. Its orientation is the true attitude, or what an attitude filter of its own makes
 * of its readings (boards/sensing/ahrs.h): the four components of its quaternion are channels like
 * others, and what comes out is brought back to unit length. An error of e rad about some axis is
 * one of e / 2 in them.
 *
 * A link encoder whose ring is mounted eccentrically errs once and twice a turn; the constant part
 * is gone, for zero is where it was calibrated.
 *
 * A torque sensor of a joint shows a part of the moments across its axis, which bend it, and a
 * force-torque sensor mixes its six channels, before all that (crosstalk). A channel's peak within
 * a tick is as far beyond its reading as the true one beyond the truth. An incremental encoder does
 * not know its angle: it counts from where it stood at the start, and again after
 * sensing_restart_counter, for the counter is in the board. The boards round encoder angles to
 * ticks themselves (boards_sample) and estimate velocities from the ticks as the firmware does;
 * motor_sense's qd and qmd are, where an encoder is not ideal, the difference of its last two
 * readings, and the truth elsewhere.
 *
 * An encoder that is mounted at an angle has an offset; a host takes it out by the calibration
 * command 0x04, whose third parameter is the reading at zero.
 *
 * Each channel draws from a random stream of its own, named after it: what one sensor shows depends
 * on the seed and nothing else. Everything zero, which is the default, hands the truth on bit for
 * bit. Numbers of the channels: faults/faults.h.
 *
 * Units: SI. Memory is the arena's of sensing_create; the strings of the configuration stay the
 * caller's. RT-safe but for sensing_create.
 */
#ifndef BOARDS_SENSING_SENSING_H
#define BOARDS_SENSING_SENSING_H

#include "boards/sensing/ahrs.h"
#include "faults/faults.h"
#include "model/plant_io.h"

struct sensor_error {
    double gain_error;       /* 0.01 = one percent too much */
    double offset;           /* in the unit of the quantity, as all below */
    double noise_rms;        /* of each sample */
    double drift_per_sqrt_s; /* random walk */
    double ramp_per_s;       /* linear drift */
    double full_scale, lsb;  /* 0 = none */
    int64_t latency_ns;      /* 0 to SENSING_LATENCY_MAX_NS */
    double bandwidth_hz;     /* below half the rate of the ticks; 0 = all passes */
    double hysteresis;       /* part of the full scale, which it needs */
    double instability_rms, instability_s;
    double offset_per_k, gain_per_k; /* by the warming of the sensor */
};

#define SENSING_LATENCY_MAX_NS INT64_C(1000000000)
#define SENSING_CLOCK_DRIFT_MAX_PPM 1e4

/* Warming of a sensor by its own electronics: rise_k (1 - exp(-t / time_constant_s)). */
struct sensor_warm_up {
    double rise_k, time_constant_s; /* 0 = it stays as cold as it was calibrated */
};

/* Sampling instants of the boards, above. period_ns 0 = boards sample at the ticks' ends. */
struct sensor_clocks {
    int64_t period_ns; /* up to SENSING_LATENCY_MAX_NS */
    double drift_ppm;
    /* Of the boards, by the numbers of their clocks: what is drawn for one depends on its name and
     * the seed alone; NULL: on its number */
    const char *const *name;
};

/* The winding as one body: C T' = R I^2 - (T - ambient) / Rth, so that what it has taken is the I2t
 * of the motor. Heats with the true current; the plant's resistance stays. For drives whose effects
 * have temperatures (model/drives/effects.h) there is none here: the sensor reads theirs. */
struct sensor_thermal {
    double ambient_c;
    double resistance_ohm;  /* R of the winding; 0 = no temperature but the plant's */
    double k_per_w;         /* Rth */
    double time_constant_s; /* C Rth */
};

struct sensor_joint {
    const char *name;
    struct sensor_error link_encoder, motor_encoder;  /* rad */
    struct sensor_error current, torque, temperature; /* A, Nm, K */
    bool incremental;                                 /* the motor encoder */
    double eccentricity_rad[2]; /* of the link encoder, once and twice a turn; phases are drawn from
                                 * the seed */
    double crosstalk; /* part that the torque sensor shows of each of the moments across its axis;
                       * signs are drawn from the seed */
    struct sensor_thermal thermal;
    struct sensor_warm_up warm_up;
    size_t clock; /* number of its board's clock: the same number is the same clock */
};

struct sensor_ft {
    const char *name;
    struct sensor_error force, torque; /* of each of three channels; N, Nm */
    double crosstalk; /* the part of its full scale that each channel shows when another is at its
                       * own, so that both need one; signs are drawn from the seed */
    struct sensor_warm_up warm_up;
    size_t clock;
};

struct sensor_imu {
    struct sensor_error gyro, accel;           /* rad/s, m/s2 */
    struct sensor_error magnetic, orientation; /* T, of each component of the quaternion */
    double gyro_misalignment_rad[3];           /* rotation vectors: the axes are turned by them */
    double accel_misalignment_rad[3];
    struct ahrs_config ahrs; /* off: the orientation is the true one */
    struct sensor_warm_up warm_up;
    size_t clock;
};

struct sensing_config {
    size_t njoint, nft;
    const struct sensor_joint *joint; /* NULL = all ideal */
    const struct sensor_ft *ft;       /* NULL = all ideal */
    struct sensor_imu imu;
    struct sensor_clocks clocks;
    int64_t tick_ns;
    uint64_t seed;
    const struct faults *faults; /* those of sensors act; NULL = none */
};

struct sensing;

/* Returns whether a joint's sensor shows the moments across its axis, so that the plant has to
 * sample them. */
bool sensing_sees_bending(const struct sensing_config *config);

/* Memory from arena (delay lines included). ERROR_INPUT on a latency, resolution or scale out of
 * range. Not RT-safe. */
enum error_code sensing_create(const struct sensing_config *config, struct arena *arena,
                               struct sensing **sensing, struct error *error);

/* Reads the sensors at the end of a tick, now_ns. Returns what the boards see, valid until the next
 * call: truth itself when all sensors are ideal. RT-safe. */
const struct plant_sensors *sensing_sample(struct sensing *sensing, int64_t now_ns,
                                           const struct plant_sensors *truth);

/* Scales all noise (noise_rms) by a factor, 1 at the start; tells whether there is any at all.
 * RT-safe. */
void sensing_scale_noise(struct sensing *sensing, double factor);
double sensing_noise_scale(const struct sensing *sensing);
bool sensing_has_noise(const struct sensing *sensing);

/* Restarts the counter of a joint's motor encoder, as when its board restarts: an incremental
 * one counts from where it stands at the next sample. RT-safe. */
void sensing_restart_counter(struct sensing *sensing, size_t joint);

#endif
