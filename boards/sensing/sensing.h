/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The sensors between the plant's true values and the boards. Each tick, a sensor applies to a
 * quantity x:
 *
 *   1. hysteresis: mechanical or magnetic, independent of the rate;
 *   2. bandwidth: a second-order low pass (Butterworth) with -3 dB at bandwidth_hz;
 *   3. latency:   x as it was latency_ns before the board's last sampling instant (linear between
 *                 ticks);
 *   4. error:     (1 + gain_error) x + offset + drift. The drift is a random walk of
 *                 drift_per_sqrt_s plus a ramp of ramp_per_s, both 0 at the start. The error also
 *                 includes a bias that fluctuates about 0 (instability). Gain and offset change
 *                 with each kelvin of the sensor's warm-up;
 *   5. noise:     white, Gaussian, noise_rms in every sample;
 *   6. converter: saturated to +-full_scale, then rounded to steps of lsb;
 *   7. faults (faults/faults.h), applied to the output.
 *
 * Hysteresis is the sum of six play operators of equal weight (Prandtl and Ishlinskii). Each is
 * half as wide as the next. The width of the widest is half the full scale. The width of a loop is
 * therefore proportional to its amplitude. Below 1/64 of the full scale there is no hysteresis. In
 * a cycle over the full scale, the distance of the branches at the center is `hysteresis` times the
 * full scale.
 *
 * Instability is a first-order Gauss-Markov process: Gaussian, instability_rms, correlation exp(-t
 * / instability_s). It is stationary from the start.
 *
 * Each board has its own clock, with a rate error d of at most drift_ppm. The seed determines d and
 * the phase. A board takes samples at the phase plus whole multiples of period_ns (1 + d). Values
 * stay constant between two samples.
 *
 * Small misalignment angles rotate the axes of the inertial sensor's gyro and accelerometer. The
 * sensor's orientation is the true attitude, or the output of its attitude filter
 * (boards/sensing/ahrs.h). Each of the four components of the quaternion is a channel. The result
 * is normalized. An attitude error of e rad about an axis is an error of e / 2 in the components.
 *
 * A link encoder with an eccentric ring has errors once and twice a turn. The constant part is
 * removed, because the encoder reads 0 where it was calibrated.
 *
 * Crosstalk comes before these steps. A joint's torque sensor also reads a part of the bending
 * moments across its axis. A force-torque sensor mixes its six channels. Such a sensor also has the
 * peak of each channel within a tick: its reading plus the true peak minus the true value.
 *
 * An incremental encoder has no absolute angle. It counts from its position at the start, and again
 * after sensing_restart_counter, because the counter is in the board. The boards round encoder
 * angles to ticks (boards_sample). They estimate velocities from the ticks as the firmware does.
 * For an ideal encoder, qd and qmd of motor_sense are true velocities. Otherwise they are computed
 * from the encoder's last two readings.
 *
 * An encoder that is mounted at an angle has an offset. A host removes the offset with the
 * calibration command 0x04. The third parameter of this command is the reading at zero.
 *
 * Each channel has its own random stream, derived from its name and the seed. Its readings do not
 * depend on other sensors. By default all errors are zero, and the readings are bit-identical to
 * the true values. faults/faults.h numbers the channels.
 *
 * Units: SI. The arena of sensing_create owns all memory. The caller owns the strings of the
 * configuration. RT-safe except sensing_create.
 */
#ifndef BOARDS_SENSING_SENSING_H
#define BOARDS_SENSING_SENSING_H

#include "boards/sensing/ahrs.h"
#include "faults/faults.h"
#include "model/plant_io.h"

struct sensor_error {
    double gain_error;       /* relative; 0.01 = readings 1 % too large */
    double offset;           /* this and all fields below: in the unit of the quantity */
    double noise_rms;        /* in each sample */
    double drift_per_sqrt_s; /* random walk of the drift */
    double ramp_per_s;       /* linear drift per second */
    double full_scale, lsb;  /* 0 = none */
    int64_t latency_ns;      /* 0 to SENSING_LATENCY_MAX_NS */
    double bandwidth_hz;     /* below half the tick rate; 0 = no low pass */
    double hysteresis;       /* fraction of the full scale; needs full_scale */
    double instability_rms, instability_s;
    double offset_per_k, gain_per_k; /* change per kelvin of the sensor's warm-up */
};

