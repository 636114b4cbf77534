/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil run: a rig from start to summary. */
#include "base/text.h"
#include "app/cli/commands.h"
#include "app/control/control.h"
#include "base/journal.h"
#include "app/cli/monitor.h"
#include "base/options.h"
#include "app/cli/rig_command.h"
#include "app/cli/summary.h"

#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

/* The command line. */
struct run_options {
    const char *rig, *task, *record, *gateway, *control;
    struct option_list bus, fault;
    double duration_s;
    int64_t ticks, record_period_ms, seed;
    int clock, overrun, transport, hold, wire;
    bool settle, energy, force, quiet;
};

static const struct option_word clock_words[] = {
    {"real", LOOP_CLOCK_REAL}, {"lockstep", LOOP_CLOCK_LOCKSTEP}, {"free", LOOP_CLOCK_FREE}, {0}};
static const struct option_word hold_words[] = {
    {"none", RIG_HOLD_NONE},
    {"until_enabled", RIG_HOLD_ENABLED},
    {"always", RIG_HOLD_ALWAYS},
    {NULL, 0},
};
static const struct option_word overrun_words[] = {
    {"skip", LOOP_OVERRUN_SKIP}, {"slip", LOOP_OVERRUN_SLIP}, {"stop", LOOP_OVERRUN_STOP}, {0}};
static const struct option_word wire_words[] = {{"ideal", 0}, {"wire", 1}, {0}};
static const struct option_word transport_words[] = {
    {"auto", TRANSPORT_AUTO}, {"socketcan", TRANSPORT_SOCKETCAN}, {"local", TRANSPORT_LOCAL}, {0}};

/* %s: the kinds of faults */
static const char manual_format[] =
    "Clocks. real: one tick each period of the wall clock, on a grid that does not drift. "
    "lockstep: a "
    "tick runs when a STEP frame (0x6F0: expected tick, number of ticks) asks for it and is "
    "answered "
    "with DONE (0x6FF) on every bus. free: as fast as the machine goes.\n\n"
    "Overruns in real time. skip: deadlines that were missed are dropped, so that virtual time "
    "falls "
    "behind the wall clock. slip: late ticks run back to back until the grid is caught up. stop: "
    "the "
    "run ends with status 1 at the rig's stop_after-th overrun. Each overrun is charged to the "
    "phase "
    "that took longest. More than a second behind is taken for a pause, and the grid taken up "
    "again.\n\n"
    "Start. As it stands in the rig a robot's springs are relaxed and its feet just touch: once "
    "let go it sinks onto them, and that takes some 0.2 s to die out. --settle (or settle: true in "
    "the rig's initial) starts in static equilibrium at the same joint angles, base and free "
    "bodies "
    "moved so that contacts carry them. Until the links are let go the rotors are held like them, "
    "as by brakes, so that the springs stay loaded while motors are off; all are let go 20 ms "
    "after "
    "the last motor is on. A controller that gives each motor the voltage for its joint's torque "
    "from the start (load_v_per_nm of the rig's servo) takes over without a jolt.\n\n"
    "Faults. A line is [NAME:] TARGET KIND [PARAMETER...] [FROM..TO]: TARGET is motor JOINT, "
    "sensor "
    "JOINT.CHANNEL (link_encoder, motor_encoder, current, torque, temperature), sensor FT[.fx fy "
    "fz "
    "tx ty tz], sensor imu[.gyro_x ... accel_z], board BUS/ADDRESS, bus NAME or supply. FROM..TO "
    "are "
    "seconds of virtual time, TO may be left out, without both the fault is there from the start; "
    "manual waits until it is switched. Parameters are KEY=VALUE, or VALUE alone for the first. "
    "id=ID restricts a fault of a bus to one identifier; without it STEP and DONE are spared. Each "
    "begin and end is a line of the log; no frame tells of it. Kinds:\n%s\n"
    "The recording is candump.log (all buses, both directions, as candump -L writes it, stamped "
    "with "
    "virtual time: two lockstep or free runs give the same bytes), signals.csv (joints, contact "
    "forces, base) and summary.json. When it cannot be written whole, the run goes on and ends "
    "with "
    "status 3, and says what is missing. A slow disk costs frames in real time and time otherwise; a "
    "file whose disk is full or that is removed ends there, with a whole line; one that is renamed "
    "goes on.\n\n"
    "--energy integrates the power of every part beside the motion. What is left over, as a part "
    "of "
    "all energy that went anywhere, judges the step: 1e-6 and less with rk4 that is short enough, "
    "1e-3 with implicit at 1 ms, which is of first order. The state hash then covers the account "
    "too.\n\n"
    "Gateway. With --gateway programs of any language join the buses without kernel CAN: it speaks "
    "the "
    "protocol of socketcand in raw mode, a bus under its name or that of its interface. In "
    "lockstep "
    "such a program sends the STEP frames.\n\n"
    "Control. \"coman-hil ctl\" and other programs look at the run and steer it over a unix socket that "
    "only its owner and root may use: at $RUNTIME_DIRECTORY/control under a service manager that gives "
    "such a directory, else at $XDG_RUNTIME_DIR/coman-hil/RIG.sock, for root without that variable at "
    "/run/coman-hil/RIG.sock; RIG-2.sock when that is taken, and so on. When none of them can be had a "
    "notice says so and the run goes on; with --control PATH it does not start. \"ctl --help\" has the "
    "protocol.\n\n"
    "With a task the run ends when the task does: status 0 when it is done, 1 when it failed. An "
    "interrupt (Ctrl-C) or SIGTERM switches the motors off and ends with the summary; a second one "
    "kills. Under a service manager (NOTIFY_SOCKET) SIGHUP reads the rig again: when it is good, "
    "the run ends "
    "and a new one begins with it, else it goes on.";

