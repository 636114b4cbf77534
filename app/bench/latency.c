/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil-bench latency: measures the time from a sent frame to its answer, by the kernel's time
 * stamps. It measures an echo by a thread on the same interface. It also measures virtual or real
 * boards, from a command that switches a motor to the first telemetry that shows the new state. For
 * comparison, it measures how late a timer wakes the measuring thread, as cyclictest does. It takes
 * one sample of each kind in turn.
 */
#include "app/bench/latency_tap.h"
#include "app/bench/bench.h"
#include "base/array.h"
#include "base/options.h"
#include "manual/latency.h"
#include "rt/clock.h"
#include "rt/histogram.h"
#include "rt/realtime.h"
#include "sim/buses.h"
#include "tasks/host.h"

#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <string.h>

enum { ARENA_BYTES = 1 << 30, COUNT_MAX = 10000000, PRIORITY_MAX = 98 };

/* Extended identifiers that no board uses and that have the lowest priority on the bus. */
enum { LATENCY_PING = 0x1ffffff0, LATENCY_PONG = 0x1ffffff1 };

enum latency_kind { LATENCY_WAKE_UP, LATENCY_ECHO, LATENCY_BOARDS, LATENCY_KINDS };

static const char *const kind_name[LATENCY_KINDS] = {"wake-up", "echo", "boards"};

/* Latencies by kind. */
struct latency_result {
    struct histogram of[LATENCY_KINDS];
    uint64_t lost[LATENCY_KINDS]; /* samples without an answer within 1 s */
};

/* The measured boards. tap[bus] are the ports of the host. */
struct latency_boards {
    struct host *host;
    struct latency_tap **tap;
    size_t nbus, axis, bus; /* the axis whose motor is switched, and its bus */
    int64_t period_ns;      /* control period of the host */
    const char *joint;
};

static volatile bool latency_stopped;

/* Requests a stop; a signal handler. */
static void latency_stop(int number)
{
    (void)number;
    latency_stopped = true;
}

/* Longest wait for the boards, which may need seconds to boot. */
static const int64_t START_UP_NS = 15 * CLOCK_SECOND;

/* ---- waiting ---- */

/* Waits until one of the taps has received a frame, or until the given time. */
static void latency_wait_frames(struct latency_tap *const *tap, size_t count, int64_t until_ns)
{
    struct pollfd fds[64];
    size_t nfd = 0;

    for (size_t i = 0; i < count && nfd < 64; i++) {
        if (tap[i]->first < tap[i]->nwaiting) {
            return;
        }
        fds[nfd++] = (struct pollfd){tap[i]->port.ops->descriptor(&tap[i]->port), POLLIN, 0};
    }
    clock_wait_readable(clock_monotonic(), fds, nfd, until_ns);
}

/* Counts the frames received on all buses. */
static uint64_t latency_count_frames(const struct latency_boards *boards)
{
    uint64_t frames = 0;

    for (size_t b = 0; b < boards->nbus; b++) {
        frames += boards->tap[b]->frames;
    }
    return frames;
}

/* Receives frames until the motor is in the wanted state, or until the given time. Returns whether
 * the motor is in that state. */
static bool latency_read_until(const struct latency_boards *boards, enum host_motor wanted,
                               int64_t until_ns)
{
    const struct host_joint *joint = host_joint(boards->host, boards->axis);

    for (;;) {
        int64_t now = clock_now(clock_monotonic());
        uint64_t frames = latency_count_frames(boards);

        host_receive(boards->host, now);
        if (joint->motor == wanted) {
            return true;
        }

        /* Wait only if no frame has arrived since the last check */
        if (latency_count_frames(boards) == frames) {
            if (now >= until_ns) {
                return false;
            }
            latency_wait_frames(boards->tap, boards->nbus, until_ns);
        }
    }
}

/* ---- one sample of each kind ---- */