#define SENSING_LATENCY_MAX_NS INT64_C(1000000000)
#define SENSING_CLOCK_DRIFT_MAX_PPM 1e4

/* Warm-up of a sensor by its own electronics. The rise is rise_k (1 - exp(-t /
 * time_constant_s)). */
struct sensor_warm_up {
    double rise_k, time_constant_s; /* rise_k 0 = no warm-up */
};

/* Sampling clocks of the boards, described above. period_ns 0 = boards sample at the end of each
 * tick. */
struct sensor_clocks {
    int64_t period_ns; /* up to SENSING_LATENCY_MAX_NS */
    double drift_ppm;
    /* Names of the boards, by clock number. The random values of a clock depend on its name and the
     * seed. NULL = on its number and the seed */
    const char *const *name;
};

/* The winding as one thermal body: C T' = R I^2 - (T - ambient) / Rth. The true current heats it.
 * Its temperature does not change the plant's resistance. Some drives have temperatures of their
 * own (model/drives/effects.h). Their windings need no thermal model here: the sensor reads the
 * plant's temperature. */
struct sensor_thermal {
    double ambient_c;
    double resistance_ohm;  /* resistance R; 0 = read the plant's temperature */
    double k_per_w;         /* thermal resistance Rth */
    double time_constant_s; /* time constant C Rth */
};

struct sensor_joint {
    const char *name;
    struct sensor_error link_encoder, motor_encoder;  /* in rad */
    struct sensor_error current, torque, temperature; /* in A, Nm, K */
    bool incremental;                                 /* the motor encoder is incremental */
    /* Amplitudes of the link encoder's errors once and twice per turn. The seed determines the
     * phases */
    double eccentricity_rad[2];
    /* fraction of each bending moment across the axis that the torque sensor reads. The seed
     * determines the signs */
    double crosstalk;
    struct sensor_thermal thermal;
    struct sensor_warm_up warm_up;
    size_t clock; /* number of the board's clock; sensors with one number share a clock */
};

struct sensor_ft {
    const char *name;
    struct sensor_error force, torque; /* for each of three channels; in N, Nm */
    /* Reading of a channel, as a fraction of its full scale, when another channel is at full scale.
     * Both channels need a full scale. The seed determines the signs */
    double crosstalk;
    struct sensor_warm_up warm_up;
    size_t clock;
};

struct sensor_imu {
    struct sensor_error gyro, accel;           /* in rad/s, m/s2 */
    struct sensor_error magnetic, orientation; /* in T; per component of the quaternion */
    double gyro_misalignment_rad[3];           /* rotation vectors that turn the axes */
    double accel_misalignment_rad[3];
    struct ahrs_config ahrs; /* on false = the orientation is the true attitude */
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
    /* list of faults; the sensors apply the faults that concern them; NULL = none */
    const struct faults *faults;
};

struct sensing;

/* Returns whether any joint's torque sensor reads bending moments. The plant must then compute
 * them. */
bool sensing_sees_bending(const struct sensing_config *config);

/* Creates the sensors. The arena holds all memory, including delay lines. Returns ERROR_INPUT if a
 * latency, a resolution or a scale is out of range. Not RT-safe. */
enum error_code sensing_create(const struct sensing_config *config, struct arena *arena,
                               struct sensing **sensing, struct error *error);

/* Reads the sensors at the end of a tick, at now_ns. Returns the readings, which are valid until
 * the next call. Returns `truth` itself if all sensors are ideal. RT-safe. */
const struct plant_sensors *sensing_sample(struct sensing *sensing, int64_t now_ns,
                                           const struct plant_sensors *truth);

/* sensing_scale_noise multiplies noise_rms of all sensors by a factor, initially 1.
 * sensing_has_noise returns whether any sensor has noise. RT-safe. */
void sensing_scale_noise(struct sensing *sensing, double factor);
double sensing_noise_scale(const struct sensing *sensing);
bool sensing_has_noise(const struct sensing *sensing);

/* Restarts the counter of a joint's motor encoder when its board restarts. An incremental encoder
 * then counts from its position at the next sample. RT-safe. */
void sensing_restart_counter(struct sensing *sensing, size_t joint);

#endif
