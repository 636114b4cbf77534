/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the files of the scenario runner. Not RT-safe. */
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

/* Access to the run for stimuli, signals and expectations; only in the loop's thread. */
struct scenario_view {
    const struct rig *rig;
    struct simulator *simulator;
    struct host *host; /* NULL = none */
    int host_phase;    /* enum host_phase */
};

/* A quantity that can be read each tick. */
struct scenario_signal {
    double (*read)(const struct scenario_view *view, size_t a, size_t b);
    size_t a, b; /* index of the joint, sensor or bus; index of the quantity */
    bool host;   /* the signal needs a host */
};

/* Schema of a scenario file: all keys with their limits. */
extern const struct yaml_schema scenario_file_schema;
extern const struct yaml_schema scenario_parameter_schema;

/* Finds a signal by its name. Errors begin with the place mark. */
enum error_code scenario_signal_find(const char *name, const struct rig *rig,
                                     const struct yaml_mark *mark, struct scenario_signal *signal,
                                     struct error *error);

/* Checks everything that does not need the rig, and derives actions, labels and patterns. */
enum error_code scenario_check(struct scenario *scenario, struct arena *arena, struct error *error);

/* Time of each label, ns of virtual time; -1 = not yet. */
struct scenario_clock {
    int64_t label_ns[SCENARIO_STIMULI_MAX + SCENARIO_LABELS];
};

/* ---- stimuli ---- */

struct scenario_stimuli;

/* Prepares the stimuli of a run. mutation: index or -1. fault: receives the lines for
 * simulator_config; it has room for the scenario's lines, one per stimulus, and one for the
 * mutation. */
enum error_code scenario_stimuli_create(const struct scenario *scenario, int mutation,
                                        struct arena *arena, struct scenario_stimuli **stimuli,
                                        const char **fault, size_t *nfault, struct error *error);

/* Executes the stimuli that are due at time_ns; ports are the scenario's own ports of the
 * buses. */
void scenario_stimuli_step(struct scenario_stimuli *stimuli, const struct scenario_view *view,
                           const struct bus_ports *ports, struct scenario_clock *clock,
                           int64_t time_ns);

/* Checks whether the host must not send in this tick. */
bool scenario_stimuli_silence(const struct scenario_stimuli *stimuli);

/* ---- expectations ---- */

struct scenario_expectations;

/* Prepares the expectations of a run. ticks: number of samples to store per expectation, for a
 * plot. */
enum error_code scenario_expectations_create(const struct scenario *scenario, const struct rig *rig,
                                             size_t ticks, struct arena *arena,
                                             struct scenario_expectations **expectations,
                                             struct error *error);

/* Count a frame on a bus, and a log line, for the expectations that look for them. */
void scenario_expectations_frame(struct scenario_expectations *expectations, size_t bus,
                                 const struct bus_frame *frame);
void scenario_expectations_event(struct scenario_expectations *expectations, const char *text);

/* Judges the tick that ended at time_ns; call it after the tick's frames and events. Returns true
 * if an expectation has failed, now or earlier. */
bool scenario_expectations_step(struct scenario_expectations *expectations,
                                const struct scenario_view *view,
                                const struct scenario_clock *clock, int64_t time_ns);

/* Closes all windows at the end of the run, time_ns; planned_ns is the intended end. An
 * expectation whose window should have stayed open longer (to its own end, or the intended end of
 * the run) is not met, because it was not observed completely. If the run ended early because
 * another expectation failed, such an expectation is not judged. */
void scenario_expectations_finish(struct scenario_expectations *expectations,
                                  const struct scenario_clock *clock, int64_t time_ns,
                                  int64_t planned_ns, bool early, struct scenario_outcome *outcome);

/* Plots each failed expectation to directory/expectation-N.svg. */
enum error_code scenario_expectations_plot(const struct scenario_expectations *expectations,
                                           const struct scenario_outcome *outcome,
                                           const char *directory, struct error *error);

#endif
