/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil task: runs a task in its own process, with simulated or real boards. */
#include "app/cli/cli.h"

#include "manual/task.h"

#include <unistd.h>

struct task_command {
    const char *task, *rig;
    struct option_list bus, set;
    struct task_options input;
    int clock;
    bool quiet, reconnect;
};

static const struct word clock_words[] = {
    {"real", LOOP_CLOCK_REAL}, {"lockstep", LOOP_CLOCK_LOCKSTEP}, {0}};

/* Reads the command line; returns false and the exit status if there is nothing to run. */
static bool task_parse_options(int argc, char **argv, struct task_command *out, int *status)
{
    static struct task_command o;
    static const struct option_spec options[] = {
        {"--clock", OPTION_ENUM, "CLOCK", "real or lockstep; the rig's by default",
         .value = &o.clock, .words = clock_words},
        {"--bus", OPTION_LIST, "NAME=INTERFACE",
         "put a bus of the rig on this interface; may be given more than once", .value = &o.bus},
        {"--set", OPTION_LIST, "NAME=VALUE",
         "a setting that the task begins with, as walk.forward_m_s=0.1; may be given more than "
         "once",
         .value = &o.set, .noun = "settings"},
        TASK_OPTION_ROWS(o.input),
        {"--reconnect", OPTION_FLAG, NULL,
         "start again when the boards are lost, until the task is done", .value = &o.reconnect},
        {"--quiet", OPTION_FLAG, NULL, "print warnings, errors and how it ended only",
         .value = &o.quiet},
    };
    static const struct operand_spec operands[] = {
        {"NAME", "the task; coman-hil list tasks has them", true, &o.task, .noun = "tasks"},
        {"RIG", "a rig's file or name", true, &o.rig, .noun = "rigs"},
    };
    static const struct command_spec spec = {
        .name = "task",
        .summary = "Run a task alone, on the other side of the buses.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_TASK,
    };

    /* A clock of -1 means the rig's */
    o = (struct task_command){.clock = -1};
    if (!options_read(&spec, argc, argv, status)) {
        return false;
    }
    *out = o;
    return true;
}

/* ---- status line ---- */

struct reporter {
    struct task_runner *runner;
    bool terminal;
    atomic_bool stop;
    pthread_t thread;
};

/* Prints the task's message when it changes: 4 times a second on a terminal, else every 5 s. */
static void *task_report_main(void *context)
{
    struct reporter *reporter = context;
    struct clock *clock = clock_monotonic();
    char last[sizeof((struct task_runner_status *)0)->message] = "";
    struct task_runner_status status;
    int64_t next = 0;

    while (!atomic_load(&reporter->stop)) {
        int64_t now = clock_now(clock);

        task_runner_read(reporter->runner, &status);
        if (now >= next && strcmp(last, status.message)) {
            fprintf(stderr, reporter->terminal ? "\r\033[K%s" : "%s\n", status.message);
            strcpy(last, status.message);
            next = now + (reporter->terminal ? CLOCK_SECOND / 4 : 5 * CLOCK_SECOND);
        }
        clock_sleep_until(clock, now + 50 * CLOCK_MS);
    }
    if (reporter->terminal) {
        fputc('\n', stderr);
    }
    return NULL;
}

/* ---- the run ---- */

static bool boards_lost; /* another run may find the boards */

static void task_request_stop(void *context)
{
    struct task_runner *runner = context;

    atomic_store(&runner->stop, true);
}

/* Runs the task in this thread until it ends; returns the exit status. */
static int task_run_to_end(struct task_runner *runner, const struct rig *rig, bool quiet)
{
    struct reporter reporter = {.runner = runner, .terminal = isatty(STDERR_FILENO)};
    struct realtime_config realtime = {rig->realtime.priority, rig->realtime.lock_memory, -1};
    struct realtime_report warnings;
    enum task_status status;

    /* The status line has its own thread, created first so that it does not inherit real-time
     * priority */
    rig_command_on_stop(task_request_stop, runner);
    if (!quiet && pthread_create(&reporter.thread, NULL, task_report_main, &reporter)) {
        quiet = true;
    }

    /* In lockstep the wake-up time does not matter, so the task needs no priority */
    if (!runner->lockstep) {
        realtime_apply(&realtime, &warnings);
        rig_command_warn(&warnings, "");
    }
    status = task_runner_run(runner);
    rig_command_ignore_stop();
    if (!quiet) {
        atomic_store(&reporter.stop, true);
        pthread_join(reporter.thread, NULL);
    }

    /* Print how the task ended; return the exit status */
    switch (status) {
    case TASK_DONE:
        printf("%s\n", task_message(runner->task));
        return STATUS_OK;
    case TASK_FAILED:
        boards_lost = task_lost(runner->task);
        fprintf(stderr, "coman-hil task: failed: %s\n", task_message(runner->task));
        return STATUS_FAILED;
    default:
        printf("stopped, motors off\n");
        return STATUS_OK;
    }
}

/* Opens the buses, creates the task and runs it; returns the exit status. */
static int task_run_rig(void *context, const struct rig *rig, struct arena *arena)
{
    const struct task_command *options = context;
    struct task_runner *runner;
    struct task_input input;
    struct bus_ports ports;
    struct buses buses;
    struct error error;
    char notice[256];
    bool lockstep;
    int status;

    lockstep =
        (options->clock < 0 ? rig->clock : (enum loop_clock)options->clock) == LOOP_CLOCK_LOCKSTEP;
    if (task_input_read(&options->input, options->task, rig, arena, &input, &error) ||
        buses_open(rig, TRANSPORT_SOCKETCAN, options->bus.item, options->bus.count, 1, true, arena,
                   &buses, notice, &error) ||
        buses_join(&buses, arena, &ports, &error)) {
        return command_fail("task", &error);
    }

    /* Allocates all memory before the first cycle */
    if (task_runner_create(rig, options->task, &input, ports.port, lockstep, clock_monotonic(),
                           arena, &runner, &error) ||
        task_set_all(runner->task, options->set.item, options->set.count, &error)) {
        rig_command_suggest(options->rig, options->task, &input, &error);
        status = command_fail("task", &error);
    } else {
        arena_seal(arena);
        status = task_run_to_end(runner, rig, options->quiet);
        if (task_report_write(runner->task, options->input.report, &error)) {
            status = command_fail("task", &error);
        }
    }
    bus_ports_close(&ports);
    buses_close(&buses);
    return status;
}

int cmd_task(int argc, char **argv)
{
    struct task_command options;
    struct error error;
    int status;

    if (!task_parse_options(argc, argv, &options, &status)) {
        return status;
    }
    if (task_runner_check_name(options.task, &error)) {
        return command_fail("task", &error);
    }
    do {
        boards_lost = false;
        status = rig_command("task", options.rig, &options, task_run_rig);
        if (boards_lost && options.reconnect && !options.quiet && !rig_command_stop_requested()) {
            fprintf(stderr, "looking for the boards again\n");
        }
    } while (boards_lost && options.reconnect && !rig_command_stop_requested());
    return status;
}
