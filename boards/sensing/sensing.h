/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The sensors between the plant's true values and the boards. Each tick, a sensor applies to a
 * quantity x:
 *
 *   1. hysteresis: of the part that bends or magnetizes, independent of the rate;
 *   2. bandwidth: a second-order low pass (Butterworth) with -3 dB at bandwidth_hz;
 *   3. latency:   x as it was latency_ns before the board's last sampling instant (linear between
 *                 ticks);
 *   4. error:     (1 + gain_error) x + offset + drift. The drift is a random walk of
 *                 drift_per_sqrt_s plus a ramp of ramp_per_s, both 0 at the start. Added are a
 *                 bias that fluctuates about 0 (instability), and the changes of gain and offset
 *                 per kelvin of the sensor's warm-up;
 *   5. noise:     white, Gaussian, noise_rms in every sample;
 *   6. converter: saturated to +-full_scale, then rounded to steps of lsb;
 *   7. faults (faults/faults.h), applied to the output.
 *
 * Hysteresis is the sum of six play operators of equal weight (Prandtl and Ishlinskii). Each is
 * half as wide as the next; the widest is as wide as half the full scale. The width of a loop is
 * therefore proportional to its amplitude, down to 1/64 of the full scale; below it there is no
 * hysteresis. In a cycle over the full scale the branches are `hysteresis` of the full scale apart
 * at the center.
 *
 * Instability is a first-order Gauss-Markov process: Gaussian, instability_rms, correlation exp(-t
 * / instability_s). It is stationary from the start.
 *
 * Each board has its own clock. A board samples every period_ns of a clock with a rate error d, at
 * most drift_ppm. d and the phase are drawn from the seed. The last sample was taken at a whole
 * multiple of period_ns (1 + d) after the phase. Values stay constant between two samples.
 *
 * The axes of the inertial sensor's gyro and accelerometer are turned by small misalignment angles.
 * Its orientation is the true attitude, or the output of its own attitude filter
 * (boards/sensing/ahrs.h). The four components of the quaternion are channels like others, and the
 * result is normalized. An attitude error of e rad about an axis is an error of e / 2 in the
 * components.
 *
 * A link encoder with an eccentric ring has errors once and twice a turn. The constant part is
 * removed, because the encoder reads 0 where it was calibrated.
 *
 * Crosstalk comes before these steps. A joint's torque sensor shows a part of the bending moments
 * across its axis; a force-torque sensor mixes its six channels. A channel's peak within a tick
 * exceeds its reading by as much as the true peak exceeds the true value. An incremental encoder
 * has no absolute angle: it counts from its position at the start, and again after
 * sensing_restart_counter, because the counter is in the board. The boards round encoder angles to
 * ticks (boards_sample) and estimate velocities from the ticks as the firmware does. motor_sense's
 * qd and qmd are true velocities for an ideal encoder, else the difference of its last two
 * readings.
 *
 * An encoder that is mounted at an angle has an offset. A host removes it with the calibration
 * command 0x04, whose third parameter is the reading at zero.
 *
 * Each channel has its own random stream, derived from its name and the seed. Its readings do not
 * depend on other sensors. With all errors zero, the default, the boards get the true values bit
 * for bit. faults/faults.h numbers the channels.
 *
 * Units: SI. Memory is the arena's of sensing_create; the caller owns the strings of the
 * configuration. RT-safe except sensing_create.
 */
#ifndef BOARDS_SENSING_SENSING_H
#define BOARDS_SENSING_SENSING_H

#include "boards/sensing/ahrs.h"
#include "faults/faults.h"
#include "model/plant_io.h"

struct sensor_error {
    double gain_error;       /* relative; 0.01 = readings 1 % too large */
    double offset;           /* in the unit of the quantity, as all fields below */
    double noise_rms;        /* in each sample */
    double drift_per_sqrt_s; /* of the random walk */
    double ramp_per_s;       /* linear drift per second */
    double full_scale, lsb;  /* 0 = none */
    int64_t latency_ns;      /* 0 to SENSING_LATENCY_MAX_NS */
    double bandwidth_hz;     /* below half the tick rate; 0 = no low pass */
    double hysteresis;       /* fraction of the full scale; requires full_scale */
    double instability_rms, instability_s;
    double offset_per_k, gain_per_k; /* per kelvin of the sensor's warm-up */
};