static char manual[16384];

static void write_manual(void)
{
    char kinds[4096] = "", line[256];
    size_t used = 0, count = faults_help(0, NULL, 0);

    for (size_t i = 0; i < count && used < sizeof kinds; i++) {
        faults_help(i, line, sizeof line);
        used += (size_t)snprintf(kinds + used, sizeof kinds - used, "  %s\n", line);
    }
    snprintf(manual, sizeof manual, manual_format, kinds);
}

static bool parse(int argc, char **argv, struct run_options *out, int *status)
{
    static struct run_options o;
    static const struct option_spec options[] = {
        {"--clock", OPTION_ENUM, "CLOCK", "real, lockstep or free; the rig's by default",
         .value = &o.clock, .words = clock_words},
        {"--duration", OPTION_REAL, "S", "end after S seconds of virtual time",
         .value = &o.duration_s, .min = 0.0, .max = 1e7, .unit = "seconds"},
        {"--ticks", OPTION_INT, "N", "end after N ticks", .value = &o.ticks, .min = 1.0,
         .max = 1e12},
        {"--task", OPTION_STRING, "NAME", "start this controller on the other side of the buses",
         .value = &o.task},
        {"--bus", OPTION_LIST, "NAME=INTERFACE",
         "put a bus of the rig on this interface; may stand more than once", .value = &o.bus},
        {"--transport", OPTION_ENUM, "HOW",
         "socketcan, local (inside this process) or auto, the default: socketcan when the kernel "
         "has CAN, else local",
         .value = &o.transport, .words = transport_words},
        {"--gateway", OPTION_STRING, "[HOST:]PORT",
         "let other programs join the buses over TCP, with any socketcand client; HOST is a "
         "numeric "
         "address, 127.0.0.1 by default; PORT 0 is any that is free",
         .value = &o.gateway},
        {"--control", OPTION_STRING, "PATH",
         "where the socket for \"coman-hil ctl\" is; none: nowhere; a default place otherwise, see "
         "below",
         .value = &o.control},
        {"--wire", OPTION_ENUM, "MODE",
         "ideal: frames take no time; wire: they take that of their bits, and arbitration, on "
         "local "
         "buses and at the speed of SocketCAN's; the rig's by default",
         .value = &o.wire, .words = wire_words},
        {"--hold", OPTION_ENUM, "WHEN",
         "links clamped: none, until_enabled (all motors on) or always; the rig's by "
         "default",
         .value = &o.hold, .words = hold_words},
        {"--settle", OPTION_FLAG, NULL,
         "start in static equilibrium: springs and contacts carry the weight from the first tick",
         .value = &o.settle},
        {"--energy", OPTION_FLAG, NULL,
         "account for electrical energy, heat and what is stored; the summary says how well it "
         "balances",
         .value = &o.energy},
        {"--overrun", OPTION_ENUM, "POLICY", "skip, slip or stop; the rig's by default",
         .value = &o.overrun, .words = overrun_words},
        {"--fault", OPTION_LIST, "LINE",
         "arm a fault, as 'motor LKneeSag jam 2..2.5'; may stand more than once; see below",
         .value = &o.fault},
        {"--seed", OPTION_INT, "N", "of sensor noise and faults; the rig's by default",
         .value = &o.seed, .min = 0.0, .max = 9e15},
        {"--record", OPTION_STRING, "DIR", "record into this directory, new or empty",
         .value = &o.record},
        {"--record-period", OPTION_INT, "MS", "rows of signals.csv every MS ms, 10 by default",
         .value = &o.record_period_ms, .min = 1.0, .max = 60000.0, .unit = "ms"},
        {"--force", OPTION_FLAG, NULL, "record into DIR even when it is not empty",
         .value = &o.force},
        {"--quiet", OPTION_FLAG, NULL, "no status line", .value = &o.quiet},
    };
    static const struct operand_spec operands[] = {{"RIG", "the rig file", true, &o.rig}};
    static const struct command_spec spec = {
        .name = "run",
        .summary = "Run a rig: robot, boards and buses, in real time, lockstep or free run.",
        .option = options,
        .noption = sizeof options / sizeof options[0],
        .operand = operands,
        .noperand = 1,
        .manual = manual,
    };

    write_manual();
    o = (struct run_options){
        .seed = -1, .clock = -1, .overrun = -1, .hold = -1, .wire = -1, .record_period_ms = 10};
    if (!options_read(&spec, argc, argv, status)) {
        return false;
    }
    *out = o;
    return true;
}

