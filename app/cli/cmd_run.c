/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil run: runs a rig from start to summary. */
#include "app/cli/cli.h"

#include "canbus/candump.h"
#include "sim/stimulus.h"
#include "sim/summary.h"

#include <inttypes.h>
#include <signal.h>
#include <unistd.h>

static struct recorded_run recorded; /* the recorded run of --stimulus */

/* ---- the end of a run ---- */

/* Returns the exit status of a run; prints the failure, or the task's last message. */
static int run_exit_status(const struct simulator *simulator, enum loop_end end)
{
    const struct task_runner *runner = simulator_task_runner(simulator);
    struct task_runner_status task = {.status = TASK_RUNNING, .message = ""};

    if (runner) {
        task_runner_read(runner, &task);
    }

    /* Checks failures in order: the model, the deadlines, then the task */
    if (end == LOOP_END_MODEL) {
        fprintf(stderr, "%scoman-hil run: %s\n", journal_prefix(JOURNAL_ERROR),
                simulator_parts(simulator).failure);
        return STATUS_FAILED;
    }
    if (end == LOOP_END_OVERRUNS) {
        fprintf(stderr, "%scoman-hil run: stopped by overruns, as the policy says\n",
                journal_prefix(JOURNAL_ERROR));
        return STATUS_FAILED;
    }
    if (task.status == TASK_FAILED) {
        fprintf(stderr, "coman-hil run: task %s failed: %s\n",
                simulator_configuration(simulator)->task, task.message);
        return STATUS_FAILED;
    }
    if (task.status == TASK_DONE) {
        printf("task %s: %s\n", simulator_configuration(simulator)->task, task.message);
    } else if (*task.message) {
        printf("task %s, before its end: %s\n", simulator_configuration(simulator)->task,
               task.message);
    }
    return STATUS_OK;
}

/* Prints the counters of the clients. Call it after control_stop. */
static void print_clients(const struct control *control, const struct page *page)
{
    if (control) {
        /* Print the counters of the control socket, if it had clients */
        struct control_counters counters;

        control_counters(control, &counters);
        if (counters.clients + counters.refused > 0) {
            printf("control: %" PRIu64 " clients, %" PRIu64 " refused, %" PRIu64
                   " disconnected; %" PRIu64 " requests, %" PRIu64 " refused; %" PRIu64
                   " rows, %" PRIu64 " missed\n",
                   counters.clients, counters.refused,
                   counters.cut_junk + counters.cut_slow + counters.cut_silent + counters.cut_idle,
                   counters.requests, counters.refused_requests, counters.rows,
                   counters.missed_rows);
        }
    }
    page_print(page);
}

/* Closes the run's resources, prints and writes the summary, and writes the task's report to a
 * folder. control and page are NULL if clients are still connected. */
static int run_finish(struct simulator *simulator, const struct control *control,
                      const struct page *page, enum loop_end end, const char *report)
{
    const char *directory = simulator_configuration(simulator)->record;
    const struct task_runner *runner = simulator_task_runner(simulator);
    struct summary summary = {.simulator = simulator, .end = end, .recorded = directory != NULL};
    struct error error;
    int status = run_exit_status(simulator, end), incomplete = STATUS_OK;

    if (simulator_finish_recording(simulator, &summary.recorder, &error)) {
        incomplete = command_fail("run", &error);
    }

    /* Close the gateway and print its counters */
    struct gateway_counters counters;

    if (simulator_close_gateway(simulator, &counters)) {
        printf("gateway: %" PRIu64 " clients, %" PRIu64 " refused, %" PRIu64
               " disconnected; %" PRIu64 " frames to the buses, %" PRIu64
               " rejected by them, %" PRIu64 " to clients\n",
               counters.clients, counters.refused,
               counters.cut_slow + counters.cut_junk + counters.cut_silent, counters.to_bus,
               counters.not_taken, counters.to_client);
    }

    if (page) {
        print_clients(control, page);
    }
    summary_print(&summary, stdout);
    recorded_run_compare(&recorded, simulator_stats(simulator)->ticks,
                         plant_hash(simulator_plant(simulator)), stdout);
    if (directory && summary_write(&summary, directory, &error)) {
        incomplete = command_fail("run", &error);
    }
    if (directory && firmware_write(simulator, directory, &error)) {
        incomplete = command_fail("run", &error);
    }
    if (runner && task_report_write(runner->task, report, &error)) {
        incomplete = command_fail("run", &error);
    }
    return status ? status : incomplete;
}

