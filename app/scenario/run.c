/* SPDX-License-Identifier: Apache-2.0 */
/* Runs a scenario once. It creates the rig and a host, and observes each tick. */
#include "app/scenario/private.h"

#include "app/scenario/program.h"
#include "base/array.h"
#include "base/json_text.h"
#include "contact/mesh/solid_store.h"
#include "sim/summary.h"

#include <limits.h>
#include <stdlib.h>
#include <time.h>

/* Maximum number of frames received in one call. */
enum { BATCH = 64 };
enum { DONE_PATIENCE_NS = 1000000000 }; /* timeout for sending a DONE, wall-clock time */

/* Reserved address space of a run, bytes; unused pages cost nothing. */
#define MEMORY ((size_t)1 << 30)

/* State of a run. */
struct run {
    struct scenario *scenario;
    struct scenario_view view;
    struct scenario_stimuli *stimuli;
    struct scenario_expectations *expectations;
    struct scenario_clock clock;
    struct bus_ports ports, host_ports;
    struct clock *wall;
    int64_t last_ns, duration_ns;
    bool has_host;          /* the runner's own host takes part */
    bool starts;            /* this host switches the motors on */
    bool to_the_end, early; /* continue after a failure; the run ended at a failure */
    int64_t stepped_ns;     /* wall-clock time of the last tick in lockstep */
    struct scenario_program program;
    /* number of DONE frames observed, and of DONE frames passed to the program */
    uint64_t dones, released;
    uint64_t mismatches; /* number of STEP frames refused so far */
    char broken[128];    /* why the program or its STEP frames stopped; "" = they did not */
    struct bus_frame batch[BATCH];
};

/* ---- once per tick ---- */

/* Passes all frames of the tick to the expectations. */
static void observe_frames(struct run *run)
{
    for (size_t b = 0; b < run->ports.count; b++) {
        size_t count;

        do {
            count = can_receive(run->ports.port[b], run->batch, BATCH);
            for (size_t i = 0; i < count; i++) {
                const struct loop_lockstep *lockstep = &run->view.rig->lockstep;

                /* Count DONE frames. A program waits for a DONE after each of its STEP frames. */
                run->dones += b == (size_t)lockstep->bus && run->batch[i].id == lockstep->done_id;
                scenario_expectations_frame(run->expectations, b, &run->batch[i]);
            }
        } while (count == BATCH);
    }
}

/* Passes all log lines of the tick to the expectations. */
static void observe_events(struct run *run)
{
    char text[512];
    uint64_t key;

    while (simulator_next_event(run->view.simulator, &key, text, sizeof text)) {
        scenario_expectations_event(run->expectations, text);
    }
}

/* Checks whether the motors of all axes are on. */
static bool motors_are_all_on(const struct run *run)
{
    const struct plant_command *command = plant_command(simulator_plant(run->view.simulator));
    size_t on = 0;

    for (size_t j = 0; j < command->njoint; j++) {
        on += command->motor[j].bridge_on;
    }
    return on >= run->view.rig->naxis;
}

/* Judges the tick that ended at time_ns, and executes stimuli. Ends the run at a failure. The
 * tick's frames and events must have been observed. */
static void scenario_run_judge_tick(struct run *run, int64_t time_ns)
{
    int64_t *label = run->clock.label_ns;
    bool ready = run->starts ? run->view.host_phase == HOST_READY : motors_are_all_on(run);

    /* Set the labels `ready` and `clean_up` when they happen */
    if (label[SCENARIO_LABEL_READY] < 0 && ready) {
        label[SCENARIO_LABEL_READY] = time_ns;
    }
    if (label[SCENARIO_LABEL_CLEAN_UP] < 0 && time_ns >= run->duration_ns) {
        label[SCENARIO_LABEL_CLEAN_UP] = time_ns;
    }
    scenario_stimuli_step(run->stimuli, &run->view, &run->ports, &run->clock, time_ns);
    if (scenario_expectations_step(run->expectations, &run->view, &run->clock, time_ns) &&
        !run->to_the_end) {
        run->early = true;
        simulator_stop(run->view.simulator);
    }
}

/* Handles a tick: observes, judges and acts. The loop calls it once per tick, and repeatedly while
 * lockstep waits for a STEP. */