/* ---- the run ---- */

/* "[HOST:]PORT", with an IPv6 address in brackets; host has room for any address */
static enum error_code parse_gateway(const char *text, char host[64],
                                     struct gateway_config *gateway, struct error *error)
{
    const char *colon = strrchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    int64_t port;

    if (length > 2 && text[0] == '[' && text[length - 1] == ']') {
        snprintf(host, 64, "%.*s", (int)length - 2, text + 1);
    } else {
        snprintf(host, 64, "%.*s", (int)length, text);
    }
    if (!text_to_int(colon ? colon + 1 : text, 0, UINT16_MAX, &port) || length > 60 ||
        (colon && length == 0)) {
        return error_set(error, ERROR_INPUT,
                         "--gateway: found \"%.100s\", expected PORT or HOST:PORT, as in 29536",
                         text);
    }
    *gateway = (struct gateway_config){.host = colon ? host : NULL, .port = (uint16_t)port};
    return ERROR_NONE;
}

static enum error_code configure(const struct run_options *options, const struct rig *rig,
                                 struct simulator_config *config, struct error *error)
{
    *config = (struct simulator_config){
        .rig = rig,
        .clock = options->clock < 0 ? rig->clock : (enum loop_clock)options->clock,
        .hold = options->hold < 0 ? rig->hold : (enum rig_hold)options->hold,
        .settle = options->settle || rig->settle,
        .energy = options->energy,
        .overrun =
            options->overrun < 0 ? rig->realtime.overrun : (enum loop_overrun)options->overrun,
        .stop_after = rig->realtime.stop_after,
        .transport = (enum bus_transport)options->transport,
        .interface = options->bus.item,
        .ninterface = options->bus.count,
        .fault = options->fault.item,
        .nfault = options->fault.count,
        .seed_given = options->seed >= 0,
        .seed = (uint64_t)options->seed,
        .ticks = (uint64_t)options->ticks,
        .task = options->task,
        .steering = !options->control || strcmp(options->control, "none") != 0,
        .record = options->record ? options->record : rig->record.directory,
        .overwrite = options->force,
        .row_period_ns = options->record_period_ms * CLOCK_MS,
    };
    if (options->duration_s > 0.0 && options->ticks > 0) {
        return error_set(error, ERROR_INPUT, "found both --duration and --ticks, expected one");
    }
    if (options->duration_s > 0.0) {
        config->ticks = (uint64_t)ceil(options->duration_s * 1e9 / (double)rig->tick_ns - 1e-6);
    }
    return ERROR_NONE;
}

