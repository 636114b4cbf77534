/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Scenarios: tests of a rig with a verdict, as files (config/scenarios/). A scenario names a rig
 * and its start, stimuli (frames, voltages, faults, pushes) and expectations (signals in a band,
 * frames and log lines in time or never). It is read once for each combination of its parameters,
 * and run in virtual time. What ends a run that does not end by itself is processor time, and in
 * lockstep a wait for the next STEP that no load explains.
 *
 * A run ends at the first expectation that is not met, unless it is mutated or told otherwise: what
 * was still open then is not judged.
 *
 * Time. Everything is placed relative to a label, by default "start", virtual time 0. The runner
 * sets "start", "ready" (the host's start-up is complete, or all motors are on), "clean_up"
 * (duration_s) and the labels of stimuli, each at the moment it first happens.
 *
 * Mutations. A scenario declares what must make it fail: a mutation adds a fault or omits stimuli,
 * and names the expectations that must then not be met. When every expectation of a scenario fails
 * under some mutation, the scenario is known to test something. Not RT-safe.
 */
#ifndef APP_SCENARIO_SCENARIO_H
#define APP_SCENARIO_SCENARIO_H

#include "base/arena.h"
#include "base/error.h"
#include "base/yaml.h"
#include "canbus/frame.h"
#include "rig/rig.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

enum {
    SCENARIO_STIMULI_MAX = 128,
    SCENARIO_EXPECTATIONS_MAX = 32,
    SCENARIO_MUTATIONS_MAX = 32,
    SCENARIO_CASES_MAX = 4096, /* combinations of the parameters of one file */
    SCENARIO_PARAMETERS_MAX = 16,
    SCENARIO_VALUE_MAX = 64, /* bytes of a parameter's value as text, with the end */
    SCENARIO_TEXT = 256,
};

enum scenario_host {
    SCENARIO_HOST_NONE,
    SCENARIO_HOST_ENABLED, /* discovers and configures the boards, and switches all motors on */
    SCENARIO_HOST_PROGRAM, /* a program under test, which joins through the gateway */
};

/* ---- as read ---- */

/* A pattern of frames: two hexadecimal digits a byte, x for a digit that may be any. */
struct scenario_pattern {
    struct yaml_mark mark;
    const char *bus;
    int64_t id, id_mask;
    bool extended;
    const char *data;
    /* derived */
    int bus_index;
    uint8_t len; /* bytes of the pattern; a frame may have more */
    uint8_t byte[64], mask[64];
};

/* A frame to be sent. */
struct scenario_frame {
    struct yaml_mark mark;
    const char *bus;
    int64_t id, copies; /* copies: frames sent at once */
    const char *data;
    bool extended, fd, remote;
    /* derived */
    int bus_index;
    struct bus_frame frame;
};

/* A voltage for a joint, held until the stimulus ends. */
struct scenario_voltage {
    struct yaml_mark mark;
    const char *joint;
    double volts;
    int axis; /* derived */
};

/* A motor to be switched on or off. */
struct scenario_motor {
    struct yaml_mark mark;
    const char *joint; /* or "all" */
    bool on;
    int axis; /* derived; -1 = all */
};

/* A force on a body for a time. */
struct scenario_push {
    struct yaml_mark mark;
    const char *body;
    double force_n[3], moment_nm[3]; /* world frame, at the body's origin */
    int index;                       /* derived */
};

enum scenario_action {
    SCENARIO_FRAME,
    SCENARIO_VOLTAGE,
    SCENARIO_MOTOR,
    SCENARIO_PUSH,
    SCENARIO_FAULT,
    SCENARIO_SILENCE, /* the host sends nothing for a time */
    SCENARIO_MARK,    /* sets its label, does nothing else */
};

/* Something that is done to the bench at a time. */
struct scenario_stimulus {
    struct yaml_mark mark;
    const char *label, *after;
    double at_s, for_s, every_s;
    struct scenario_frame frame;
    struct scenario_voltage voltage;
    struct scenario_motor motor;
    struct scenario_push push;
    const char *fault;
    bool silence;
    enum scenario_action action; /* derived */
    int label_index, after_index;
};

/* How an expectation is judged. */
enum scenario_look {
    SCENARIO_BETWEEN, /* every sample in the window is within the band */
    SCENARIO_REACHES, /* some sample in the window is within the band */
    SCENARIO_SEEN,    /* frames or events: their number in the window is within the band */
    /* Frames: the time between two, and from the window's edges, is within the band. */
    SCENARIO_PERIOD,
};

/* Something that the bench must show in a window of time. */
struct scenario_expectation {
    struct yaml_mark mark;
    const char *name, *after;
    double from_s, to_s, within_s;
    const char *signal, *event; /* one of these or frame; NULL = not given */
    double between[2], reaches[2], count[2], period_s[2];
    bool relative; /* counts from the signal's value when the window opens */
    bool never;
    struct scenario_pattern frame;
    enum scenario_look look; /* derived */
    bool ends;               /* at to_s */
    double band[2];
    int after_index;
};

/* A change that must make expectations fail. */
struct scenario_mutation {
    struct yaml_mark mark;
    const char *name;
    const char *fault;
    const char *without; /* label of stimuli that are left out */
    size_t nfail;
    const struct yaml_name *fails; /* names of expectations that must fail; none = any */
};

/* A parameter: numbers or words, never both. */
struct scenario_parameter {
    struct yaml_mark mark;
    const char *name;
    size_t nvalue, nword;
    double *value;
    struct yaml_name *word;
};

/* The text that stands for ${NAME} in a case. */
struct scenario_value {
    const char *name, *text;
};

/* A scenario as read, in one combination of its parameters. */
struct scenario {
    struct yaml_mark mark;
    const char *file, *name, *description;
    const char *rig; /* path or name as written */
    int clock, hold, wire, host;
    bool settle, to_the_end;
    int64_t seed;
    double duration_s, clean_up_s;
    double cpu_limit_s;  /* processor time of the run's process */
    double wall_limit_s; /* wall-clock wait for the next STEP in lockstep */
    const char *task;
    size_t nfault, nstimulus, ncleanup, nexpectation, nmutation, nparameter;
    struct yaml_name *fault;
    struct scenario_stimulus *stimulus; /* derived: those of clean_up are appended */
    struct scenario_stimulus *clean_up;
    struct scenario_expectation *expectation;
    struct scenario_mutation *mutation;
    struct scenario_parameter *parameter;

    /* derived */
    const char *rig_path;
    size_t nlabel;
    const char *label[SCENARIO_STIMULI_MAX + 3]; /* the first three: start, ready, clean_up */
    char values[SCENARIO_TEXT]; /* values of the parameters in this case: "a=1, b=2" or "" */
    size_t nvalue;
    const struct scenario_value *value; /* the same values, in the file's order */
    /* Text of a rig file that extends the rig with them; NULL = the rig itself. */
    const char *changes;
    size_t changes_size;
    uint64_t text_hash; /* hash of the file with the values put in */
};

enum { SCENARIO_LABEL_START, SCENARIO_LABEL_READY, SCENARIO_LABEL_CLEAN_UP, SCENARIO_LABELS };

/* Reads a file and makes a scenario of every combination of its parameters, the last one varying
 * fastest. Errors begin with file:line:column. Names of the rig are checked by scenario_bind. Not
 * RT-safe. */
enum error_code scenario_read(const char *path, struct arena *arena, struct scenario **cases,
                              size_t *count, struct error *error);

/* Reads a file with values given instead of its own, one for each parameter that is named.
 * ERROR_INPUT when the file has no such parameter. */
enum error_code scenario_read_with(const char *path, const struct scenario_value *given,
                                   size_t ngiven, struct arena *arena, struct scenario **cases,
                                   size_t *count, struct error *error);

/* Reads a scenario from memory, as scenario_read does. */
enum error_code scenario_read_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, struct scenario **cases, size_t *count,
                                   struct error *error);

