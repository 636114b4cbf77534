/* SPDX-License-Identifier: Apache-2.0 */
/* Declarations shared by the files of the scenario runner. Not RT-safe. */
#ifndef APP_SCENARIO_PRIVATE_H
#define APP_SCENARIO_PRIVATE_H

#include "app/scenario/scenario.h"
#include "sim/simulator.h"
#include "tasks/host.h"

#include <math.h>
#include <string.h>

/* Converts seconds of a scenario file into ns. */
static inline int64_t scenario_ns(double seconds)
{
    return llround(seconds * 1e9);
}

/* Gives stimuli, signals and expectations access to the run, only in the loop's thread. */
struct scenario_view {
    const struct rig *rig;
    struct simulator *simulator;
    struct host *host; /* NULL = none */
    int host_phase;    /* enum host_phase */
};

/* A quantity that can be read each tick. */
struct scenario_signal {
    double (*read)(const struct scenario_view *view, size_t a, size_t b);
    size_t a, b; /* index of the joint, sensor or bus; index of its quantity */
    bool host;   /* the signal needs a host */
};

/* Schema of a scenario file: all keys with their limits. */
extern const struct yaml_schema scenario_file_schema;
extern const struct yaml_schema scenario_parameter_schema;

/* Finds a signal by its name. Error messages begin with file:line:column from mark. */
enum error_code scenario_signal_find(const char *name, const struct rig *rig,
                                     const struct yaml_mark *mark, struct scenario_signal *signal,
                                     struct error *error);

/* Checks the parts that do not need the rig, and derives actions, labels and patterns. */
enum error_code scenario_check(struct scenario *scenario, struct arena *arena, struct error *error);

/* Time of each label, ns of virtual time; -1 = not yet. */
struct scenario_clock {
    int64_t label_ns[SCENARIO_STIMULI_MAX + SCENARIO_LABELS];
};

/* ---- stimuli ---- */

struct scenario_stimuli;

/* Prepares the stimuli of a run. mutation: index, or -1 for none. fault: receives the fault lines
 * for simulator_config. It needs space for the scenario's lines, one line per stimulus, and one for
 * the mutation. */
enum error_code scenario_stimuli_create(const struct scenario *scenario, int mutation,
                                        struct arena *arena, struct scenario_stimuli **stimuli,
                                        const char **fault, size_t *nfault, struct error *error);

/* Executes the stimuli that are due at time_ns. ports: the scenario's own ports on the buses. */
void scenario_stimuli_step(struct scenario_stimuli *stimuli, const struct scenario_view *view,
                           const struct bus_ports *ports, struct scenario_clock *clock,
                           int64_t time_ns);

/* Returns whether a stimulus silences the host in this tick. */
bool scenario_stimuli_silence(const struct scenario_stimuli *stimuli);

/* ---- expectations ---- */

struct scenario_expectations;

/* Prepares the expectations of a run. ticks: number of samples that an expectation stores for its
 * plot. */
enum error_code scenario_expectations_create(const struct scenario *scenario, const struct rig *rig,
                                             size_t ticks, struct arena *arena,
                                             struct scenario_expectations **expectations,
                                             struct error *error);

/* Count a frame on a bus, or a log line, for the expectations that match it. */
void scenario_expectations_frame(struct scenario_expectations *expectations, size_t bus,
                                 const struct bus_frame *frame);
void scenario_expectations_event(struct scenario_expectations *expectations, const char *text);

/* Judges the tick that ended at time_ns. Call it after the tick's frames and events. Returns true
 * if an expectation has failed, now or earlier. */
bool scenario_expectations_step(struct scenario_expectations *expectations,
                                const struct scenario_view *view,
                                const struct scenario_clock *clock, int64_t time_ns);

/* Closes all windows at time_ns, the end of the run. planned_ns: the intended end. A window that
 * should have lasted longer was not observed completely, so its expectation is not met. If the run
 * ended early because another expectation failed, such an expectation is not judged. */
void scenario_expectations_finish(struct scenario_expectations *expectations,
                                  const struct scenario_clock *clock, int64_t time_ns,
                                  int64_t planned_ns, bool early, struct scenario_outcome *outcome);

/* Plots each failed expectation to directory/expectation-N.svg. */
enum error_code scenario_expectations_plot(const struct scenario_expectations *expectations,
                                           const struct scenario_outcome *outcome,
                                           const char *directory, struct error *error);

#endif
