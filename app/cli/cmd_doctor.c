/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil doctor: can this machine keep a rig's deadlines, and what would help. */
#include "model/symbolic/builtin.h"
#include "rt/clock.h"
#include "app/cli/commands.h"
#include "app/cli/doctor.h"
#include "rt/histogram.h"
#include "base/options.h"
#include "rt/realtime.h"

#include <inttypes.h>
#include <string.h>

#define ARENA_SIZE ((size_t)512 << 20)

static const char manual[] =
    "Each line is ok, warn (it runs, but deadlines may be missed) or fail (the rig cannot run as "
    "it "
    "says), with what was found and, below, the command that puts it right. Nothing is changed.\n\n"
    "Then it sleeps to the rig's deadlines for --measure seconds, with the rights that a run would "
    "have, and prints how late it woke: the figure that the rest is about.\n\n"
    "Exit status: 0 when nothing fails, 1 when something does, warnings or not.";

static void print_finding(const struct doctor_finding *finding)
{
    static const char *const words[] = {"ok", "warn", "fail"};

    printf("%-5s%-15s%s\n", words[finding->verdict], finding->subject, finding->found);
    if (finding->fix[0]) {
        printf("%20s-> %s\n", "", finding->fix);
    }
}

static void print_robot(const struct rig *rig)
{
    const struct robot *robot = rig->robot;

    printf("%-5s%-15s%s, hash %016" PRIx64 ", dynamics %s\n", "ok", "robot", robot->name,
           robot->hash,
           rig->dynamics == RIG_DYNAMICS_GENERIC ? "generic, as the rig says"
           : symbolic_builtin(robot->hash)       ? "generated, built in"
                                                 : "generated when a run first needs it");
}

/* wakes at the grid of the tick as the loop does */
static void measure(const struct rig *rig, double seconds)
{
    struct realtime_config config = {.priority = rig->realtime.priority,
                                     .lock_memory = rig->realtime.lock_memory,
                                     .cpu = rig->realtime.cpu};
    static struct histogram late;
    struct realtime_report report;
    struct clock *clock = clock_monotonic();
    int64_t count = (int64_t)(seconds * 1e9 / (double)rig->tick_ns), deadline;

    realtime_apply(&config, &report);
    deadline = clock_now(clock) + rig->tick_ns;
    for (int64_t i = 0; i < count; i++, deadline += rig->tick_ns) {
        int64_t now;

        do {
            clock_sleep_until(clock, deadline);
            now = clock_now(clock);
        } while (now < deadline);
        histogram_add(&late, now - deadline);
        while (deadline + rig->tick_ns <= now) {
            deadline += rig->tick_ns;
        }
    }
    printf("%-5s%-15s%" PRId64
           " wake-ups%s: p50 %.0f us, p99 %.0f us, p99.9 %.0f us, max %.0f us\n",
           "", "measured", count, report.fifo ? ", FIFO" : ", normal thread",
           (double)histogram_percentile(&late, 0.5) * 1e-3,
           (double)histogram_percentile(&late, 0.99) * 1e-3,
           (double)histogram_percentile(&late, 0.999) * 1e-3, (double)late.max * 1e-3);
}

static int examine(const char *path, bool local, double seconds, struct arena *arena)
{
    static struct doctor_finding findings[DOCTOR_FINDINGS_MAX];
    struct doctor_config config = {.root = "", .local = local, .interfaces = &interface_kernel};
    struct error error;
    size_t count;

    if (rig_load(path, arena, &config.rig, &error)) {
        return command_fail("doctor", &error);
    }
    count = doctor_examine(&config, findings, DOCTOR_FINDINGS_MAX);
    for (size_t i = 0; i < count; i++) {
        print_finding(&findings[i]);
    }
    print_robot(config.rig);
    if (seconds > 0.0) {
        fflush(stdout);
        measure(config.rig, seconds);
    }
    return doctor_verdict(findings, count) == DOCTOR_FAIL ? STATUS_FAILED : STATUS_OK;
}

int cmd_doctor(int argc, char **argv)
{
    static const char *rig;
    static bool local;
    static double seconds = 1.0;
    static const struct option_spec options[] = {
        {"--measure", OPTION_REAL, "S", "measure wake-ups for S seconds, 1 by default; 0 does not",
         .value = &seconds, .min = 0.0, .max = 3600.0, .unit = "seconds"},
        {"--local", OPTION_FLAG, NULL, "buses inside the process: leave CAN interfaces alone",
         .value = &local},
    };
    static const struct operand_spec operands[] = {{"RIG", "the rig file", true, &rig}};
    static const struct command_spec spec = {
        .name = "doctor",
        .summary = "Say what on this machine stands in the way of a rig's deadlines.",
        .option = options,
        .noption = sizeof options / sizeof options[0],
        .operand = operands,
        .noperand = 1,
        .manual = manual,
    };
    struct arena arena;
    struct error error;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (arena_init(&arena, ARENA_SIZE, &error)) {
        return command_fail(spec.name, &error);
    }
    status = examine(rig, local, seconds, &arena);
    arena_fini(&arena);
    return status;
}