/* Finishes a run while pages are open. Informs them about the end, and serves them until they are
 * closed. */
static int run_finish_watched(struct simulator *simulator, struct control *control,
                              const struct page *page, enum loop_end end, const char *report)
{
    int status;

    rig_command_on_stop(NULL, NULL); /* a stop only ends the wait */
    status = run_finish(simulator, NULL, NULL, end, report);
    page_tell_end(page, simulator, end, true);
    page_linger(page, control);
    rig_command_ignore_stop();
    viewer_stop(page->viewer);
    control_stop(control);
    print_clients(control, page);
    return status;
}

static void run_request_stop(void *context)
{
    simulator_stop(context);
}

/* ---- restart on SIGHUP, under a service manager ---- */

static struct notify manager;
static const struct run_options *run_given;
static volatile sig_atomic_t reload_wanted;
static bool reload;

static void on_hangup(int number)
{
    (void)number;
    reload_wanted = 1;
}

/* Restarts the run after SIGHUP; runs in the monitor's thread. If the rig can be loaded, it ends
 * this run, and the next run uses the rig. Otherwise it changes nothing. */
static void try_reload(struct simulator *simulator, struct monitor *monitor)
{
    const struct rig *rig;
    struct arena arena;
    struct error error;

    if (!reload_wanted || rig_command_stop_requested()) {
        return;
    }
    reload_wanted = 0;
    notify_reloading(&manager);
    if (arena_init(&arena, RIG_COMMAND_ARENA, &error)) {
        fprintf(stderr, "%sreload refused: %s\n", journal_prefix(JOURNAL_ERROR), error.text);
        return;
    }

    /* Load the rig as a test, because this run must not end if no other can follow */
    if (rig_load(run_given->rig, &arena, &rig, &error) ||
        run_options_check_trust(run_given, rig, &error)) {
        fprintf(stderr, "%sreload refused, the run continues: %s\n", journal_prefix(JOURNAL_ERROR),
                error.text);
    } else {
        fprintf(stderr, "%sreload: restarting\n", journal_prefix(JOURNAL_NOTICE));
        reload = monitor->replaced = true;
        simulator_stop(simulator);
    }
    arena_fini(&arena);
}

/* Ends the process if a stop arrives between two runs: nothing is running, and the next start may
 * take long. */
static void stop_between_runs(void *context)
{
    (void)context;
    notify_stopping(&manager);
    _exit(STATUS_OK);
}

/* ---- the control socket ---- */

/* Opens the control socket. Sets *control to NULL if it was not requested, or if no default path is
 * available. */
static enum error_code open_control(const struct run_options *options, struct simulator *simulator,
                                    struct control **control, struct error *error)
{
    struct control_config config = {
        .simulator = simulator,
        .requests = simulator_requests(simulator),
        .path = options->control,
        .name = simulator_configuration(simulator)->rig->name,
    };

    *control = NULL;
    if (!config.requests) {
        return ERROR_NONE;
    }
    if (control_start(&config, control, error)) {
        if (options->control) {
            return error->code;
        }
        if (!options->quiet) {
            fprintf(stderr, "%snotice: %s: \"coman-hil ctl\" cannot reach this run\n",
                    journal_prefix(JOURNAL_NOTICE), error->text);
        }
        return ERROR_NONE;
    }
    if (!options->quiet) {
        fprintf(stderr, "control: %s\n", control_path(*control));
    }
    return ERROR_NONE;
}

/* ---- the run ---- */

