/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Identifies a drive from recordings, estimates the uncertainty of the result, and validates drives
 * with other recordings. Not RT-safe.
 */
#ifndef APP_IDENTIFY_IDENTIFY_H
#define APP_IDENTIFY_IDENTIFY_H

#include "app/report/report.h"
#include "base/arena.h"
#include "base/enum_names.h"
#include "base/error.h"
#include "base/yaml.h"
#include "model/robot.h"
#include "rig/rig.h"

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* ---- numbers ---- */

/*
 * The parameters that an identification may change. Those of an electric drive have the keys of a
 * drive file; others describe the test bench. SI units, link side.
 */

enum { IDENTIFY_FREE_MAX = 48 };

/* Largest number of joints of a robot whose drives are identified. */
enum { TRIAL_JOINTS_MAX = 16 };

/* Largest number of parameters of a bench file with a value for a group of recordings. */
enum { GROUP_NUMBERS_MAX = 16 };

/* The number of a parameter is its index in `parameters` plus parameter_count times the index of
 * its joint. IDENTIFY_NONE means no parameter. For a parameter of a drive, the joint is the first
 * joint with this drive. The name of a parameter is its key, or "JOINT.KEY". */
enum { IDENTIFY_NONE = -1 };

/* Returns the number of the parameter with this name for joint 0, or IDENTIFY_NONE. */
int parameter_find(const char *name);

/* Finds the index of the parameter with this name. An unknown key is ERROR_INPUT; the error
 * suggests the nearest key. */
enum error_code parameter_check(const char *name, int *parameter, struct error *error);

/* The quantity that gives the upper bound of a parameter. */
enum scale {
    BY_SHARE,  /* 0.9 */
    BY_TORQUE, /* half of the stall torque */
    BY_SPEED,  /* no-load speed */
    BY_DAMPING,
    BY_ANGLE, /* 0.1 rad; for the offset also -0.1 rad */
    BY_TIME,  /* 20 ms */
    BY_MASS,  /* half of the mass of the link */
    BY_GAIN,  /* 3 */
    BY_OTHER
};

extern const struct parameter {
    const char *key, *meaning;
    size_t offset; /* in struct trial_robot */
    enum scale scale;
} parameters[];
extern const int parameter_count;

/* Returns the row of a parameter of any joint. */
const struct parameter *parameter_of(int parameter);

/* Numbers of the test bench that the robot file does not contain. */
struct bench_numbers {
    double offset_rad;   /* angle of the joint at which the recording says 0 */
    double delay_s;      /* delay of the command */
    double arm_kg;       /* mass of a uniform rod from the axis to the load's center of mass */
    double command_gain; /* true command divided by the recorded one */
};

/* The value of a parameter in the recordings of one group. */
struct group_number {
    struct yaml_mark mark;
    const char *group, *key;
    double value;
    int parameter; /* index of the key */
};

/* What the joint's output is fixed to. */
enum bench_output {
    OUTPUT_FREE,    /* the rig's robot */
    OUTPUT_LOCKED,  /* a lock with a load cell, rigid or with a stiffness */
    OUTPUT_INERTIA, /* an inertia without gravity */
};

struct bench_mount {
    int output;                        /* enum bench_output */
    double inertia_kg_m2, lock_nm_rad; /* lock_nm_rad 0 = rigid */
};

/* A copy of a robot whose drives can be changed. joint, effects and bench have an element per joint
 * of the robot; at lists the njoint joints that are identified. */
struct trial_robot {
    struct robot robot;
    struct robot_body body[TRIAL_JOINTS_MAX + 1];
    struct robot_joint joint[TRIAL_JOINTS_MAX];
    struct robot_effects effects[TRIAL_JOINTS_MAX];
    struct bench_numbers bench[TRIAL_JOINTS_MAX];
    size_t njoint;
    int at[TRIAL_JOINTS_MAX];
    /* by joint of the robot: the first joint with its drive, or -1 = not identified */
    int drive[TRIAL_JOINTS_MAX];
    struct bench_mount mount;
    /* feedback gain from position errors to commands, in largest commands per rad; 0 = none */
    double guide;
    struct group_number group[GROUP_NUMBERS_MAX + IDENTIFY_FREE_MAX];
    size_t ngroup;
};

/* Finds the parameters that a name selects. "JOINT.KEY" selects the parameter of one joint. "KEY"
 * selects the parameter of every drive, or of every joint if the parameter belongs to the bench.
 * ERROR_INPUT for an unknown key or joint. */
