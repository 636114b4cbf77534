/* SPDX-License-Identifier: Apache-2.0 */
/*
 * coman-hil-bench latency --answers: measures the time from a request to the answer of a board, for
 * each protocol, through the gateway, slcan and vcan. Each protocol has its own simulator, which
 * this program starts. For comparison it measures two bare sockets.
 */
#include "app/bench/bench.h"
#include "base/array.h"
#include "canbus/slcan.h"
#include "rt/clock.h"
#include "rt/histogram.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define ANSWER_TIMEOUT_NS CLOCK_SECOND
#define ANSWER_START_NS (30 * CLOCK_SECOND)

enum { LOST_MAX = 10 }; /* answers that may be lost before a measurement ends early */

/* A request to board 1 of the bus on interface can1, and the identifier of its answer. */
struct answer_case {
    const char *name, *rig;
    struct bus_frame request;
    uint32_t answer_id;
};

#define MIT_OFF 255, 255, 255, 255, 255, 255, 255, 0xfd
enum { FD = FRAME_EXTENDED | FRAME_FD | FRAME_BRS };
static const struct answer_case answer_cases[] = {
    {"moteus query", "coman-moteus", {.id = 0x8001, .flags = FD, .len = 3, .data = {20, 4}}, 0x100},
    {"SDO upload", "coman-cia402", {.id = 0x601, .len = 8, .data = {0x40, 0, 0x10}}, 0x581},
    {"icub GET", "coman", {.id = 0x001, .len = 1, .data = {7}}, 0x010},
    {"MIT frame", "coman-mini-cheetah", {.id = 1, .len = 8, .data = {MIT_OFF}}, 0},
    {"CANSimple request", "coman-odrive", {.id = 0x020, .flags = FRAME_REMOTE, .len = 8}, 0x020},
};

/* A connection on which requests and answers are bytes. */
struct answer_channel {
    int fd;
    const void *request, *answer;
    size_t request_size, answer_size;
};

/* Reads until the bytes of `answer` have come; false = not before the time. */
static bool answer_read(int fd, const void *answer, size_t size, int64_t until_ns)
{
    char bytes[8192];
    size_t count = 0;

    while (clock_now(clock_monotonic()) < until_ns) {
        struct pollfd ready = {fd, POLLIN, 0};
        ssize_t got;

        clock_wait_readable(clock_monotonic(), &ready, 1, until_ns);
        got = ready.revents ? read(fd, bytes + count, sizeof bytes - count) : 0;
        if (got < 0 || (got == 0 && ready.revents)) {
            return false;
        }
        count += (size_t)got;
        if (memmem(bytes, count, answer, size)) {
            return true;
        }
        /* Keep the end, which may be the beginning of the answer */
        if (count > sizeof bytes / 2) {
            memmove(bytes, bytes + count - 64, 64);
            count = 64;
        }
    }
    return false;
}

/* Measures `count` answers at all phases of the boards' tick, and prints a line. */
static void answer_measure(const char *name, const char *way, const struct answer_channel *channel,
                           size_t count)
{
    static const double part[] = {0.5, 0.9, 0.99, 0.999};
    struct histogram times = {0};
    size_t sent = 0;

    for (size_t i = 0; i < count && sent - times.count < LOST_MAX; i++, sent++) {
        const uint32_t golden = 2654435769u; /* 2^32 / 1.618 */
        const int64_t pause_ns = CLOCK_MS + (int64_t)((uint32_t)i * golden >> 12);
        int64_t begin_ns;

        clock_sleep_until(clock_monotonic(), clock_now(clock_monotonic()) + pause_ns);
        begin_ns = clock_now(clock_monotonic());
        if (write(channel->fd, channel->request, channel->request_size) ==
                (ssize_t)channel->request_size &&
            answer_read(channel->fd, channel->answer, channel->answer_size,
                        begin_ns + ANSWER_TIMEOUT_NS)) {
            histogram_add(&times, clock_now(clock_monotonic()) - begin_ns);
        }
    }
    printf("  %-17s %-8s %6" PRIu64, name, way, times.count);
    for (size_t i = 0; i < ARRAY_COUNT(part); i++) {
        printf(" %9.1f", 1e-3 * (double)histogram_percentile(&times, part[i]));
    }
    printf(" %9.1f %6" PRIu64 "\n", 1e-3 * (double)times.max, sent - times.count);
    fflush(stdout);
}

/* ---- the channels ---- */

/* Sends back what a descriptor receives, until its end; a thread. */
static void *answer_echo(void *context)
{
    const int fd = *(const int *)context;
    char bytes[sizeof(struct canfd_frame)];
    ssize_t got;

    while ((got = read(fd, bytes, sizeof bytes)) > 0 && write(fd, bytes, (size_t)got) == got) {
    }
    return NULL;
}