/* Writes the file of --ready. host is the gateway's, "" = the default address. */
static enum error_code write_ready(const struct run_options *options, const char *host,
                                   struct simulator *simulator, const struct control *control,
                                   const struct page *page, struct error *error)
{
    const struct gateway *gateway = simulator_parts(simulator).gateway;
    const struct ready ready = {
        .clock = word_of(loop_clock_words, (int)simulator_configuration(simulator)->clock),
        .control = control ? control_path(control) : NULL,
        .gateway_host = !gateway || !gateway_port(gateway) ? NULL
                        : host[0]                          ? host
                                                           : "127.0.0.1",
        .gateway_port = gateway ? gateway_port(gateway) : 0,
        .page = page->viewer ? viewer_address(page->viewer, true) : NULL,
        .page_view = page->viewer ? viewer_address(page->viewer, false) : NULL,
    };

    return ready_write(options->ready, &ready, error);
}

/* Additional data of the monitor's thread. */
struct background {
    struct simulator *simulator;
    struct control *control; /* NULL = none */
    struct page *page;
    struct monitor *monitor;
};

/* Shows an event on the page's time line. The time line has all events, without a rate limit. */
static void run_show_event(void *context, uint64_t key, const char *text)
{
    const struct background *background = context;

    if (background->page->viewer) {
        viewer_put_event(background->page->viewer, simulator_event_priority(key), text);
    }
}

/* Moves the events of the control socket to the page, the log and the recording. */
static void log_control(struct background *background)
{
    char text[EVENTLOG_TEXT];
    uint64_t key;

    while (background->control &&
           control_next_event(background->control, &key, text, sizeof text)) {
        run_show_event(background, key, text);
        monitor_put(background->monitor, clock_now(clock_monotonic()), key, text);
        simulator_record_event(background->simulator, key, text);
    }
}

/* Does the monitor's work of each period: restarts the run if requested, and moves the socket's
 * events. */
static void run_each_period(void *context)
{
    struct background *background = context;

    try_reload(background->simulator, background->monitor);
    log_control(background);
}

/* Runs a simulator from the start of its threads; returns the exit status. */
static int run_simulator(struct simulator *simulator, struct control *control, struct page *page,
                         const struct run_options *options, const char *host)
{
    static struct monitor monitor;
    struct background background = {simulator, control, page, &monitor};
    struct monitor_config config = {.simulator = simulator,
                                    .manager = &manager,
                                    .out = stderr,
                                    .terminal = isatty(STDERR_FILENO),
                                    .quiet = options->quiet,
                                    .each = run_each_period,
                                    .event = run_show_event,
                                    .context = &background};
    struct realtime_report report;
    struct error error;
    enum loop_end end;
    int status, silent = STATUS_OK;
    bool stays;

    /* Threads start before simulator_start, which gives the loop's thread its priority and
     * processor */
    if (monitor_start(&monitor, &config, &error)) {
        control_stop(control);
        viewer_stop(page->viewer);
        return command_fail("run", &error);
    }
    rig_command_on_stop(run_request_stop, simulator);
    if (simulator_start(simulator, &report, &error)) {
        control_stop(control);
        viewer_stop(page->viewer);
        monitor_stop(&monitor);
        return command_fail("run", &error);
    }

    /* From here on clients are served, and the loop runs to its end */
    control_serve(control);
    viewer_serve(page->viewer);
    rig_command_warn(&report, monitor.log.clear);
    if (write_ready(options, host, simulator, control, page, &error)) {
        silent = command_fail("run", &error); /* no client can connect: the run ends immediately */
        simulator_stop(simulator);
    }
    end = simulator_run(simulator);

    /* The log is complete when all threads have ended. End the page's thread first, because it uses
     * the socket */
    stays = !reload && !silent && page_stays(page, end);
    if (!stays) {
        page_tell_end(page, simulator, end, false);
        viewer_stop(page->viewer);
        control_stop(control);
    }
    monitor_stop(&monitor);
    log_control(&background);
    ready_end(options->ready);
    if (stays) {
        return run_finish_watched(simulator, control, page, end, options->input.report);
    }
    if (!reload) {
        rig_command_ignore_stop();
        status = run_finish(simulator, control, page, end, options->input.report);
        return silent ? silent : status;
    }

    /* For a restart, finish this run. A stop before the next run then ends the process at once */
    status = run_finish(simulator, control, page, end, options->input.report);
    fflush(stdout);
    rig_command_on_stop(stop_between_runs, NULL);
    return status;
}

