/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the files of the scenario runner. Not RT-safe. */
#ifndef APP_SCENARIO_PRIVATE_H
#define APP_SCENARIO_PRIVATE_H

#include "app/scenario/scenario.h"
#include "sim/simulator.h"
#include "tasks/host.h"

#include <math.h>

/* Converts seconds of a scenario file into ns. */
static inline int64_t scenario_ns(double seconds)
{
    return llround(seconds * 1e9);
}

/* What stimuli, signals and expectations work on; used in the loop's thread only. */
struct scenario_view {
    const struct rig *rig;
    struct simulator *simulator;
    struct host *host; /* NULL = none */
    int host_phase;    /* enum host_phase */
};

/* A quantity that can be read every tick. */
struct scenario_signal {
    double (*read)(const struct scenario_view *view, size_t a, size_t b);
    size_t a, b; /* index of the joint, sensor or bus; which of its quantities */
    bool host;   /* needs a host */
};

/* The form of a scenario file: every key with its limits. */
extern const struct yaml_schema scenario_file_schema;
extern const struct yaml_schema scenario_parameter_schema;

/* Finds a signal by its name. Errors begin with mark. */
enum error_code scenario_signal_find(const char *name, const struct rig *rig,
                                     const struct yaml_mark *mark, struct scenario_signal *signal,
                                     struct error *error);

/* Checks what can be checked without the rig, and derives actions, labels and patterns. */
enum error_code scenario_check(struct scenario *scenario, struct arena *arena, struct error *error);

/* When each label happened, ns of virtual time; -1 = not yet. */
struct scenario_clock {
    int64_t label_ns[SCENARIO_STIMULI_MAX + SCENARIO_LABELS];
};

/* ---- stimuli ---- */

struct scenario_stimuli;

/* Prepares the stimuli of a run. mutation: index or -1. fault: receives the lines for
 * simulator_config, and has room for those of the scenario, one of each stimulus and one of the
 * mutation. */
enum error_code scenario_stimuli_create(const struct scenario *scenario, int mutation,
                                        struct arena *arena, struct scenario_stimuli **stimuli,
                                        const char **fault, size_t *nfault, struct error *error);

/* Carries out the stimuli that are due at time_ns; ports are the scenario's own on the buses. */
void scenario_stimuli_step(struct scenario_stimuli *stimuli, const struct scenario_view *view,
                           const struct bus_ports *ports, struct scenario_clock *clock,
                           int64_t time_ns);

/* Checks whether the host must send nothing in this tick. */
bool scenario_stimuli_silence(const struct scenario_stimuli *stimuli);

/* ---- expectations ---- */

struct scenario_expectations;

/* Prepares the expectations of a run. ticks: samples to keep of each for a plot. */
enum error_code scenario_expectations_create(const struct scenario *scenario, const struct rig *rig,
                                             size_t ticks, struct arena *arena,
                                             struct scenario_expectations **expectations,
                                             struct error *error);

/* Count a frame on a bus, and a log line, where expectations look for them. */
void scenario_expectations_frame(struct scenario_expectations *expectations, size_t bus,
                                 const struct bus_frame *frame);
void scenario_expectations_event(struct scenario_expectations *expectations, const char *text);

/* Judges the tick that ended at time_ns, after its frames and events. Returns true when an
 * expectation has failed, in this tick or before. */
bool scenario_expectations_step(struct scenario_expectations *expectations,
                                const struct scenario_view *view,
                                const struct scenario_clock *clock, int64_t time_ns);

/* Closes all windows at the end of the run, time_ns, where planned_ns was intended. An expectation
 * whose window should have stayed open longer, to its own end or the intended end of the run, is
 * not met: it has not seen what it is about. Where the run was ended early because another one
 * failed, it is not judged instead. */
void scenario_expectations_finish(struct scenario_expectations *expectations,
                                  const struct scenario_clock *clock, int64_t time_ns,
                                  int64_t planned_ns, bool early, struct scenario_outcome *outcome);

/* Plots each expectation that was not met, in directory/expectation-N.svg. */
enum error_code scenario_expectations_plot(const struct scenario_expectations *expectations,
                                           const struct scenario_outcome *outcome,
                                           const char *directory, struct error *error);

#endif