/* Loads the rig of a scenario, with its changes. Everything lives in arena. Not RT-safe. */
enum error_code scenario_load_rig(const struct scenario *scenario, struct arena *arena,
                                  const struct rig **rig, struct error *error);

/* Finds the buses, joints, bodies and signals of stimuli and expectations in the rig. Not
 * RT-safe. */
enum error_code scenario_bind(struct scenario *scenario, const struct rig *rig,
                              struct error *error);

/* Returns the kinds of signals and their meanings, a line each; NULL ends. */
const char *const *scenario_signal_help(void);

/* Checks whether a frame matches a pattern. */
bool scenario_pattern_matches(const struct scenario_pattern *pattern,
                              const struct bus_frame *frame);

/* ---- a run ---- */

/* The verdict on one expectation. */
struct scenario_verdict {
    bool met;
    bool judged;     /* false: the run ended at a failure before it was decided */
    int64_t time_ns; /* virtual time of the decision; -1 = never */
    bool has_margin; /* for a signal that must stay between two bounds */
    double margin;   /* its least distance from either bound, as a share of their distance */
    char text[SCENARIO_TEXT]; /* what was found and what was expected, when it was not met */
};

/* What came out of a run. */
struct scenario_outcome {
    bool ran; /* false: text says why there are no verdicts */
    char text[SCENARIO_TEXT];
    char unrecorded[SCENARIO_TEXT]; /* why there is no recording, or not all of it; "" = none */
    size_t nverdict;
    struct scenario_verdict verdict[SCENARIO_EXPECTATIONS_MAX];
    uint64_t state_hash, seed;
    uint64_t rig_hash; /* hash of what the rig was read from */
    int64_t virtual_ns, wall_ns;
};

/* How a run differs from what the scenario says. */
struct scenario_options {
    int mutation; /* index, -1 = none */
    bool seed_given;
    uint64_t seed;
    bool to_the_end;     /* go on although an expectation was not met */
    const char *program; /* command of host: program; NULL = none */
    /* Folder for the program's log, and in its environment; NULL = that of record. */
    const char *scratch;
    const char
        *record; /* directory for the recording and the plots of what was not met; NULL = none */
};

/* Runs the scenario in this process, with memory of its own. Not RT-safe. */
void scenario_run(struct scenario *scenario, const struct scenario_options *options,
                  struct scenario_outcome *outcome);

/* Checks whether every expectation was met. */
bool scenario_passed(const struct scenario_outcome *outcome);

/* Checks whether a mutated run failed where the mutation says; *missed is the expectation that was
 * met in spite of it, or "" when any failure would have done. */
bool scenario_flipped(const struct scenario *scenario, size_t mutation,
                      const struct scenario_outcome *outcome, const char **missed);

#endif
