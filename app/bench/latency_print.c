/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench latency: reads its options, prints the table and writes the file. */
#include "app/bench/latency.h"

#include "app/bench/output.h"
#include "app/report/report.h"
#include "base/array.h"
#include "base/options.h"
#include "manual/latency.h"
#include "rig/rig.h"
#include "rt/realtime.h"
#include "sim/buses.h"

#include <inttypes.h>
#include <signal.h>
#include <string.h>

enum { ARENA_BYTES = 1 << 30, COUNT_MAX = 10000000, PRIORITY_MAX = 98 };

static const char *const kind_name[LATENCY_KINDS] = {"wake-up", "echo", "boards"};

/* ---- what was measured ---- */

/* Prints the percentiles of a kind, us. */
static void latency_print_line(const struct latency_result *result, int kind, FILE *out)
{
    static const double part[] = {0.5, 0.9, 0.99, 0.999};
    const struct histogram *of = &result->of[kind];

    fprintf(out, "  %-10s %8" PRIu64, kind_name[kind], of->count);
    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        fprintf(out, " %9.1f", 1e-3 * (double)histogram_percentile(of, part[i]));
    }
    fprintf(out, " %9.1f %8" PRIu64 "\n", 1e-3 * (double)of->max, result->lost[kind]);
}

/* Counts the samples in buckets whose upper edge lies within (above, upto] ns. */
static uint64_t latency_count_between(const struct histogram *of, int64_t above, int64_t upto)
{
    uint64_t count = 0;

    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        int64_t edge = histogram_edge(i);

        count += edge > above && edge <= upto ? of->bucket[i] : 0;
    }
    return count;
}

void latency_print(const struct latency_result *result, const char *joint, FILE *out)
{
    static const int step[] = {1, 2, 5};
    int64_t above = -1, upto = 0, all = 0;
    bool begun = false;

    fprintf(out,
            "  us            count       p50       p90       p99     p99.9       max     lost\n");
    for (int kind = 0; kind < LATENCY_KINDS; kind++) {
        if (result->of[kind].count + result->lost[kind] > 0) {
            latency_print_line(result, kind, out);
        }
    }
    if (joint) {
        fprintf(out,
                "boards: from the command that switches the motor of %s to the first "
                "telemetry that says so\n",
                joint);
    }

    fprintf(out, "\n  up to us   wake-up      echo    boards\n");
    for (int kind = 0; kind < LATENCY_KINDS; kind++) {
        all = result->of[kind].max > all ? result->of[kind].max : all;
    }

    /* Steps of 1, 2, 5 in each decade, from the first that has a sample to the largest one */
    for (int n = 0; above < all; n++, above = upto) {
        uint64_t of[LATENCY_KINDS], any = 0;

        upto = step[n % 3] * 1000;
        for (int i = 0; i < n / 3; i++) {
            upto *= 10;
        }
        for (int kind = 0; kind < LATENCY_KINDS; kind++) {
            of[kind] = latency_count_between(&result->of[kind], above, upto);
            any |= of[kind];
        }
        begun = begun || any;
        if (begun) {
            fprintf(out, "  %8" PRId64 " %9" PRIu64 " %9" PRIu64 " %9" PRIu64 "\n", upto / 1000,
                    of[0], of[1], of[2]);
        }
    }
}

void latency_write_csv(const struct latency_result *result, FILE *out)
{
    fprintf(out, "upto_us,wake_up,echo,boards\n");
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        uint64_t of[LATENCY_KINDS], any = 0;

        for (int kind = 0; kind < LATENCY_KINDS; kind++) {
            any |= of[kind] = result->of[kind].bucket[i];
        }
        if (any) {
            fprintf(out, "%.3f,%" PRIu64 ",%" PRIu64 ",%" PRIu64 "\n",
                    1e-3 * (double)histogram_edge(i), of[0], of[1], of[2]);
        }
    }
}

/* ---- the run ---- */

/* The command line. */
struct latency_command {
    const char *rig, *interface, *joint, *folder;
    struct option_list bus;
    int64_t count, priority;
};