static void scenario_run_step(void *context, int64_t time_ns)
{
    struct run *run = context;
    bool fresh = time_ns != run->last_ns;

    run->last_ns = time_ns;
    if (fresh) {
        observe_frames(run);
        observe_events(run);
        run->stepped_ns = run->scenario->clock == LOOP_CLOCK_LOCKSTEP ? clock_now(run->wall) : 0;
    }

    /* Let the program continue after a DONE, or after a refused STEP, which causes no tick */
    struct gateway *gateway = simulator_parts(run->view.simulator).gateway;
    const uint64_t mismatches = simulator_stats(run->view.simulator)->lockstep.mismatches;

    if (gateway) {
        if (run->dones > run->released) {
            const struct timespec pause = {.tv_nsec = 10000};
            const int64_t until = clock_now(run->wall) + DONE_PATIENCE_NS;

            /* Pass an observed DONE to the program, and wait until it is sent. Frames that the
             * program sends afterwards, and frames of stimuli, then belong to the next tick in
             * every run. */
            run->released = run->dones;
            gateway_release_done(gateway);
            while (gateway_done_count(gateway) < run->dones && clock_now(run->wall) < until) {
                nanosleep(&pause, NULL);
            }
        } else if (mismatches != run->mismatches) {
            run->mismatches = mismatches;
            gateway_release_done(gateway);
        }
    }
    if (!fresh) {
        const double limit_s = run->scenario->wall_limit_s;

        /* End a run in lockstep that gets no more STEP frames: the program has ended, or the
         * wall-clock limit has passed */
        if (scenario_program_ended(&run->program, run->broken, sizeof run->broken)) {
            simulator_stop(run->view.simulator);
        } else if (clock_now(run->wall) - run->stepped_ns > scenario_ns(limit_s)) {
            snprintf(run->broken, sizeof run->broken,
                     "no STEP has come for %g s of wall-clock time", limit_s);
            simulator_stop(run->view.simulator);
        }
    }

    /* In lockstep, the host waits for DONE */
    if (run->has_host && !host_receive(run->view.host, time_ns)) {
        host_repeat_step(run->view.host, clock_now(run->wall));
        return;
    }
    if (fresh) {
        scenario_run_judge_tick(run, time_ns);
    }
    if (run->has_host) {
        /* Let the host start the boards and send frames, unless a stimulus silences it */
        if (run->starts && run->view.host_phase < HOST_READY) {
            run->view.host_phase = host_start_up(run->view.host);
        }
        if (!scenario_stimuli_silence(run->stimuli)) {
            host_send(run->view.host);
        }
    }
}

/* ---- set-up ---- */

/* Loads the rig with the scenario's changes, and looks up the scenario's names in it. */
static enum error_code load_rig(struct run *run, struct arena *arena, struct error *error)
{
    const struct scenario *scenario = run->scenario;
    struct rig *changed = arena_alloc(arena, 1, sizeof *changed);
    const struct rig *rig;
    enum error_code code;

    if (!changed) {
        return error_set(error, ERROR_MEMORY, "no memory left for a scenario's rig");
    }
    code = scenario_load_rig(scenario, arena, &rig, error);
    if (code) {
        return code;
    }
    *changed = *rig;
    changed->wire.timed = yaml_has(&scenario->mark, "wire") ? scenario->wire : rig->wire.timed;
    changed->hold = yaml_has(&scenario->mark, "hold") ? (enum rig_hold)scenario->hold : rig->hold;
    changed->settle = scenario->settle || rig->settle;
    run->view.rig = changed;
    run->duration_ns = llround(scenario->duration_s * 1e9);
    return scenario_bind(run->scenario, changed, error);
}

/* Returns the number of ticks of the run, clean-up included. */
static uint64_t scenario_run_ticks(const struct run *run)
{
    double length_s = run->scenario->duration_s + run->scenario->clean_up_s;

    return (uint64_t)ceil(length_s * 1e9 / (double)run->view.rig->tick_ns - 1e-6);
}

/* Creates the simulator on local buses, and joins the buses. */
static enum error_code create_simulator(struct run *run, const struct scenario_options *options,
                                        const struct simulator_observer *observer,
                                        const char **fault, size_t nfault, struct arena *arena,
                                        struct error *error)
{
    const struct scenario *scenario = run->scenario;
    static const struct gateway_config gateway = {.hold_done = true};
    const struct simulator_config config = {
        .rig = run->view.rig,
        .clock = (enum loop_clock)scenario->clock,
        .hold = run->view.rig->hold,
        .settle = run->view.rig->settle,
        .transport = TRANSPORT_LOCAL,
        .fault = fault,
        .nfault = nfault,
        .seed_given = options->seed_given || yaml_has(&scenario->mark, "seed"),
        .seed = options->seed_given ? options->seed : (uint64_t)scenario->seed,
        .ticks = scenario_run_ticks(run),
        .task = scenario->task,
        .observer = observer,
        .untouched = true,
        .guests = 1 + run->has_host,
        .guests_inline = true,
        .gateway = scenario->host == SCENARIO_HOST_PROGRAM ? &gateway : NULL,
        .record = options->record,
        .overwrite = true,
        .row_period_ns = run->view.rig->tick_ns,
    };
    char notice[256];
    enum error_code code = simulator_create(&config, arena, &run->view.simulator, notice, error);