enum error_code parameter_resolve(const struct trial_robot *trial, const char *name,
                                  int parameter[TRIAL_JOINTS_MAX], size_t *count,
                                  struct error *error);

/* parameter_get returns a parameter. parameter_set sets a list of parameters, and then the
 * parameters that depend on them, unless the list contains these too. NKw_v_s_rad is proportional
 * to NKt_nm_a. load_external equals load_motor, and load_external_stribeck equals
 * load_motor_stribeck. breakaway_nm is at least coulomb_nm. */
double parameter_get(const struct trial_robot *trial, int parameter);
void parameter_set(struct trial_robot *trial, const int *parameter, const double *value,
                   size_t count);

/* Sets a parameter of the recordings of a group. */
void parameter_set_group(struct trial_robot *trial, const struct group_number *number);

/* Applies the parameters of a group to a trial. */
void parameter_take_group(struct trial_robot *trial, const char *group);

/* Computes the default bounds of a parameter from the drive's data. */
void parameter_bounds(const struct trial_robot *trial, int parameter, double supply_v,
                      double *lower, double *upper);

/* Returns whether the drive uses this key of a drive file. */
bool parameter_is_written(const struct trial_robot *trial, int parameter);

/* ---- benches and their recordings ---- */

/*
 * Test benches (config/validation). A bench file gives the meaning of a recording's columns, and
 * the control law by which the drive's firmware converted set points to voltages. It lists the free
 * parameters, the recordings with their sources, and the errors that others have published.
 */

/* A recorded command that is not a goal: V, N m of the motor on the gear, or A. Torques and
 * currents are set points of the drive's own current controller. */
enum command_kind { COMMAND_VOLTAGE, COMMAND_TORQUE, COMMAND_CURRENT };

/* Measured signals. The first one that a bench has judges it. */
enum signal {
    SIGNAL_POSITION,       /* joint angle, rad */
    SIGNAL_LOAD_TORQUE,    /* on the output, N m */
    SIGNAL_DEFLECTION,     /* of the spring, rad */
    SIGNAL_MOTOR_POSITION, /* behind the gear, rad */
    SIGNAL_CURRENT,        /* of the motor, A */
    SIGNAL_TEMPERATURE,    /* of the winding, deg C */
    SIGNAL_LOSS,           /* of steady states, a share of the measured losses; column: the load */
    SIGNALS
};

/* Keys of the signals in a bench file, and their units. */
extern const struct signal_kind {
    const char *key, *unit;
} signal_kinds[SIGNALS];

/* Columns of a recording: its signals, and others. A bench file sets exactly one of goal, voltage,
 * torque and set current, and one or more signals. */
enum {
    COLUMN_TIME = SIGNALS,
    COLUMN_GOAL,    /* set point, rad */
    COLUMN_COMMAND, /* voltage at the terminals, V; of each kind of command */
    COLUMN_ENABLED = COLUMN_COMMAND + COMMAND_CURRENT + 1, /* state of the bridge: on above 0.5 */
    COLUMN_SUPPLY,         /* V; the mean is the voltage for a duty of 1 */
    COLUMN_SPEED,          /* of steady states, rad/s */
    COLUMN_SUPPLY_CURRENT, /* of steady states, A */
    COLUMNS
};

struct bench_columns {
    struct yaml_mark mark;
    /* NULL = no such column; "*" stands for the name of the joint */
    const char *title[COLUMNS];
    const char *gain_word;    /* the number after this word in the file's comments is the gain */
    bool voltage_before;      /* a row's voltage was on before its time, as in "run --record" */
    double command_at;        /* a command starts at this share of the time to the next row */
    bool current_is_optional; /* a recording may lack the column of the current */
};

/* Standard deviations of the signals' noise; 0 = estimated by the fit. */
struct bench_sigmas {
    struct yaml_mark mark;
    double signal[SIGNALS];
};

/* A servo: duty = duty_per_rad gain (goal - position), clipped to duty_max; voltage = duty supply.
 * A host's torque loop about the spring. It computes once per row of the recording: told +=
 * torque_share (torque_gain (load torque, torque_delay_s ago) - told) correction = torque_kp
 * (reference - told), clipped to torque_limit_nm command = torque_feed_forward reference +
 * correction The correction changes only in the first row of each period torque_period_s; 0 = in
 * every row. */
struct bench_law {
    struct yaml_mark mark;
    double duty_per_rad, duty_max;
    double torque_kp, torque_period_s, torque_delay_s;
    double torque_share, torque_gain, torque_limit_nm, torque_feed_forward;
};