static volatile bool latency_stopped;

/* Notes a stop; a signal handler. */
static void latency_stop(int number)
{
    (void)number;
    latency_stopped = true;
}

/* Opens an interface with a tap, which also hears what is sent. */
static enum error_code latency_open_tap(const char *interface, bool fd,
                                        const struct frame_filter *filter, size_t nfilter,
                                        struct arena *arena, struct latency_tap **tap,
                                        struct error *error)
{
    const struct socketcan_config config = {
        .interface = interface,
        .fd = fd,
        .filter = filter,
        .nfilter = nfilter,
        .receive_own = true,
    };
    struct can_port *port;
    enum error_code code = socketcan_open(&config, arena, &port, error);

    if (code) {
        return code;
    }
    code = latency_tap_create(port, arena, tap, error);
    if (code) {
        port->ops->close(port);
    }
    return code;
}

/* Opens the host's ports on every bus of the rig, and finds the axis that is to be switched. */
static enum error_code latency_join_rig(const struct latency_command *options,
                                        const struct rig *rig, struct arena *arena,
                                        struct latency_boards *boards, struct error *error)
{
    struct can_port **port = arena_alloc(arena, rig->nbus, sizeof *port);
    struct host_config config;
    enum error_code code;
    struct buses buses;
    char notice[256];
    int axis;

    boards->tap = arena_alloc(arena, rig->nbus, sizeof *boards->tap);
    if (!port || !boards->tap) {
        return error_set(error, ERROR_MEMORY, "no memory left for the buses");
    }

    /* A tap on each bus; the ports that were opened are closed by the caller, also after an
     * error */
    code = buses_open(rig, TRANSPORT_SOCKETCAN, options->bus.item, options->bus.count, 0, false,
                      arena, &buses, notice, error);
    for (; !code && boards->nbus < rig->nbus; boards->nbus++) {
        size_t b = boards->nbus;

        code = latency_open_tap(buses.interface[b], rig->bus[b].fd, NULL, 0, arena, &boards->tap[b],
                                error);
        if (code) {
            return code;
        }
        port[b] = &boards->tap[b]->port;
    }
    if (code) {
        return code;
    }

    config = rig_host_config(rig, port, false);
    code = host_create(&config, arena, &boards->host, error);
    if (code) {
        return code;
    }

    /* The joint that was named, or the rig's first axis */
    axis = options->joint ? host_find_axis(boards->host, options->joint) : 0;
    if (axis < 0 || config.naxis == 0) {
        return error_set(error, ERROR_INPUT, "no board of the rig drives a joint '%s'",
                         options->joint ? options->joint : "");
    }
    boards->axis = (size_t)axis;
    boards->bus = (size_t)config.axis[axis].bus;
    boards->joint = config.axis[axis].joint;
    boards->period_ns = config.period_ns;
    return ERROR_NONE;
}

/* Writes latency.csv into a folder. */
static enum error_code latency_write_files(const struct latency_result *result, const char *folder,
                                           struct error *error)
{
    struct report_file file;
    enum error_code code = report_file_open(&file, folder, "latency.csv", error);

    if (code) {
        return code;
    }
    latency_write_csv(result, file.whole.out);
    return whole_file_close(&file.whole, ERROR_NONE, error);
}

/* Measures and prints, once everything is open. */
static enum error_code latency_run(const struct latency_command *options, const char *interface,
                                   const struct latency_boards *boards, struct latency_tap *ping,
                                   struct can_port *echo, struct error *error)
{
    const struct realtime_config realtime = {(int)options->priority, true, -1};
    static struct latency_result result;
    struct realtime_report report;
    enum error_code code;

    realtime_apply(&realtime, &report);
    for (size_t i = 0; i < report.count; i++) {
        fprintf(stderr, "coman-hil-bench: warning: %s\n", report.warning[i]);
    }
    if (boards && (code = latency_find_boards(boards, error))) {
        return code;
    }