/* Prints the differences of the run from the recorded one. */
static void print_stimulus(const struct simulator *simulator, bool quiet)
{
    const struct stimulus *stimulus = simulator_parts(simulator).stimulus;
    int64_t first_ns = INT64_MAX;
    size_t frames = 0;

    if (!stimulus) {
        return;
    }
    recorded_run_warn(&recorded, simulator_configuration(simulator)->stimulus, stderr);
    if (stimulus->skipped[0]) {
        fprintf(stderr, "%swarning: %s\n", journal_prefix(JOURNAL_WARNING), stimulus->skipped);
    }
    if (stimulus->gap_ns > LOG_GAP_NS) {
        fprintf(
            stderr, "%swarning: no frame for %.3f s before line %d; the run simulates this time\n",
            journal_prefix(JOURNAL_WARNING), (double)stimulus->gap_ns * 1e-9, stimulus->gap_line);
    }
    if (quiet) {
        return;
    }
    if (stimulus->start_ns > 0) {
        fprintf(stderr,
                "stimulus: the times of the log are of the wall clock; the run starts at that of "
                "its first frame, %" PRId64 ".%06" PRId64 "\n",
                stimulus->start_ns / 1000000000, stimulus->start_ns % 1000000000 / 1000);
    }
    for (size_t b = 0; b < simulator_configuration(simulator)->rig->nbus; b++) {
        frames += stimulus->count[b];
        if (stimulus->count[b] && stimulus->frame[b][0].time_ns < first_ns) {
            first_ns = stimulus->frame[b][0].time_ns;
        }
    }
    fprintf(stderr, "stimulus: %zu frames, the first at %.3f s; the log ends at %.3f s\n", frames,
            (double)first_ns * 1e-9, (double)stimulus->end_ns * 1e-9);
}

/* Prints information for the user before the first tick; quiet: warnings and addresses alone. */
static void print_start(const struct simulator *simulator, const char *host, const char *notice,
                        bool quiet)
{
    if (!quiet) {
        fprintf(stderr, "dynamics: %s\n", simulator_parts(simulator).dynamics);

        /* Print how the robot has settled before the run, if it did */
        const struct settled *settled = simulator_parts(simulator).settled;
        char base[96] = "";

        if (settled) {
            if (simulator_configuration(simulator)->rig->robot->floating) {
                snprintf(base, sizeof base, "; base %.3f mm lower and tilted by %.3f mrad",
                         -1e3 * settled->rise_m, 1e3 * settled->tilt_rad);
            }
            fprintf(stderr, "settled: residual %.1g of the weight, %.1g sideways%s\n",
                    settled->residual, settled->sideways, base);
        }
    }
    print_stimulus(simulator, quiet);
    if (notice[0] && !quiet) {
        fprintf(stderr, "%snotice: %s\n", journal_prefix(JOURNAL_NOTICE), notice);
    }
    if (simulator_parts(simulator).gateway && gateway_port(simulator_parts(simulator).gateway)) {
        fprintf(stderr, "gateway: %s port %u\n", host[0] ? host : "127.0.0.1",
                gateway_port(simulator_parts(simulator).gateway));
        if (host[0] && !run_options_is_loopback(host)) {
            fprintf(stderr,
                    "%swarning: the gateway has no password: whoever reaches %s can read the buses "
                    "and send commands on them; 127.0.0.1 and a tunnel keep others out\n",
                    journal_prefix(JOURNAL_WARNING), host);
        }
    }
}