/* The quantities of a recording that a bench limits, with their offsets in struct response; -1 for
 * the RMS error as a share of the RMS. */
extern const struct word limit_words[];

struct bench_limit {
    struct yaml_mark mark;
    int what;              /* the value of a limit_words */
    const char *of;        /* group or file of recordings; NULL = all for validation */
    double percent;        /* largest accepted error */
    double wanted_percent; /* wanted error, which may be missed; NAN = none */
};

/* A quantity of a steady state. */
enum point_quantity {
    POINT_VOLTAGE,
    POINT_CURRENT,
    POINT_MOTOR, /* torque of the motor on the gear, N m */
    POINT_SPEED,
    POINT_LOAD,
    POINT_LOSS, /* of the drive, W; never known */
    POINT_QUANTITIES
};

/* The keys of these quantities. */
extern const struct word point_words[];

/* A measured steady state: two known quantities, and the measured value of a third. */
struct bench_point {
    struct yaml_mark mark;
    const char *what;
    double known[POINT_QUANTITIES]; /* V, A, N m, rad/s, N m; NAN = unknown */
    bool backdriven;                /* the load turns the motor back */
    int find;                       /* the measured quantity, enum point_quantity */
    double value;
};

/* A free parameter. */
struct bench_free {
    struct yaml_mark mark;
    const char *key, *group; /* group: of recordings; NULL = all */
    char name[80];           /* the key, or in a bench of several joints "JOINT.KEY" */
    double start, lower, upper;
    double expected, sigma; /* prior; sigma 0 = none */
    int parameter;
};

/* The value of the load cell that a recording takes for 0. */
enum bench_zero { ZERO_NONE, ZERO_MEAN, ZERO_START };

/* A recording file. Recordings of one group are similar, so cross-validation leaves them out
 * together. */
struct bench_recording {
    struct yaml_mark mark;
    const char *file;
    const char *crc32; /* checksum of the file, hexadecimal; NULL = not checked */
    const char *group; /* "" = none */
    int zero;          /* enum bench_zero */
    bool judge;        /* a validation recording: identifications do not use it */
};

/* Published errors: mean error on the validation recordings, rad, or on the points, as a share.
 * Arrays of two have a number in rad, and a share. */
struct bench_published {
    struct yaml_mark mark;
    const char *what;
    double error[2];
};

/* A joint of a bench. Joints that name the same drive share its parameters. Joints that name no
 * drive share parameters if their drives are equal in the robot file. */
struct bench_joint {
    struct yaml_mark mark;
    const char *joint, *drive; /* drive may be NULL */
};

struct bench {
    struct yaml_mark mark;
    const char *name, *description, *source, *license, *supports;
    const char *obtain;      /* how to get recordings that do not ship; NULL = they ship */
    const char *rig, *drive; /* one of them is NULL; a bench with a drive has only points */
    struct bench_mount mount;
    struct bench_columns columns;
    struct bench_sigmas sigmas;
    struct bench_law law;
    double robust_rad; /* larger errors count linearly; 0 = all errors are squared */
    double limit[2];   /* largest accepted mean error: [0] in the signal's unit, [1] as a share */
    struct bench_limit *limits; /* each has its own verdict */
    size_t nlimit;
    double diagram_nm; /* largest motor torque of the drive/back-drive diagram; 0 = no diagram */
    struct bench_free *free;
    struct bench_recording *recording;
    struct bench_point *point; /* a bench has either recordings or points */
    struct bench_published *published;
    struct bench_joint *joint; /* to identify; none = all driven joints of the rig */
    size_t nfree, nrecording, npoint, npublished, njoint;
    struct yaml_real_entry *number; /* parameters of drive and bench, which replace the rig's */
    struct group_number *group_number;
    size_t nnumber, ngroup_number;
};

/* A recording in memory, of one joint. The recordings of the joints of one file follow each other
 * in the order of the bench's joints, and are simulated together. With SIGNAL_LOSS the rows are
 * steady states: goal contains loads, N m, below 0 if they drive the motor; voltage speeds, rad/s;
 * time the measured losses, W. */
struct recording {
    const char *file, *name, *group; /* name: of the file, without its folder */
    size_t place;                    /* index of its joint among the joints of the bench */
    bool judge, is_log;
    char sum[9];     /* CRC-32 of the file, hexadecimal */
    bool is_checked; /* the bench file gives this sum */
    size_t count;    /* number of rows, at least 2, in order of time */
    double *time, *goal, *voltage;
    double *signal[SIGNALS]; /* NULL = not measured */
    bool *enabled;
    int64_t begin_ns;    /* of a log: the time of its first row */
    double gain, supply; /* supply 0 = as in the rig */
    bool voltage_before;
    double command_at;
    enum command_kind command; /* what the array voltage contains */
};