    /* Ctrl-C ends the measurement early, with the samples so far */
    signal(SIGINT, latency_stop);
    code = latency_measure(boards, ping, echo, (int)options->priority, (size_t)options->count,
                           &latency_stopped, &result, error);
    signal(SIGINT, SIG_DFL);
    if (code) {
        return code;
    }
    printf("latency on %s\n", interface);
    latency_print(&result, boards ? boards->joint : NULL, stdout);
    return options->folder ? latency_write_files(&result, options->folder, error) : ERROR_NONE;
}

/* Opens the buses of the rig, or the interface, and measures; closes all ports. */
static enum error_code latency_open_and_run(const struct latency_command *options,
                                            struct arena *arena, struct error *error)
{
    const struct frame_filter ping_filter[] = {{LATENCY_PING & ~1u, ~1u, true}},
                              echo_filter[] = {{LATENCY_PING, ~0u, true}};
    struct socketcan_config echo_config = {.filter = echo_filter, .nfilter = 1};
    struct latency_boards boards = {0};
    struct latency_tap *ping = NULL;
    struct can_port *echo = NULL;
    const struct rig *rig;
    enum error_code code = ERROR_NONE;

    echo_config.interface = options->interface;
    if (options->rig) {
        code = rig_load(options->rig, arena, &rig, error);
        code = code ? code : latency_join_rig(options, rig, arena, &boards, error);
        echo_config.interface = code ? NULL : boards.tap[boards.bus]->port.bus;
    }

    /* The echo is on the bus of the axis, so that both kinds have the same interface */
    code =
        code ? code
             : latency_open_tap(echo_config.interface, false, ping_filter, 1, arena, &ping, error);
    code = code ? code : socketcan_open(&echo_config, arena, &echo, error);
    code = code ? code
                : latency_run(options, echo_config.interface, options->rig ? &boards : NULL, ping,
                              echo, error);

    if (echo) {
        echo->ops->close(echo);
    }
    if (ping) {
        ping->port.ops->close(&ping->port);
    }
    for (size_t b = 0; b < boards.nbus; b++) {
        boards.tap[b]->port.ops->close(&boards.tap[b]->port);
    }
    return code;
}

int bench_latency(int argc, char **argv)
{
    static struct latency_command o = {.count = 1000, .priority = 80};
    static const struct option_spec options[] = {
        {"--interface", OPTION_STRING, "IFACE",
         "without a rig: the interface on which the echo is measured", .value = &o.interface},
        {"--bus", OPTION_LIST, "NAME=INTERFACE",
         "put a bus of the rig on this interface; may be given more than once", .value = &o.bus},
        {"--joint", OPTION_STRING, "JOINT",
         "the joint whose motor is switched; the rig's first by default", .value = &o.joint},
        {"--count", OPTION_INT, "N", "measurements of each kind, 1000 by default",
         .value = &o.count, .min = 1, .max = COUNT_MAX},
        {"--priority", OPTION_INT, "P",
         "SCHED_FIFO priority of both threads, 80 by default; 0: none", .value = &o.priority,
         .min = 0, .max = PRIORITY_MAX},
        BENCH_OUT_OPTION(&o.folder, "latency.csv"),
    };
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name, whose boards, virtual or real, are on the buses", false,
         &o.rig, .noun = "rigs"}};
    static const struct command_spec spec = {
        .program = "coman-hil-bench",
        .name = "latency",
        .summary = "From a command on a CAN interface to the frame that answers it, by the "
                   "kernel's time stamps.",
        .option = options,
        .noption = ARRAY_COUNT(options),
        .operand = operands,
        .noperand = ARRAY_COUNT(operands),
        .manual = MANUAL_LATENCY,
    };
    struct arena arena;
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* Either a rig, which names its interfaces, or an interface alone */
    if (!o.rig == !o.interface) {
        code = error_set(&error, ERROR_INPUT,
                         "expected a RIG whose boards are on the buses, or --interface IFACE");
        return options_end(&spec, code, &error);
    }
    code = arena_init(&arena, ARENA_BYTES, &error);
    if (!code) {
        code = latency_open_and_run(&o, &arena, &error);
        arena_fini(&arena);
    }
    return options_end(&spec, code, &error);
}