#define SENSING_LATENCY_MAX_NS INT64_C(1000000000)
#define SENSING_CLOCK_DRIFT_MAX_PPM 1e4

/* Warm-up of a sensor by its own electronics: rise_k (1 - exp(-t / time_constant_s)). */
struct sensor_warm_up {
    double rise_k, time_constant_s; /* 0 = stays at its calibration temperature */
};

/* Sampling clocks of the boards, see above. period_ns 0 = boards sample at the end of each tick. */
struct sensor_clocks {
    int64_t period_ns; /* up to SENSING_LATENCY_MAX_NS */
    double drift_ppm;
    /* Names of the boards, by clock number. The random values of a clock depend on its name and the
     * seed; NULL = on its number */
    const char *const *name;
};

/* The winding as one thermal body: C T' = R I^2 - (T - ambient) / Rth. Its heat is the motor's I2t.
 * The true current heats it; the plant's resistance does not change. Drives whose effects include
 * temperatures (model/drives/effects.h) have no winding here: the sensor reads theirs. */
struct sensor_thermal {
    double ambient_c;
    double resistance_ohm;  /* R of the winding; 0 = use the plant's temperature */
    double k_per_w;         /* Rth */
    double time_constant_s; /* C Rth */
};

struct sensor_joint {
    const char *name;
    struct sensor_error link_encoder, motor_encoder;  /* rad */
    struct sensor_error current, torque, temperature; /* A, Nm, K */
    bool incremental;                                 /* the motor encoder is incremental */
    /* amplitude of the link encoder's error once and twice a turn; phases are drawn from the
     * seed */
    double eccentricity_rad[2];
    /* fraction of each bending moment across the axis that the torque sensor shows; signs are
     * drawn from the seed */
    double crosstalk;
    struct sensor_thermal thermal;
    struct sensor_warm_up warm_up;
    size_t clock; /* number of the board's clock; sensors with the same number share a clock */
};

struct sensor_ft {
    const char *name;
    struct sensor_error force, torque; /* for each of three channels; N, Nm */
    /* fraction of its full scale that a channel shows when another channel is at full scale;
     * both need a full scale. Signs are drawn from the seed */
    double crosstalk;
    struct sensor_warm_up warm_up;
    size_t clock;
};

struct sensor_imu {
    struct sensor_error gyro, accel;           /* rad/s, m/s2 */
    struct sensor_error magnetic, orientation; /* T; per component of the quaternion */
    double gyro_misalignment_rad[3];           /* rotation vectors that turn the axes */
    double accel_misalignment_rad[3];
    struct ahrs_config ahrs; /* off = true orientation */
    struct sensor_warm_up warm_up;
    size_t clock;
};

struct sensing_config {
    size_t njoint, nft;
    const struct sensor_joint *joint; /* NULL = all joints ideal */
    const struct sensor_ft *ft;       /* NULL = all F/T sensors ideal */
    struct sensor_imu imu;
    struct sensor_clocks clocks;
    int64_t tick_ns;
    uint64_t seed;
    const struct faults *faults; /* the sensors apply their faults of this list; NULL = none */
};

struct sensing;

/* Returns whether some joint's sensor shows bending moments, so that the plant must compute
 * them. */
bool sensing_sees_bending(const struct sensing_config *config);

/* Creates the sensors. Memory from arena, including delay lines. ERROR_INPUT when a latency,
 * resolution or scale is out of range. Not RT-safe. */
enum error_code sensing_create(const struct sensing_config *config, struct arena *arena,
                               struct sensing **sensing, struct error *error);

/* Reads the sensors at the end of a tick, now_ns. Returns the readings, valid until the next call;
 * `truth` itself when all sensors are ideal. RT-safe. */
const struct plant_sensors *sensing_sample(struct sensing *sensing, int64_t now_ns,
                                           const struct plant_sensors *truth);

/* sensing_scale_noise scales all noise (noise_rms) by a factor, initially 1. sensing_has_noise
 * returns whether any sensor has noise. RT-safe. */
void sensing_scale_noise(struct sensing *sensing, double factor);
double sensing_noise_scale(const struct sensing *sensing);
bool sensing_has_noise(const struct sensing *sensing);

/* Restarts the counter of a joint's motor encoder after its board restarts. An incremental encoder
 * then counts from its position at the next sample. RT-safe. */
void sensing_restart_counter(struct sensing *sensing, size_t joint);

#endif