/* Reads a bench file. Memory is from arena. Errors have file:line:column. */
enum error_code bench_read(const char *path, struct arena *arena, struct bench *bench,
                           struct error *error);

/* Makes a bench for recordings of "coman-hil run --record". joint: the only joint to identify; NULL
 * = all joints. */
enum error_code bench_of_own(const char *joint, struct arena *arena, struct bench *bench,
                             struct error *error);

struct identify_bench;

/* Reads the recordings of all joints from a file: a candump log, or CSV, whose first lines may be
 * comments that begin with #. Compares the CRC-32 of the file with `expected`, unless this is
 * NULL. */
enum error_code recording_read(const struct identify_bench *bench, const char *path,
                               const char *expected, struct arena *arena,
                               struct recording *recording, struct error *error);

/* Returns what the commands of a bench are, unless they are goals. */
enum command_kind bench_command(const struct bench_columns *columns);

/* Allocates the rows of a recording with some signals, whose file must be set. ERROR_MEMORY. */
enum error_code recording_alloc(struct recording *r, size_t count, const bool has[SIGNALS],
                                struct arena *arena, struct error *error);

/* Subtracts the zero of the load cell: its mean, or its mean before the command first changes. */
void recording_take_zero(struct recording *recording, enum bench_zero zero);

/* Returns whether two recordings belong to one group. */
bool recording_is_with(const struct recording *one, const struct recording *other);

/* Returns the first signal of a recording, which judges it. */
enum signal recording_first(const struct recording *recording);

/* ---- recordings that are logs of candump (log.c) ---- */

/* Reads the candump log of a recording, whose file must be set. Each frame with the joint's angle
 * gives a row, with the mean of the commands since the last row. The columns position, and voltage
 * or torque, are names of signals as in coman-hil dbc. If a name is missing or is not a signal, the
 * function finds the signal by joint and unit. It skips frames of other interfaces. ERROR_INPUT
 * names the missing signal. */
enum error_code recording_read_log(const struct rig *rig, const char *joint,
                                   const struct bench_columns *columns, struct arena *arena,
                                   struct recording *recording, struct error *error);

/* ---- opened benches ---- */

enum { IDENTIFY_RECORDINGS_MAX = 64 };

/* A bench with its rig and recordings, ready for simulations. */
struct identify_bench {
    struct bench bench;
    const struct rig *rig; /* NULL for a bench that names a drive */
    double supply_v;       /* of the rig or the drive */
    struct trial_robot trial;
    struct recording *recording;
    size_t nrecording;
    bool missing; /* recordings that do not ship are not here; none is read */
};

/* ---- fits ---- */

/*
 * Fits free parameters so that free-running simulations follow recordings (output error). The
 * method is least squares by Levenberg and Marquardt (MINPACK) with finite differences. A change of
 * variables keeps the bounds. Each prior counts as one measurement.
 */

struct fit_problem {
    const struct identify_bench *bench; /* its trial has the values of the other parameters */
    const struct recording *left_out;   /* its group is not fitted to; NULL = none */
    size_t nfree;
    struct bench_free free[IDENTIFY_FREE_MAX];
    int steps;                                                  /* largest number of iterations */
    void (*progress)(int step, double rms, enum signal signal); /* NULL = none */
    const volatile sig_atomic_t *interrupted; /* nonzero ends the fit early; NULL = never */
};

/* Uncertainty of a parameter after a fit. */
enum fit_verdict {
    FIT_KNOWN,  /* 2 sigma is below FIT_KNOWN_SHARE of the value */
    FIT_ROUGH,  /* 2 sigma is larger */
    FIT_PAIRED, /* as FIT_KNOWN, but the data determine only its combination with another one */
    FIT_BOUND,  /* at a bound: the optimum lies beyond it, or the data do not determine the value */
    FIT_NOT_TOLD, /* 2 sigma is at least the value, or half of the range between the bounds */
    FIT_INTERIM,  /* the fit was interrupted */
};
extern const struct word fit_verdict_words[];

#define FIT_KNOWN_SHARE 0.05

/* Largest correlation with another parameter at which a parameter can be known. */
#define FIT_CORRELATED 0.95