/* Measures the time from a ping to its pong on an interface without boards. */
static void latency_sample_echo(struct latency_tap *ping, uint32_t number,
                                struct latency_result *result)
{
    int64_t until = clock_now(clock_monotonic()) + CLOCK_SECOND;
    struct bus_frame frame =
        frame_make(0, 4,
                   (const uint8_t[]){(uint8_t)number, (uint8_t)(number >> 8),
                                     (uint8_t)(number >> 16), (uint8_t)(number >> 24)});
    struct bus_frame answer;

    frame.id = LATENCY_PING;
    frame.flags = FRAME_EXTENDED;
    latency_tap_mark(ping);
    can_send(&ping->port, &frame, 1);
    while (clock_now(clock_monotonic()) < until) {
        if (can_receive(&ping->port, &answer, 1) == 0) {
            latency_wait_frames(&ping, 1, until);
        } else if (answer.id == LATENCY_PONG && !memcmp(answer.data, frame.data, 4) &&
                   ping->sent_ns) {
            histogram_add(&result->of[LATENCY_ECHO], ping->received_ns - ping->sent_ns);
            return;
        }
    }
    result->lost[LATENCY_ECHO]++;
}

/* Measures the time from a command that switches the motor to the telemetry that shows it. Repeats
 * the command every period, as a host repeats its set points. */
static void latency_sample_boards(const struct latency_boards *boards, bool on,
                                  struct latency_result *result)
{
    enum host_motor wanted = on ? HOST_MOTOR_ON : HOST_MOTOR_OFF;
    struct latency_tap *tap = boards->tap[boards->bus];
    int64_t now = clock_now(clock_monotonic()), until = now + CLOCK_SECOND;

    host_set_motor(boards->host, boards->axis, on);
    latency_tap_mark(tap);
    for (; now < until; now += boards->period_ns) {
        host_send(boards->host);
        if (latency_read_until(boards, wanted, now + boards->period_ns) && tap->sent_ns) {
            histogram_add(&result->of[LATENCY_BOARDS], tap->received_ns - tap->sent_ns);
            return;
        }
    }
    result->lost[LATENCY_BOARDS]++;
}

/* ---- the echo ---- */

/* The thread that answers pings. */
struct latency_echo {
    struct can_port *port;
    int priority;
    atomic_bool stop;
    pthread_t thread;
};

/* Answers each ping with a pong that has the same data. Runs at the given priority. */
static void *latency_echo_main(void *context)
{
    struct latency_echo *echo = context;
    const struct realtime_config realtime = {echo->priority, true, -1};
    struct realtime_report report;
    struct bus_frame frame;

    realtime_apply(&realtime, &report);
    while (!atomic_load(&echo->stop)) {
        struct pollfd fd = {echo->port->ops->descriptor(echo->port), POLLIN, 0};

        while (can_receive(echo->port, &frame, 1) == 1) {
            if (frame.id == LATENCY_PING && frame.flags & FRAME_EXTENDED) {
                frame.id = LATENCY_PONG;
                can_send(echo->port, &frame, 1);
            }
        }
        clock_wait_readable(clock_monotonic(), &fd, 1,
                            clock_now(clock_monotonic()) + 100 * CLOCK_MS);
    }
    return NULL;
}

/* ---- the measurement ---- */

/* Finds and configures the boards, and switches the measured motor off; other motors stay as they
 * are. Returns ERROR_SYSTEM with the host's message if the boards do not answer. */
static enum error_code latency_find_boards(const struct latency_boards *boards, struct error *error)
{
    int64_t now = clock_now(clock_monotonic()), until = now + START_UP_NS;
    enum host_phase phase = HOST_DISCOVERING;