/* what the run amounts to as an exit status, with a line about it when it is not 0 */
static int judge(const struct simulator *simulator, enum loop_end end)
{
    const struct task_runner *runner = simulator_task_runner(simulator);
    struct task_runner_status task = {.status = TASK_RUNNING};

    if (runner) {
        task_runner_read(runner, &task);
    }
    if (end == LOOP_END_MODEL) {
        fprintf(stderr, "%scoman-hil run: %s\n", journal_prefix(JOURNAL_ERROR),
                simulator_failure(simulator));
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
    }
    return STATUS_OK;
}

static void print_gateway(struct simulator *simulator)
{
    struct gateway_counters counters;

    if (simulator_close_gateway(simulator, &counters)) {
        printf("gateway: %" PRIu64 " clients, %" PRIu64 " turned away, %" PRIu64
               " cut off; %" PRIu64 " frames to the buses, %" PRIu64 " not taken by them, %" PRIu64
               " to clients\n",
               counters.clients, counters.refused, counters.cut_slow + counters.cut_junk,
               counters.to_bus, counters.not_taken, counters.to_client);
    }
}

static void print_control(struct control *control)
{
    struct control_counters counters;

    control_counters(control, &counters);
    if (counters.clients + counters.refused > 0) {
        printf("control: %" PRIu64 " clients, %" PRIu64 " turned away, %" PRIu64
               " cut off; %" PRIu64 " requests, %" PRIu64 " refused; %" PRIu64 " rows, %" PRIu64
               " missed\n",
               counters.clients, counters.refused,
               counters.cut_junk + counters.cut_slow + counters.cut_silent, counters.requests,
               counters.refused_requests, counters.rows, counters.missed_rows);
    }
}

static int finish(struct simulator *simulator, struct control *control, enum loop_end end)
{
    const char *directory = simulator_configuration(simulator)->record;
    struct summary summary = {.simulator = simulator, .end = end, .recorded = directory != NULL};
    struct error error;
    int status = judge(simulator, end), incomplete = STATUS_OK;

    if (simulator_finish_recording(simulator, &summary.recorder, &error)) {
        incomplete = command_fail("run", &error);
    }
    print_gateway(simulator);
    if (control) {
        print_control(control);
    }
    summary_print(&summary, stdout);
    if (directory && summary_write(&summary, directory, &error)) {
        incomplete = command_fail("run", &error);
    }
    return status ? status : incomplete;
}

static void stop(void *context)
{
    simulator_stop(context);
}

/* ---- a new start on SIGHUP, under a service manager ---- */

static struct notify manager;
static const char *run_rig_path;
static volatile sig_atomic_t reload_wanted;
static bool reload;

static void on_hangup(int number)
{
    (void)number;
    reload_wanted = 1;
}

/* In the monitor's thread: a rig that can be read ends the run for the next one to begin with it, one
 * that cannot leaves everything as it is. */
static void try_reload(void *context)
{
    struct simulator *simulator = context;
    const struct rig *rig;
    struct arena arena;
    struct error error;

    if (!reload_wanted) {
        return;
    }
    reload_wanted = 0;
    notify_reloading(&manager);
    if (arena_init(&arena, RIG_COMMAND_ARENA, &error)) {
        fprintf(stderr, "%sreload refused: %s\n", journal_prefix(JOURNAL_ERROR), error.text);
        return;
    }
    if (rig_load(run_rig_path, &arena, &rig, &error)) {
        fprintf(stderr, "%sreload refused, the run goes on: %s\n", journal_prefix(JOURNAL_ERROR),
                error.text);
    } else {
        fprintf(stderr, "%sreload: starting anew\n", journal_prefix(JOURNAL_NOTICE));
        reload = true;
        simulator_stop(simulator);
    }
    arena_fini(&arena);
}

/* ---- the control socket ---- */

/* NULL in *control: there is none, and that is all right. */
static enum error_code open_control(const struct run_options *options, struct simulator *simulator,
                                    struct control **control, struct error *error)
{
    struct control_config config = {
        .simulator = simulator,
        .steering = simulator_steering(simulator),
        .path = options->control,
        .name = simulator_configuration(simulator)->rig->name,
    };

    *control = NULL;
    if (!config.steering) {
        return ERROR_NONE;
    }
    if (control_start(&config, control, error)) {
        if (options->control) {
            return error->code;
        }
        fprintf(stderr, "%snotice: %s: \"coman-hil ctl\" cannot reach this run\n",
                journal_prefix(JOURNAL_NOTICE), error->text);
        return ERROR_NONE;
    }
    fprintf(stderr, "control: %s\n", control_path(*control));
    return ERROR_NONE;
}