struct fit_result {
    double value[IDENTIFY_FREE_MAX];
    double sigma[IDENTIFY_FREE_MAX]; /* see find_covariance; NAN after an interrupt */
    double correlation[IDENTIFY_FREE_MAX][IDENTIFY_FREE_MAX];
    enum fit_verdict verdict[IDENTIFY_FREE_MAX];
    enum signal first; /* the first measured signal */
    double coherence;  /* rows that count as one independent measurement */
    int simulations;
    struct trial_robot trial; /* has the fitted values */
};

/* Prepares a problem. The free parameters are those in key (nkey of them), else those of the bench.
 * Their bounds and priors are from the bench, if it has them. */
enum error_code fit_prepare(struct fit_problem *problem, const char *const *key, size_t nkey,
                            struct error *error);

/* Solves a problem. After an interrupt the result has the best values so far. */
enum error_code fit_solve(const struct fit_problem *problem, struct fit_result *result,
                          struct error *error);

/* Returns the index of the parameter whose correlation with parameter i is largest and above
 * FIT_CORRELATED, or -1. count: number of free parameters. */
int fit_partner(const struct fit_result *result, size_t count, size_t i);

/* ---- simulations of recordings (simulate.c), which may run in several threads at once ---- */

/* Values at each time of a recording. After a divergence they repeat the last ones. */
struct simulated {
    double *signal[SIGNALS]; /* angles have the recording's zero; NULL = not wanted */
    bool diverged;
};

/* Simulates the recordings of all joints of a file with the parameters of a trial. The joints start
 * at rest at their first positions. recording: the first one; the others follow it. out: one
 * element per joint, with arrays of the caller. */
enum error_code simulate_recording(const struct rig *rig, const struct trial_robot *trial,
                                   const struct bench_law *law, const struct recording *recording,
                                   struct simulated *out, struct error *error);

/* Errors of a simulated signal in its unit. */
struct simulation_error {
    double mean, rms, worst; /* mean: of the absolute errors */
    double share;            /* rms divided by the RMS of the measured signal */
};
struct simulation_error simulation_compare(const double *measured, const double *simulated,
                                           size_t count);

/* ---- responses (response.c) ---- */

/*
 * The response of a signal to its command. A command with at most two values is a step, any other a
 * sweep.
 *
 * Step: times from the change of the command to 10, 63 and 90 % of the change of the signal, by
 * linear interpolation. The change is between the mean before, and the mean of the last tenth.
 * Overshoot is the largest value beyond the change, as a share of it.
 *
 * Sweep: H is the cross spectrum of command and signal divided by the spectrum of the command, at
 * 1, 2, ... Hz. Both spectra are sums over seconds that overlap by half, without their means and
 * with a Hann window. Each second is weighted by the command's power in it, so noise outside the
 * sweep has no weight. Bands with less than a tenth of the strongest band's power are left out.
 * gain is |H| of the lowest band; bandwidth is the first frequency at which |H|, linear between
 * bands, is gain / sqrt 2.
 */
enum { RESPONSE_BANDS = 100 };
struct response {
    double t10, t63, t90, overshoot; /* of a step; s, share of the change */
    double gain;                     /* signal's unit by command's unit */
    double bandwidth, peak, peak_hz; /* of a sweep, Hz; peak: largest |H| */
    size_t nband;
    double band[RESPONSE_BANDS], magnitude[RESPONSE_BANDS]; /* Hz, |H| */
};

/* Computes the response. NAN: not reached, or not of this kind of command. */
void response_compute(const double *time, const double *command, const double *signal, size_t count,
                      struct response *response);

/* Computes the response of a signal to the command of a recording. */
void response_of(const struct bench_law *law, const struct recording *recording,
                 const double *signal, struct response *response);

/* ---- results ---- */

/* Mean errors per recording, in the unit of its first signal. crossed is NAN if no fit left out
 * the recording. */
struct identify_result {
    struct fit_result fit;
    double start[IDENTIFY_RECORDINGS_MAX];               /* with the initial values */
    double fitted[IDENTIFY_RECORDINGS_MAX];              /* with the fit */
    double crossed[IDENTIFY_RECORDINGS_MAX];             /* with the fit that left out its group */
    struct simulated simulated[IDENTIFY_RECORDINGS_MAX]; /* with the fit */
    size_t nfold;
    double spent_s;
    char failure[256]; /* why the fit is of no use; "" = it is of use */
};

/* Reads a bench, its rig and its recordings. For recordings that do not ship, the environment
 * variable COMAN_HIL_DATA names the folder that replaces "data" in their paths. */