/* Connects to a port of this machine; -1 = failed. */
static int answer_connect(uint16_t port)
{
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr = {htonl(INADDR_LOOPBACK)}};
    const int one = 1, fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    if (connect(fd, (const struct sockaddr *)&address, sizeof address)) {
        close(fd);
        return -1;
    }
    return fd;
}

/* Opens a raw socket on a CAN interface; -1 = the kernel has none. */
static int answer_open_can(const char *interface)
{
    const int one = 1, fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    const struct sockaddr_can address = {.can_family = AF_CAN,
                                         .can_ifindex = (int)if_nametoindex(interface)};

    setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &one, sizeof one);
    if (fd >= 0 &&
        (address.can_ifindex == 0 || bind(fd, (const struct sockaddr *)&address, sizeof address))) {
        close(fd);
        return -1;
    }
    return fd;
}

/* Measures the echo of a bare thread behind a connected pair of sockets. */
static void answer_measure_bare(const char *way, int near, int far, size_t count)
{
    struct canfd_frame ping = {.can_id = 0x7f0, .len = 8};
    const struct answer_channel channel = {near, &ping, &ping, CAN_MTU, CAN_MTU};
    pthread_t thread;

    if (near >= 0 && far >= 0 && !pthread_create(&thread, NULL, answer_echo, &far)) {
        answer_measure("two bare sockets", way, &channel, count);
        pthread_cancel(thread);
        pthread_join(thread, NULL);
    }
    close(near);
    close(far);
}

/* ---- the simulator ---- */

/* A running simulator: its process, folder and the port of its gateway. */
struct answer_run {
    pid_t process;
    char folder[64], path[128];
    uint16_t port;
};

/* Returns a file of the run's folder. */
static const char *answer_path(struct answer_run *run, const char *name)
{
    snprintf(run->path, sizeof run->path, "%s/%s", run->folder, name);
    return run->path;
}

/* Starts a simulator of a rig without reply delays and waits until it accepts clients. */
static enum error_code answer_start(const char *program, const char *rig, bool vcan,
                                    struct answer_run *run, struct error *error)
{
    const int64_t until = clock_now(clock_monotonic()) + ANSWER_START_NS;
    char line[4096] = "", file[128], ready[128], said[128], slcan[160];
    const char *port = NULL;
    FILE *text;

    strcpy(run->folder, "/tmp/coman-hil-XXXXXX");
    if (!mkdtemp(run->folder) || !(text = fopen(answer_path(run, "rig.yaml"), "we"))) {
        return error_set_file(error, errno, run->folder, "cannot be made");
    }
    fprintf(text, "{extends: %s, motors: {reply_delay_s: 0}}\n", rig);
    fclose(text);
    snprintf(file, sizeof file, "%s", run->path);
    snprintf(ready, sizeof ready, "%s", answer_path(run, "ready"));
    snprintf(said, sizeof said, "%s", answer_path(run, "said"));
    snprintf(slcan, sizeof slcan, "can1=%s", answer_path(run, "slcan"));
    fflush(NULL);
    run->process = fork();
    if (run->process == 0) {
        const int log = open(said, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);

        dup2(log, STDOUT_FILENO);
        dup2(log, STDERR_FILENO);
        execl(program, "coman-hil", "run", file, "--clock", "real", "--hold", "always", "--control",
              "none", "--quiet", "--ready", ready, "--transport", vcan ? "socketcan" : "local",
              vcan ? NULL : "--gateway", "0", "--slcan", slcan, (char *)NULL);
        _exit(127);
    }
    while (run->process > 0 && waitpid(run->process, NULL, WNOHANG) == 0 &&
           clock_now(clock_monotonic()) < until) {
        text = fopen(ready, "re");
        if (text) {
            line[fread(line, 1, sizeof line - 1, text)] = '\0';
            fclose(text);
            port = strstr(line, "gateway_port='");
            run->port = port ? (uint16_t)atoi(port + strlen("gateway_port='")) : 0;
            return ERROR_NONE;
        }
        clock_sleep_until(clock_monotonic(), clock_now(clock_monotonic()) + 10 * CLOCK_MS);
    }
    text = fopen(said, "re");
    if (text) {
        line[fread(line, 1, 500, text)] = '\0';
        fclose(text);
    }
    return error_set(error, ERROR_SYSTEM, "%s run %s does not start: %s", program, rig, line);
}