    /* Repeat until the boards are configured; leave the motors off */
    while (phase < HOST_ENABLING && now < until) {
        now += boards->period_ns;
        latency_read_until(boards, (enum host_motor) - 1, now);
        phase = host_start_up(boards->host);
        host_send(boards->host);
    }
    if (phase == HOST_ENABLING) {
        host_set_motor(boards->host, boards->axis, false);
        host_send(boards->host);
        latency_read_until(boards, HOST_MOTOR_OFF, now + CLOCK_SECOND);
        return ERROR_NONE;
    }
    return error_set(error, ERROR_SYSTEM, "%s",
                     phase == HOST_FAILED ? host_message(boards->host)
                                          : "the boards do not answer within 15 s");
}

/* Takes count samples of each kind, in turn. boards may be NULL. ping receives its own frames
 * (receive_own) and the pongs. A thread with the given priority answers on the port echo. A stop
 * ends the measurement early. Leaves the motor off. */
static enum error_code latency_measure(const struct latency_boards *boards,
                                       struct latency_tap *ping, struct can_port *echo,
                                       int priority, size_t count, struct latency_result *result,
                                       struct error *error)
{
    struct latency_echo other = {.port = echo, .priority = priority};
    int code = pthread_create(&other.thread, NULL, latency_echo_main, &other);

    if (code) {
        return error_set_errno(error, code, "cannot start the echo");
    }
    for (size_t i = 0; i < count && !latency_stopped; i++) {
        int64_t at = clock_now(clock_monotonic()) + CLOCK_MS;

        /* Measure how late a timer wakes this thread */
        clock_sleep_until(clock_monotonic(), at);
        histogram_add(&result->of[LATENCY_WAKE_UP], clock_now(clock_monotonic()) - at);
        latency_sample_echo(ping, (uint32_t)i, result);
        if (boards) {
            static const uint32_t golden = 2654435769u; /* 2^32 / 1.618 */
            uint32_t part = (uint32_t)i * golden;
            int64_t until = clock_now(clock_monotonic()) + 2 * boards->period_ns +
                            (int64_t)((double)boards->period_ns * part / 4294967296.0);

            /* Wait for two periods plus a fraction of a third period. The fractions are a
             * golden-ratio sequence, so that the commands cover all phases of the boards'
             * period. */
            latency_read_until(boards, (enum host_motor) - 1, until);
            latency_sample_boards(boards, i % 2 == 0, result);
        }
    }
    if (boards) {
        host_set_motor(boards->host, boards->axis, false);
        host_send(boards->host);
    }
    atomic_store(&other.stop, true);
    pthread_join(other.thread, NULL);
    return ERROR_NONE;
}

/* ---- what was measured ---- */

/* Prints a table of percentiles, us. */
static void latency_print(const struct latency_result *result, const char *joint)
{
    printf("  us            count       p50       p90       p99     p99.9       max     lost\n");
    for (int kind = 0; kind < LATENCY_KINDS; kind++) {
        if (result->of[kind].count + result->lost[kind] > 0) {
            static const double part[] = {0.5, 0.9, 0.99, 0.999};
            const struct histogram *of = &result->of[kind];

            printf("  %-10s %8" PRIu64, kind_name[kind], of->count);
            for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
                printf(" %9.1f", 1e-3 * (double)histogram_percentile(of, part[i]));
            }
            printf(" %9.1f %8" PRIu64 "\n", 1e-3 * (double)of->max, result->lost[kind]);
        }
    }
    if (joint) {
        printf("boards: from the command that switches the motor of %s to the first telemetry that "
               "says so\n",
               joint);
    }
}

/* ---- the run ---- */

/* The command line. */
struct latency_command {
    const char *rig, *interface, *joint, *folder, *program;
    bool answers;
    struct option_list bus;
    int64_t count, priority;
};

/* Opens an interface with a tap, which also receives its own frames. */
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

    if (!code && (code = latency_tap_create(port, arena, tap, error))) {
        port->ops->close(port);
    }
    return code;
}

