/* SPDX-License-Identifier: Apache-2.0 */
/* Measures the time from a frame that goes out to the frame that answers it. */
#include "app/bench/latency.h"

#include "rt/clock.h"
#include "rt/realtime.h"

#include <pthread.h>
#include <stdatomic.h>
#include <string.h>

/* Wait for the boards, which may boot for some seconds. */
static const int64_t START_UP_NS = 15 * CLOCK_SECOND;

/* ---- waiting ---- */

/* Waits until a frame has come on one of the taps, or until the time. */
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

/* Receives until the motor is in the wanted state, or until the time; returns whether it is. */
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

        /* Waits only when nothing has come since the last look */
        if (latency_count_frames(boards) == frames) {
            if (now >= until_ns) {
                return false;
            }
            latency_wait_frames(boards->tap, boards->nbus, until_ns);
        }
    }
}

/* ---- one sample of each kind ---- */

/* Takes a sample of how late a timer wakes this thread. */
static void latency_sample_wake_up(struct latency_result *result)
{
    int64_t at = clock_now(clock_monotonic()) + CLOCK_MS;

    clock_sleep_until(clock_monotonic(), at);
    histogram_add(&result->of[LATENCY_WAKE_UP], clock_now(clock_monotonic()) - at);
}

/* Takes a sample of the time from a ping to its pong on a bare interface. */
static void latency_sample_echo(struct latency_tap *ping, uint32_t number,
                                struct latency_result *result)
{
    int64_t until = clock_now(clock_monotonic()) + LATENCY_TIMEOUT_NS;
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

/* Takes a sample of the time from a command that switches the motor to the telemetry that says so.
 * The command is repeated every period, as a host does when set-points are due. */
static void latency_sample_boards(const struct latency_boards *boards, bool on,
                                  struct latency_result *result)
{
    enum host_motor wanted = on ? HOST_MOTOR_ON : HOST_MOTOR_OFF;
    struct latency_tap *tap = boards->tap[boards->bus];
    int64_t now = clock_now(clock_monotonic()), until = now + LATENCY_TIMEOUT_NS;

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

/* Answers each ping with a pong of the same data, at the priority given. */
static void *latency_echo_main(void *context)
{
    struct latency_echo *echo = context;
    const struct realtime_config realtime = {echo->priority, true, -1};
    struct realtime_report report;
    struct pollfd fd = {echo->port->ops->descriptor(echo->port), POLLIN, 0};
    struct bus_frame frame;

    realtime_apply(&realtime, &report);
    while (!atomic_load(&echo->stop)) {
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

/* ---- all of it ---- */

enum error_code latency_find_boards(const struct latency_boards *boards, struct error *error)
{
    int64_t now = clock_now(clock_monotonic()), until = now + START_UP_NS;
    enum host_phase phase = HOST_DISCOVERING;

    /* Goes on until the boards are configured; motors are not switched on */
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

/* Waits for two periods and a part of a third, another part each time (a golden-ratio sequence), so
 * that commands meet the boards at all phases of their period. */
static void latency_shift(const struct latency_boards *boards, size_t number)
{
    static const uint32_t golden = 2654435769u; /* 2^32 / 1.618 */
    uint32_t part = (uint32_t)number * golden;
    int64_t until = clock_now(clock_monotonic()) + 2 * boards->period_ns +
                    (int64_t)((double)boards->period_ns * part / 4294967296.0);

    latency_read_until(boards, (enum host_motor) - 1, until);
}

enum error_code latency_measure(const struct latency_boards *boards, struct latency_tap *ping,
                                struct can_port *echo, int priority, size_t count,
                                const volatile bool *stop, struct latency_result *result,
                                struct error *error)
{
    struct latency_echo other = {.port = echo, .priority = priority};
    int code = pthread_create(&other.thread, NULL, latency_echo_main, &other);

    if (code) {
        return error_set_errno(error, code, "cannot start the echo");
    }
    for (size_t i = 0; i < count && !*stop; i++) {
        latency_sample_wake_up(result);
        latency_sample_echo(ping, (uint32_t)i, result);
        if (boards) {
            latency_shift(boards, i);
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