/* Reads --gateway and --slcan; *used is whether one of them is given. */
static enum error_code run_read_gateway(const struct run_options *options, char host[RUN_HOST_SIZE],
                                        struct run_slcan *slcan, struct gateway_config *gateway,
                                        bool *used, struct error *error)
{
    enum error_code code = run_options_read_slcan(options, slcan, error);

    *gateway = (struct gateway_config){.slcan_only = !options->gateway};
    if (!code && options->gateway) {
        code = run_options_parse_address("--gateway", options->gateway, "29536", host,
                                         &gateway->host, &gateway->port, error);
    }
    gateway->nslcan = slcan->count;
    gateway->slcan = slcan->channel;
    *used = options->gateway || slcan->count > 0;
    return code;
}

/* Runs a rig: applies the options, creates the simulator, its socket and its page, and runs
 * them. */
static int run_start_rig(void *context, const struct rig *loaded, struct arena *arena)
{
    const struct run_options *options = context;
    static struct rig changed;
    static struct gateway_config gateway;
    static struct run_slcan slcan;
    static char host[RUN_HOST_SIZE];
    const struct rig *rig = loaded;
    struct simulator_config config;
    struct simulator *simulator;
    struct task_input input;
    struct control *control;
    struct page page = {.viewer = NULL};
    enum error_code code;
    struct error error;
    char notice[256];
    bool joined;
    int status;

    /* Applies the command line's changes to a copy of the rig */
    if (options->wire >= 0) {
        changed = *loaded;
        changed.wire.timed = changed.wire.paced = options->wire;
        rig = &changed;
    }
    rig_command_warn_load("run", rig);
    if (run_read_gateway(options, host, &slcan, &gateway, &joined, &error) ||
        run_options_check_trust(options, rig, &error) ||
        run_options_configure(options, rig, &config, &error) ||
        task_input_read(&options->input, options->task, rig, arena, &input, &error)) {
        return command_fail("run", &error);
    }
    config.task_input = &input;
    config.gateway = joined ? &gateway : NULL;

    /* Plays a recording to its end, even if its last ticks had no frames */
    recorded = (struct recorded_run){.ticks = 0};
    if (config.stimulus) {
        recorded_run_read(config.stimulus, &recorded);
    }
    if (!config.ticks && config.clock != LOOP_CLOCK_LOCKSTEP) {
        config.ticks = recorded.ticks;
    }

    /* Creates the simulator, its control socket and its page, then runs */
    code = simulator_create(&config, arena, &simulator, notice, &error);
    if (code) {
        rig_command_suggest(options->rig, options->task, &input, &error);
        return command_fail("run", &error);
    }
    print_start(simulator, host, notice, options->quiet);
    if (simulator_configuration(simulator)->ticks == 0 && !options->quiet &&
        (!simulator_task_runner(simulator) ||
         task_is_endless(simulator_task_runner(simulator)->task))) {
        fputs("the run goes on until it is stopped (Ctrl-C, or coman-hil ctl stop); --duration S "
              "ends it\n",
              stderr);
    }
    if (open_control(options, simulator, &control, &error)) {
        status = command_fail("run", &error);
    } else if (page_open(&page, options, manager.descriptor >= 0, simulator,
                         control ? control_path(control) : NULL, &error)) {
        control_stop(control);
        status = command_fail("run", &error);
    } else {
        status = run_simulator(simulator, control, &page, options, host);
    }
    page_close(&page);
    control_destroy(control);
    simulator_destroy(simulator);
    return status;
}

int cmd_run(int argc, char **argv)
{
    struct run_options options;
    struct error error;
    int status;

    if (!run_options_read(argc, argv, &options, &status)) {
        return status;
    }
    if (ready_begin(options.ready, &error)) {
        return command_fail("run", &error);
    }
    notify_open(&manager);
    if (manager.descriptor >= 0) {
        signal(SIGHUP, on_hangup);
    }

    /* A restart loads the rig again, because it may have changed */
    run_given = &options;
    do {
        reload = false;
        status = rig_command("run", options.rig, &options, run_start_rig);
    } while (reload && !rig_command_stop_requested());
    notify_stopping(&manager);
    notify_close(&manager);
    return status;
}