/* Opens the host's ports on every bus of the rig, and finds the axis to switch. */
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

    /* Put a tap on each bus; the caller closes the opened ports, even after an error */
    code = buses_open(rig, TRANSPORT_SOCKETCAN, options->bus.item, options->bus.count, 0, false,
                      arena, &buses, notice, error);
    for (; !code && boards->nbus < rig->nbus; boards->nbus++) {
        size_t b = boards->nbus;

        if ((code = latency_open_tap(buses.interface[b], rig->bus[b].fd, NULL, 0, arena,
                                     &boards->tap[b], error))) {
            return code;
        }
        port[b] = &boards->tap[b]->port;
    }
    if (code) {
        return code;
    }

    config = rig_host_config(rig, port, false);
    if ((code = host_create(&config, arena, &boards->host, error))) {
        return code;
    }

    /* Use the given joint, else the rig's first axis */
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

/* Measures and prints the results, after everything is open. */
static enum error_code latency_run(const struct latency_command *options, const char *interface,
                                   const struct latency_boards *boards, struct latency_tap *ping,
                                   struct can_port *echo, struct error *error)
{
    const struct realtime_config realtime = {(int)options->priority, true, -1};
    static struct latency_result result;
    struct realtime_report report;
    struct report_file file;
    enum error_code code;

    realtime_apply(&realtime, &report);
    for (size_t i = 0; i < report.count; i++) {
        fprintf(stderr, "coman-hil-bench: warning: %s\n", report.warning[i]);
    }
    if (boards && (code = latency_find_boards(boards, error))) {
        return code;
    }

    /* Ctrl-C ends the measurement early and keeps the samples so far */
    signal(SIGINT, latency_stop);
    code = latency_measure(boards, ping, echo, (int)options->priority, (size_t)options->count,
                           &result, error);
    signal(SIGINT, SIG_DFL);
    if (code) {
        return code;
    }
    printf("latency on %s\n", interface);
    latency_print(&result, boards ? boards->joint : NULL);
    if (!options->folder ||
        (code = report_file_open(&file, options->folder, "latency.csv", error))) {
        return code;
    }

    /* Write every bucket that is not empty: its upper edge, us, and the counts */
    fprintf(file.whole.out, "upto_us,wake_up,echo,boards\n");
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        uint64_t of[LATENCY_KINDS], any = 0;

        for (int kind = 0; kind < LATENCY_KINDS; kind++) {
            any |= of[kind] = result.of[kind].bucket[i];
        }
        if (any) {
            fprintf(file.whole.out, "%.3f,%" PRIu64 ",%" PRIu64 ",%" PRIu64 "\n",
                    1e-3 * (double)histogram_edge(i), of[0], of[1], of[2]);
        }
    }
    return whole_file_close(&file.whole, ERROR_NONE, error);
}

/* Opens the buses of the rig or the interface, measures, and closes all ports. */
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

    /* The echo uses the bus of the axis, so that both kinds share an interface */
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
        {"--answers", OPTION_FLAG, NULL,
         "without a rig: the answers of boards to a request, for each protocol",
         .value = &o.answers},
        {"--program", OPTION_STRING, "FILE",
         "with --answers: the coman-hil to measure; the one beside this program by default",
         .value = &o.program},
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
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_LATENCY,
    };
    char program[PATH_MAX];
    struct arena arena = {0};
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* The user must give one of a rig, which names its interfaces, an interface and --answers */
    if (!!o.rig + !!o.interface + o.answers != 1) {
        code = error_set(&error, ERROR_INPUT,
                         "expected a RIG whose boards are on the buses, --interface IFACE or "
                         "--answers");
    } else if (o.answers) {
        code = o.program ? ERROR_NONE : bench_find_program(program, &error);
        code =
            code ? code : bench_answers(o.program ? o.program : program, (size_t)o.count, &error);
    } else {
        code = arena_init(&arena, ARENA_BYTES, &error);
        code = code ? code : latency_open_and_run(&o, &arena, &error);
        arena_fini(&arena);
    }
    return options_end(&spec, code, &error);
}