enum error_code identify_open(const char *path, struct arena *arena, struct identify_bench *bench,
                              struct error *error);

/* Makes a bench for recordings of "run --record". rig: path of the rig; joint may be NULL. The
 * bench has no recordings yet. */
enum error_code identify_open_own(const char *rig, const char *joint, struct arena *arena,
                                  struct identify_bench *bench, struct error *error);

/* Replaces the recordings of the bench by these files. ERROR_INPUT if a recording of "run --record"
 * does not have a row for each tick. */
enum error_code identify_take_files(struct identify_bench *bench, const char *const *file,
                                    size_t count, struct arena *arena, struct error *error);

/* Fits the free parameters to all recordings except the validation recordings. With crossed, also
 * cross-validates: for each group, fits to the other groups. A recording without a group is its own
 * group. Memory is from arena. */
enum error_code identify_run(struct fit_problem *problem, bool crossed, struct arena *arena,
                             struct identify_result *result, struct error *error);

/* Returns the mean of the errors that are numbers; NAN if there are none. */
double identify_mean(const double *error, size_t count);

/* Writes the drive file. A comment after each identified number gives its source and its
 * uncertainty. With several drives, writes one file per drive: "a-JOINT.yaml" for the path
 * "a.yaml", with the name of the first joint of the drive. */
enum error_code identify_write_drive(const struct fit_problem *problem,
                                     const struct identify_result *result, const char *path,
                                     struct error *error);

/* Writes the page of an identification into a folder. */
enum error_code identify_write_page(const struct fit_problem *problem,
                                    const struct identify_result *result, const char *folder,
                                    struct error *error);

/* The validation of a bench with its own drive. */
struct validation {
    struct identify_bench bench;
    double error[IDENTIFY_RECORDINGS_MAX]; /* mean error of each recording, or its share */
    struct simulated simulated[IDENTIFY_RECORDINGS_MAX];
    bool judges[IDENTIFY_RECORDINGS_MAX]; /* the validation recordings; all if there are none */
    double *ours;                         /* computed value of each point */
    double mean;   /* of the validation recordings, else of all; of points, a share */
    bool is_share; /* errors are shares, else in the unit of the first signal */
    bool passed;
    size_t unchecked; /* number of recordings whose CRC-32 the bench file does not give */
};

/* Returns the verdict on a bench: "passed", "failed", "unchecked" if a recording could have changed
 * unnoticed, or "missing". */
const char *validation_verdict(const struct validation *validation);

/* Returns the unit of the errors of a bench: "%", or the unit of the first signal. */
const char *validation_unit(const struct validation *validation);

/* Returns the error of a limited quantity in recording i, %. NAN: the limit does not apply to this
 * recording, or the quantity does not exist. */
double limit_error(const struct validation *validation, const struct bench_limit *limit, size_t i);

/* Returns "held", "limit missed" or "wish missed". */
const char *limit_verdict(const struct bench_limit *limit, double error);

/* Returns the drive of the first joint of a trial. Its effects point into the trial. */
struct robot_sea trial_drive(const struct trial_robot *trial);

/* Simulates the recordings of a bench, or computes its points, with its own drive. */
enum error_code validation_run(const char *path, struct arena *arena, struct validation *validation,
                               struct error *error);

/* Writes the page on all validated benches into a folder. */
enum error_code validation_write_page(const struct validation *validation, size_t count,
                                      const char *folder, struct error *error);

/* ---- steady states (points.c) ---- */

/* Returns the quantity that a point measures, computed for a drive. Returns NAN if there is no such
 * steady state, because the motor stalls or the gear is self-locking. */
double point_compute(const struct robot_sea *sea, const struct bench_point *point);

/* Computes the losses of steady states as shares of the measured ones. Without such a state the
 * simulation diverges. */
void point_simulate(const struct trial_robot *trial, const struct recording *recording,
                    struct simulated *out);

/* Returns the median of the errors of the losses, as a share. */
double point_loss_error(const struct recording *recording, const double *loss);

/* Returns the mean of |efficiency - measured one| over the states of a recording that turn a load
 * or return power. */
double point_efficiency_error(const struct recording *recording, const double *loss);

/* Adds a drive/back-drive diagram at rest to a page. It shows the load that the motor can move, and
 * the load that turns the motor back, against motor torque. It includes the bench's points of this
 * kind. */
void point_diagram(struct report *report, const char *id, const struct robot_sea *sea,
                   const struct bench *bench);

#endif