/* Writes the request as a command of the gateway. */
static void answer_format_gateway(const struct bus_frame *frame, char *text, size_t size)
{
    const bool remote = frame->flags & FRAME_REMOTE;
    size_t used = (size_t)snprintf(text, size, "< %s %0*X %s%d ",
                                   frame->flags & FRAME_FD ? "fdsend"
                                   : remote                ? "sendrtr"
                                                           : "send",
                                   frame->flags & FRAME_EXTENDED ? 8 : 3, frame->id,
                                   frame->flags & FRAME_FD ? "1 " : "", frame->len);

    for (size_t i = 0; i < frame->len && !remote; i++) {
        used += (size_t)snprintf(text + used, size - used, "%02X ", frame->data[i]);
    }
    snprintf(text + used, size - used, ">");
}

/* Sends a word to open a channel; false = the answer does not come. */
static bool answer_ask(int fd, const char *word, const char *answer)
{
    const int64_t until = clock_now(clock_monotonic()) + ANSWER_TIMEOUT_NS;

    return fd >= 0 && write(fd, word, strlen(word)) == (ssize_t)strlen(word) &&
           answer_read(fd, answer, strlen(answer), until);
}

/* Opens the bus through the gateway and through slcan, and measures both. */
static void answer_measure_text(const struct answer_case *of, struct answer_run *run, size_t count)
{
    const bool fd = of->request.flags & FRAME_FD;
    char request[256], answer[32];
    struct answer_channel channel = {.request = request, .answer = answer};

    channel.fd = answer_connect(run->port);
    answer_format_gateway(&of->request, request, sizeof request);
    channel.request_size = strlen(request);
    channel.answer_size = (size_t)snprintf(answer, sizeof answer, "< %s %03X ",
                                           fd ? "fdframe" : "frame", of->answer_id);
    if (answer_ask(channel.fd, "", "< hi >") && answer_ask(channel.fd, "< open can1 >", "< ok >") &&
        answer_ask(channel.fd, "< rawmode >", "< ok >")) {
        answer_measure(of->name, "gateway", &channel, count);
    }
    close(channel.fd);

    channel.fd = open(answer_path(run, "slcan"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    channel.request_size = slcan_format(&of->request, false, request);
    channel.answer_size =
        (size_t)snprintf(answer, sizeof answer, "%c%03X", fd ? 'b' : 't', of->answer_id);
    if (answer_ask(channel.fd, "O\r", "\r")) {
        answer_measure(of->name, "slcan", &channel, count);
    }
    close(channel.fd);
}

enum error_code bench_answers(const char *program, size_t count, struct error *error)
{
    const int can = answer_open_can("can1");
    enum error_code code = ERROR_NONE;

    close(can);
    printf("  answers, us                 count       p50       p90       p99     p99.9       max"
           "   lost\n");

    /* Measure two bare sockets over TCP, and over vcan if there is an interface */
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t size = sizeof address;
    const int one = 1, listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    if (!bind(listener, (struct sockaddr *)&address, size) && !listen(listener, 1) &&
        !getsockname(listener, (struct sockaddr *)&address, &size)) {
        const int near = answer_connect(ntohs(address.sin_port));
        const int far = accept4(listener, NULL, NULL, SOCK_CLOEXEC);

        setsockopt(far, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        answer_measure_bare("TCP", near, far, count);
    }
    close(listener);
    answer_measure_bare("vcan", answer_open_can("can1"), answer_open_can("can1"), count);
    for (size_t i = 0; i < 2 * ARRAY_COUNT(answer_cases) && !code; i++) {
        const struct answer_case *of = &answer_cases[i / 2];
        const bool vcan = i % 2;
        struct answer_run run = {0};

        if (vcan && can < 0) {
            continue;
        }
        code = answer_start(program, of->rig, vcan, &run, error);
        if (!code && vcan) {
            /* Measure the request on vcan */
            const uint8_t flags = of->request.flags;
            struct canfd_frame request = {.can_id = of->request.id, .len = of->request.len};
            const struct answer_channel channel = {
                answer_open_can("can1"), &request, &of->answer_id,
                flags & FRAME_FD ? CANFD_MTU : CAN_MTU, sizeof of->answer_id};

            request.can_id |= (flags & FRAME_EXTENDED ? CAN_EFF_FLAG : 0) |
                              (flags & FRAME_REMOTE ? CAN_RTR_FLAG : 0);
            memcpy(request.data, of->request.data, sizeof request.data);
            answer_measure(of->name, "vcan", &channel, count);
            close(channel.fd);
        } else if (!code) {
            answer_measure_text(of, &run, count);
        }

        /* End the simulator and remove its files */
        if (run.process > 0) {
            kill(run.process, SIGTERM);
            waitpid(run.process, NULL, 0);
        }
        remove(answer_path(&run, "said"));
        remove(answer_path(&run, "rig.yaml"));
        rmdir(run.folder);
    }
    if (can < 0) {
        printf("not measured: vcan, which this kernel or network does not have as can1\n");
    }
    return code;
}
