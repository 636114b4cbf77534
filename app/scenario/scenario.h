/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Scenarios: test files for a rig, which give a verdict (config/scenarios/). A scenario names a
 * rig, its start, stimuli and expectations. Stimuli are frames, voltages, faults and pushes.
 * Expectations require that a signal is in a band, or that a frame or a log line appears in time or
 * never. The file gives one scenario for each combination of its parameters. Scenarios run in
 * virtual time. A run that does not end is ended by a limit of processor time. In lockstep, there
 * is also a long wall-clock limit for the next STEP.
 *
 * A run ends at the first failed expectation, except with a mutation or the option to_the_end.
 * Expectations without a decision at that time are not judged.
 *
 * Time. All times are relative to a label. The default label is "start", virtual time 0. The runner
 * sets "ready" when the host's start-up is complete or all motors are on, and "clean_up" at
 * duration_s. It sets the label of a stimulus when a stimulus with this label first acts.
 *
 * Mutations. A mutation is a change that must make the scenario fail. It adds a fault or omits
 * stimuli, and names the expectations that must then fail. If each expectation fails in at least
 * one mutation, each expectation can detect a fault. Not RT-safe.
 */
#ifndef APP_SCENARIO_SCENARIO_H
#define APP_SCENARIO_SCENARIO_H

#include "base/arena.h"
#include "base/error.h"
#include "base/yaml.h"
#include "canbus/frame.h"
#include "rig/rig.h"

#include <stdio.h>

enum {
    SCENARIO_STIMULI_MAX = 128,
    SCENARIO_EXPECTATIONS_MAX = 32,
    SCENARIO_MUTATIONS_MAX = 32,
    SCENARIO_CASES_MAX = 4096, /* combinations of the parameters of one file */
    SCENARIO_PARAMETERS_MAX = 16,
    SCENARIO_VALUE_MAX = 64, /* bytes of a parameter's value as text, with the terminating 0 */
    SCENARIO_TEXT = 256,
};

enum scenario_host {
    SCENARIO_HOST_NONE,
    SCENARIO_HOST_ENABLED, /* discovers and configures the boards, and switches all motors on */
    SCENARIO_HOST_PROGRAM, /* a program under test that joins through the gateway */
};

/* ---- data from the file ---- */

/* A pattern for frames: two hexadecimal digits per byte, x for any digit. */
struct scenario_pattern {
    struct yaml_mark mark;
    const char *bus;
    int64_t id, id_mask;
    bool extended;
    const char *data;
    /* derived */
    int bus_index;
    uint8_t len; /* bytes of the pattern; a frame may be longer */
    uint8_t byte[64], mask[64];
};

/* A frame to be sent. */
struct scenario_frame {
    struct yaml_mark mark;
    const char *bus;
    int64_t id, copies; /* copies: number of frames sent at once */
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
    const char *joint; /* name, or "all" */
    bool on;
    int axis; /* derived; -1 = all */
};

/* A force on a body for some time. */
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
    SCENARIO_SILENCE, /* the host sends nothing for some time */
    SCENARIO_MARK,    /* only sets its label */
};

/* An action on the rig at a time. */
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
    SCENARIO_BETWEEN, /* each sample in the window is within the band */
    SCENARIO_REACHES, /* at least one sample in the window is within the band */
    SCENARIO_SEEN,    /* frames or events: their number in the window is within the band */
    /* frames: each gap between frames, and to the window's edges, is within the band */
    SCENARIO_PERIOD,
};

/* A required behavior of the rig in a window of time. */
struct scenario_expectation {
    struct yaml_mark mark;
    const char *name, *after;
    double from_s, to_s, within_s;
    const char *signal, *event; /* NULL = not given; exactly one of signal, event, frame is given */
    double between[2], reaches[2], count[2], period_s[2];
    bool relative; /* values are relative to the signal's value when the window opens */
    bool never;
    struct scenario_pattern frame;
    enum scenario_look look; /* derived */
    bool ends;               /* the window ends at to_s */
    double band[2];
    int after_index;
};

/* A change that must make expectations fail. */
struct scenario_mutation {
    struct yaml_mark mark;
    const char *name;
    const char *fault;
    const char *without; /* label of the stimuli that are omitted */
    size_t nfail;
    const struct yaml_name *fails; /* expectations that must fail; empty = at least one, any */
};

/* A parameter: numbers or words, not both. */
struct scenario_parameter {
    struct yaml_mark mark;
    const char *name;
    size_t nvalue, nword;
    double *value;
    struct yaml_name *word;
};

/* The text that replaces ${NAME} in a case. */
struct scenario_value {
    const char *name, *text;
};