    /* Join with ports to observe and send frames, and with ports for the host */
    code = code ? code : simulator_join(run->view.simulator, &run->ports, error);
    return code || !run->has_host ? code
                                  : simulator_join(run->view.simulator, &run->host_ports, error);
}

/* Creates all parts of a run. */
static enum error_code scenario_run_create(struct run *run, const struct scenario_options *options,
                                           const struct simulator_observer *observer,
                                           struct arena *arena, struct error *error)
{
    struct scenario *scenario = run->scenario;
    const char **fault =
        arena_alloc(arena, scenario->nfault + scenario->nstimulus + 1, sizeof *fault);
    size_t nfault;
    enum error_code code;

    if (!fault) {
        return error_set(error, ERROR_MEMORY, "no memory left for a scenario");
    }

    /* Decide whether the runner needs its own host. The host switches the motors on, or sends STEP
     * in lockstep if no other participant does. */
    run->starts = scenario->host == SCENARIO_HOST_ENABLED;
    run->has_host = run->starts || (scenario->clock == LOOP_CLOCK_LOCKSTEP && !scenario->task &&
                                    scenario->host != SCENARIO_HOST_PROGRAM);

    /* Load the rig first, because names, ticks and buses depend on it */
    if ((code = load_rig(run, arena, error)) ||
        (code = scenario_stimuli_create(scenario, options->mutation, arena, &run->stimuli, fault,
                                        &nfault, error)) ||
        (code = scenario_expectations_create(scenario, run->view.rig,
                                             (size_t)scenario_run_ticks(run) + 1, arena,
                                             &run->expectations, error)) ||
        (code = create_simulator(run, options, observer, fault, nfault, arena, error))) {
        return code;
    }

    const struct host_config config = rig_host_config(run->view.rig, run->host_ports.port,
                                                      scenario->clock == LOOP_CLOCK_LOCKSTEP);

    return run->has_host ? host_create(&config, arena, &run->view.host, error) : ERROR_NONE;
}

/* ---- the run ---- */

/* Writes the scenario and the values of its parameters to the summary. They determine the rig. */
static void scenario_run_put_origin(const void *context, FILE *out)
{
    const struct scenario *scenario = context;
    char file[PATH_MAX];

    fputs(", \"scenario_file\": ", out);
    json_text_put(realpath(scenario->file, file) ? file : scenario->file, out);
    fputs(", \"values\": {", out);
    for (size_t i = 0; i < scenario->nvalue; i++) {
        fputs(i ? ", " : "", out);
        json_text_put(scenario->value[i].name, out);
        fputs(": ", out);
        json_text_put(scenario->value[i].text, out);
    }
    fputs("}", out);
}

/* Completes a recording: its files, its summary and the plots of failed expectations. */
static enum error_code scenario_run_finish_recording(struct run *run, const char *record,
                                                     enum loop_end end,
                                                     struct scenario_outcome *outcome,
                                                     struct error *error)
{
    struct summary summary = {
        .simulator = run->view.simulator,
        .end = end,
        .recorded = true,
        .put_origin = scenario_run_put_origin,
        .context = run->scenario,
    };
    enum error_code code =
        simulator_finish_recording(run->view.simulator, &summary.recorder, error);

    if (code || !record) {
        return code;
    }
    code = summary_write(&summary, record, error);
    return code ? code : scenario_expectations_plot(run->expectations, outcome, record, error);
}

/* Judges the last tick, closes all expectations, and fills the outcome. */
static void scenario_run_finish(struct run *run, const struct scenario_options *options,
                                enum loop_end end, struct scenario_outcome *outcome)
{
    struct simulator *simulator = run->view.simulator;
    int64_t time_ns = simulator_stats(simulator)->time_ns;
    int64_t planned_ns = (int64_t)scenario_run_ticks(run) * run->view.rig->tick_ns;
    struct error error;

    /* Judge the frames and events of the last tick */
    observe_frames(run);
    observe_events(run);
    if (run->has_host) {
        host_receive(run->view.host, time_ns);
    }
    if (time_ns != run->last_ns) {
        scenario_run_judge_tick(run, time_ns);
    }

    /* Fill in the verdicts, and the data that identify the run */
    scenario_expectations_finish(run->expectations, &run->clock, time_ns, planned_ns, run->early,
                                 outcome);
    outcome->ran = true;
    outcome->virtual_ns = time_ns;
    outcome->rig_hash = run->view.rig->hash;
    outcome->seed = faults_seed(simulator_parts(simulator).faults);
    outcome->state_hash = plant_hash(simulator_plant(simulator));

