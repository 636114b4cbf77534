/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil doctor: checks whether this machine can meet a rig's deadlines, and suggests
 * remedies. */
#include "app/cli/cli.h"
#include "app/cli/doctor/doctor.h"
#include "manual/doctor.h"
#include "model/symbolic/symbolic.h"
#include "rt/clock.h"
#include "rt/histogram.h"

#include <inttypes.h>
#include <string.h>

/* Prints the implementation of the dynamics that a run would use now. */
static void doctor_print_robot(const struct rig *rig, struct arena *arena)
{
    struct error notice = {.text = ""}, error;
    struct dynamics dynamics;
    bool failed = dynamics_choose(rig->robot, rig->dynamics == RIG_DYNAMICS_GENERIC, arena,
                                  &dynamics, &notice, &error);

    printf("%-5s%-15s%s, hash %016" PRIx64 ": %s\n", failed ? "fail" : "ok", "robot",
           rig->robot->name, rig->robot->hash, failed ? error.text : notice.text);
}

/* Measures wake-up latency: sleeps until each tick as the loop does, and prints the delays. */
static void doctor_measure_wakeups(const struct rig *rig, double seconds)
{
    struct realtime_config config = {.priority = rig->realtime.priority,
                                     .lock_memory = rig->realtime.lock_memory,
                                     .cpu = rig->realtime.cpu};
    static struct histogram late;
    struct realtime_report report;
    struct clock *clock = clock_monotonic();
    int64_t count = (int64_t)(seconds * 1e9 / (double)rig->tick_ns), deadline;

    /* Uses the scheduling of a run; drops deadlines that have passed, like the overrun policy
     * skip */
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

struct doctor_options {
    const char *rig;
    bool local;
    double measure_s, listen_s;
};

/* Opens ports on the interfaces of external boards. A port that cannot be opened stays NULL; the
 * finding of its interface gives the reason. */
static void doctor_open_ports(const struct rig *rig, struct arena *arena, struct can_port **port)
{
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const int bus = rig->boards.board[i].bus;
        const struct socketcan_config config = {.interface = rig->bus[bus].interface,
                                                .fd = rig->bus[bus].fd};
        struct error error;

        if (rig->boards.board[i].external && !port[bus] &&
            socketcan_open(&config, arena, &port[bus], &error)) {
            port[bus] = NULL;
        }
    }
}

/* Examines the machine for a rig, prints all findings, and measures; returns the exit status. */
static int doctor_examine_rig(void *context, const struct rig *rig, struct arena *arena)
{
    static const char *const words[] = {"ok", "warn", "fail"};
    static struct doctor_finding findings[DOCTOR_FINDINGS_MAX];
    const struct doctor_options *options = context;
    struct can_port *port[RIG_BUSES_MAX] = {NULL};
    struct doctor_config config = {.root = "",
                                   .rig = rig,
                                   .local = options->local,
                                   .interfaces = &interface_kernel,
                                   .port = port,
                                   .listen_ns = (int64_t)(options->listen_s * 1e9),
                                   .clock = clock_monotonic(),
                                   .arena = arena};
    size_t count;

    if (!options->local) {
        doctor_open_ports(rig, arena, port);
    }
    count = doctor_examine(&config, findings, DOCTOR_FINDINGS_MAX);
    for (size_t b = 0; b < rig->nbus; b++) {
        if (port[b]) {
            port[b]->ops->close(port[b]);
        }
    }
    for (size_t i = 0; i < count; i++) {
        printf("%-5s%-15s%s\n", words[findings[i].verdict], findings[i].subject, findings[i].found);
        if (findings[i].fix[0]) {
            printf("%20s-> %s\n", "", findings[i].fix);
        }
    }
    doctor_print_robot(rig, arena);

    /* The measurement changes the scheduling of this process, so it comes last */
    if (options->measure_s > 0.0) {
        fflush(stdout);
        doctor_measure_wakeups(rig, options->measure_s);
    }
    return doctor_verdict(findings, count) == DOCTOR_FAIL ? STATUS_FAILED : STATUS_OK;
}

int cmd_doctor(int argc, char **argv)
{
    static struct doctor_options o = {.measure_s = 1.0, .listen_s = 1.0};
    static const struct option_spec options[] = {
        {"--measure", OPTION_REAL, "S", "measure wake-ups for S seconds, 1 by default; 0 does not",
         .value = &o.measure_s, .min = 0.0, .max = 3600.0, .unit = "seconds"},
        {"--listen", OPTION_REAL, "S",
         "listen for the rig's external boards for S seconds, 1 by default; 0 does not",
         .value = &o.listen_s, .min = 0.0, .max = 60.0, .unit = "seconds"},
        {"--local", OPTION_FLAG, NULL, "buses inside the process: skip CAN interfaces",
         .value = &o.local},
    };
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name", true, &o.rig, .noun = "rigs"}};
    static const struct command_spec spec = {
        .name = "doctor",
        .summary = "Say what keeps this machine from meeting a rig's deadlines.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_DOCTOR,
    };
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    return rig_command("doctor", o.rig, &o, doctor_examine_rig);
}