/* A scenario of the file, with one combination of the parameters' values. */
struct scenario {
    struct yaml_mark mark;
    const char *file, *name, *description;
    const char *rig; /* path or name as in the file */
    int clock, hold, wire, host;
    bool settle, to_the_end;
    int64_t seed;
    double duration_s, clean_up_s;
    double cpu_limit_s;  /* limit of processor time of the run's process */
    double wall_limit_s; /* limit of the wall-clock wait for the next STEP in lockstep */
    const char *task;
    size_t nfault, nstimulus, ncleanup, nexpectation, nmutation, nparameter;
    struct yaml_name *fault;
    struct scenario_stimulus *stimulus; /* the stimuli of clean_up are appended */
    struct scenario_stimulus *clean_up;
    struct scenario_expectation *expectation;
    struct scenario_mutation *mutation;
    struct scenario_parameter *parameter;

    /* derived */
    const char *rig_path;
    size_t nlabel;
    const char *label[SCENARIO_STIMULI_MAX + 3]; /* the first three are start, ready, clean_up */
    char values[SCENARIO_TEXT]; /* values of the parameters in this case: "a=1, b=2" or "" */
    size_t nvalue;
    const struct scenario_value *value; /* the same values, in the file's order */
    /* text of a rig file that extends the rig with the changes; NULL = no changes */
    const char *changes;
    size_t changes_size;
    uint64_t text_hash; /* hash of the file with the parameters' values inserted */
};

enum { SCENARIO_LABEL_START, SCENARIO_LABEL_READY, SCENARIO_LABEL_CLEAN_UP, SCENARIO_LABELS };

/* Reads a file and makes one scenario per combination of its parameters. The last parameter varies
 * fastest. Error messages begin with file:line:column. Names of the rig are checked later, by
 * scenario_bind. Not RT-safe. */
enum error_code scenario_read(const char *path, struct arena *arena, struct scenario **cases,
                              size_t *count, struct error *error);

/* Like scenario_read, but each given value replaces the file's values of its parameter. Returns
 * ERROR_INPUT if the file does not have the parameter. */
enum error_code scenario_read_with(const char *path, const struct scenario_value *given,
                                   size_t ngiven, struct arena *arena, struct scenario **cases,
                                   size_t *count, struct error *error);

/* Like scenario_read, but reads the text from memory. */
enum error_code scenario_read_text(const char *name, const char *text, size_t size,
                                   struct arena *arena, struct scenario **cases, size_t *count,
                                   struct error *error);

/* Loads the rig of a scenario with its changes. The arena owns all memory. Not RT-safe. */
enum error_code scenario_load_rig(const struct scenario *scenario, struct arena *arena,
                                  const struct rig **rig, struct error *error);

/* Looks up the buses, joints, bodies and signals of stimuli and expectations in the rig. Not
 * RT-safe. */
enum error_code scenario_bind(struct scenario *scenario, const struct rig *rig,
                              struct error *error);

/* Returns the kinds of signals with their meanings, one line each; NULL ends the list. */
const char *const *scenario_signal_help(void);

/* Checks whether a frame matches a pattern. */
bool scenario_pattern_matches(const struct scenario_pattern *pattern,
                              const struct bus_frame *frame);

/* ---- a run ---- */

/* The verdict on one expectation. */
struct scenario_verdict {
    bool met;
    bool judged;     /* false: the run ended before the decision, at another failure */
    int64_t time_ns; /* virtual time of the decision; -1 = no decision */
    bool has_margin; /* true for a signal that must stay between two bounds */
    /* smallest distance from a bound, divided by the distance between the bounds */
    double margin;
    char text[SCENARIO_TEXT]; /* found and expected values of a failed expectation */
};

/* The outcome of a run. */
struct scenario_outcome {
    bool ran; /* false: no verdicts; text has the reason */
    char text[SCENARIO_TEXT];
    char unrecorded[SCENARIO_TEXT]; /* reason for a missing or incomplete recording; "" = none */
    size_t nverdict;
    struct scenario_verdict verdict[SCENARIO_EXPECTATIONS_MAX];
    uint64_t state_hash, seed;
    uint64_t rig_hash; /* hash of the rig's sources */
    int64_t virtual_ns, wall_ns;
};

/* Options of a run. */
struct scenario_options {
    int mutation; /* index of a mutation, -1 = none */
    bool seed_given;
    uint64_t seed;
    bool to_the_end;     /* continue after a failed expectation */
    const char *program; /* command of host: program; NULL = none */
    /* working folder of the program, named in its environment. Without record, it also has the
     * program's log. NULL = none */
    const char *scratch;
    /* directory for the recording and the plots of failed expectations; NULL = none */
    const char *record;
};

/* Runs the scenario in this process, with its own memory. Not RT-safe. */
void scenario_run(struct scenario *scenario, const struct scenario_options *options,
                  struct scenario_outcome *outcome);

/* Checks whether every expectation was met. */
bool scenario_passed(const struct scenario_outcome *outcome);

/* Checks whether a run failed as its mutation requires. If a named expectation did not fail,
 * *missed receives its name. Otherwise *missed is "". */
bool scenario_flipped(const struct scenario *scenario, size_t mutation,
                      const struct scenario_outcome *outcome, const char **missed);

#endif