    /* A failure of the program or the model makes the verdicts invalid. A failed recording does
     * not */
    if (run->broken[0]) {
        outcome->ran = false;
        snprintf(outcome->text, sizeof outcome->text, "%s", run->broken);
    } else if (end == LOOP_END_MODEL) {
        outcome->ran = false;
        snprintf(outcome->text, sizeof outcome->text, "%.200s", simulator_parts(simulator).failure);
    } else if (simulator_found_energy(simulator)) {
        outcome->ran = false;
        snprintf(
            outcome->text, sizeof outcome->text,
            "energy appeared from nowhere: shorten substep_s, or soften materials and springs");
    }
    if (scenario_run_finish_recording(run, options->record, end, outcome, &error)) {
        snprintf(outcome->unrecorded, sizeof outcome->unrecorded, "%.200s", error.text);
    }
}

void scenario_run(struct scenario *scenario, const struct scenario_options *options,
                  struct scenario_outcome *outcome)
{
    struct run *run = calloc(1, sizeof *run);
    struct clock *wall = clock_monotonic();
    int64_t begin = clock_now(wall);
    enum error_code code;
    struct arena arena;
    struct error error;

    memset(outcome, 0, sizeof *outcome);
    if (!run) {
        snprintf(outcome->text, sizeof outcome->text, "no memory for a run");
        return;
    }

    /* At the beginning, only the label `start` has a time */
    run->scenario = scenario;
    run->wall = wall;
    run->stepped_ns = begin;
    run->to_the_end = scenario->to_the_end || options->to_the_end || options->mutation >= 0;
    run->last_ns = -1;
    for (size_t i = 0; i < ARRAY_COUNT(run->clock.label_ns); i++) {
        run->clock.label_ns[i] = -1;
    }
    run->clock.label_ns[SCENARIO_LABEL_START] = 0;

    /* The run's arena owns all memory except the solids. Rig and simulator share the solids with
     * the other cases of a sweep */
    code = solid_store_open(&error);
    code = code ? code : arena_init(&arena, MEMORY, &error);
    if (!code) {
        const struct simulator_observer observer = {run, scenario_run_step};
        struct realtime_report unused;

        /* Create, run and destroy a simulator */
        code = scenario_run_create(run, options, &observer, &arena, &error);
        if (!code) {
            code = simulator_start(run->view.simulator, &unused, &error);
        }

        /* The gateway must listen before the program starts */
        if (!code && run->scenario->host == SCENARIO_HOST_PROGRAM) {
            code =
                scenario_program_start(&run->program, options->program,
                                       gateway_port(simulator_parts(run->view.simulator).gateway),
                                       options->record, options->scratch, &error);
        }
        if (!code) {
            enum loop_end end = simulator_run(run->view.simulator);

            scenario_program_stop(&run->program);
            scenario_run_finish(run, options, end, outcome);
        }
        bus_ports_close(&run->host_ports);
        bus_ports_close(&run->ports);
        simulator_destroy(run->view.simulator);
        arena_fini(&arena);
    }
    solid_store_close();
    if (code) {
        outcome->ran = false;
        snprintf(outcome->text, sizeof outcome->text, "%.250s", error.text);
        /* With a recorder, ERROR_SYSTEM means that the files of the recording could not be created,
         * because they are the first system resources of a run */
        if (options->record && code == ERROR_SYSTEM) {
            snprintf(outcome->unrecorded, sizeof outcome->unrecorded, "%.200s", error.text);
        }
    }
    outcome->wall_ns = clock_now(wall) - begin;
    free(run);
}

/* ---- verdicts ---- */

bool scenario_passed(const struct scenario_outcome *outcome)
{
    bool passed = outcome->ran;

    for (size_t i = 0; i < outcome->nverdict; i++) {
        passed = passed && outcome->verdict[i].met;
    }
    return passed;
}

bool scenario_flipped(const struct scenario *scenario, size_t mutation,
                      const struct scenario_outcome *outcome, const char **missed)
{
    const struct scenario_mutation *with = &scenario->mutation[mutation];

    *missed = "";
    if (!outcome->ran) {
        return false;
    }
    for (size_t k = 0; k < with->nfail; k++) {
        for (size_t i = 0; i < scenario->nexpectation; i++) {
            if (strcmp(scenario->expectation[i].name, with->fails[k].name) == 0 &&
                outcome->verdict[i].met) {
                *missed = scenario->expectation[i].name;
                return false;
            }
        }
    }
    return !scenario_passed(outcome);
}