/* What the monitor's thread does beside its own. */
struct background {
    struct simulator *simulator;
    struct control *control; /* NULL = none */
    struct monitor *monitor;
};

static void log_control(const struct background *background)
{
    char text[EVENTLOG_TEXT];
    uint64_t key;

    while (background->control &&
           control_next_event(background->control, &key, text, sizeof text)) {
        eventlog_put(&background->monitor->log, clock_now(clock_monotonic()), key, text);
    }
}

static void each_period(void *context)
{
    const struct background *background = context;

    try_reload(background->simulator);
    log_control(background);
}

static int run(struct simulator *simulator, struct control *control, bool quiet)
{
    static struct monitor monitor;
    struct background background = {simulator, control, &monitor};
    struct monitor_config config = {.simulator = simulator,
                                    .manager = &manager,
                                    .out = stderr,
                                    .terminal = isatty(STDERR_FILENO),
                                    .quiet = quiet,
                                    .each = each_period,
                                    .context = &background};
    struct realtime_report report;
    struct error error;
    enum loop_end end;

    if (monitor_start(&monitor, &config, &error)) {
        control_stop(control);
        return command_fail("run", &error);
    }
    rig_command_on_stop(stop, simulator);
    if (simulator_start(simulator, &report, &error)) {
        control_stop(control);
        monitor_stop(&monitor);
        return command_fail("run", &error);
    }
    control_serve(control);
    rig_command_warn(&report, monitor.log.clear);
    end = simulator_run(simulator);
    control_stop(control);
    monitor_stop(&monitor);
    log_control(&background);
    rig_command_ignore_stop();
    return finish(simulator, control, end);
}

static void print_settled(const struct simulator *simulator)
{
    const struct settled *settled = simulator_settled(simulator);

    if (!settled) {
        return;
    }
    fprintf(stderr, "settled: %.1g of a weight left over, %.1g sideways", settled->residual,
            settled->sideways);
    if (simulator_configuration(simulator)->rig->robot->floating) {
        fprintf(stderr, "; base %.3f mm lower and tilted by %.3f mrad", -1e3 * settled->rise_m,
                1e3 * settled->tilt_rad);
    }
    fputc('\n', stderr);
}

static int run_rig(void *context, const struct rig *loaded, struct arena *arena)
{
    const struct run_options *options = context;
    static struct rig changed;
    static struct gateway_config gateway;
    static char host[64];
    const struct rig *rig = loaded;
    struct simulator_config config;
    struct simulator *simulator;
    struct control *control;
    struct error error;
    char notice[256];
    int status;

    if (options->wire >= 0) {
        changed = *loaded;
        changed.wire.timed = changed.wire.paced = options->wire;
        rig = &changed;
    }
    if ((options->gateway && parse_gateway(options->gateway, host, &gateway, &error)) ||
        rig_command_budget("run", rig, &error) || configure(options, rig, &config, &error)) {
        return command_fail("run", &error);
    }
    config.gateway = options->gateway ? &gateway : NULL;
    if (simulator_create(&config, arena, &simulator, notice, &error)) {
        return command_fail("run", &error);
    }
    fprintf(stderr, "dynamics: %s\n", simulator_dynamics(simulator));
    print_settled(simulator);
    if (notice[0]) {
        fprintf(stderr, "%snotice: %s\n", journal_prefix(JOURNAL_NOTICE), notice);
    }
    if (simulator_gateway(simulator)) {
        fprintf(stderr, "gateway: %s port %u\n", host[0] ? host : "127.0.0.1",
                gateway_port(simulator_gateway(simulator)));
    }
    if (open_control(options, simulator, &control, &error)) {
        status = command_fail("run", &error);
    } else {
        status = run(simulator, control, options->quiet);
    }
    control_destroy(control);
    simulator_destroy(simulator);
    return status;
}

int cmd_run(int argc, char **argv)
{
    struct run_options options;
    int status;

    if (!parse(argc, argv, &options, &status)) {
        return status;
    }
    notify_open(&manager);
    if (manager.descriptor >= 0) {
        signal(SIGHUP, on_hangup);
    }
    run_rig_path = options.rig;
    do {
        reload = false;
        status = rig_command("run", options.rig, &options, run_rig);
    } while (reload);
    notify_stopping(&manager);
    notify_close(&manager);
    return status;
}
