/* SPDX-License-Identifier: Apache-2.0 */
/* Reads the command line of coman-hil run. */
#include "app/cli/cli.h"

#include "base/config.h"
#include "base/text.h"
#include "manual/run.h"

#include <arpa/inet.h>
#include <math.h>
#include <sys/stat.h>

enum { KINDS_SIZE = 4096 };

static const struct word transport_words[] = {
    {"auto", TRANSPORT_AUTO}, {"socketcan", TRANSPORT_SOCKETCAN}, {"local", TRANSPORT_LOCAL}, {0}};

/* Values of the options while they are read: the table below points into it. */
static struct run_options read;

static const struct option_spec options[] = {
    {"--task", OPTION_STRING, "NAME", "start this task on the other side of the buses",
     .value = &read.task, .noun = "tasks"},
    {"--duration", OPTION_REAL, "S",
     "end after S seconds of virtual time, more than 0; without it and --ticks when the task does, "
     "else never",
     .value = &read.duration_s, .min = 0.0, .above_min = true, .max = 1e7, .unit = "seconds"},
    {"--clock", OPTION_ENUM, "CLOCK", "real, lockstep or free; the rig's by default",
     .value = &read.clock, .words = loop_clock_words},
    {"--bus", OPTION_LIST, "NAME=INTERFACE",
     "put a bus of the rig on this interface; may be given more than once", .value = &read.bus},
    {"--transport", OPTION_ENUM, "HOW",
     "socketcan, local (inside this process) or auto, the default: socketcan when the kernel has "
     "CAN, else local",
     .value = &read.transport, .words = transport_words},
    {"--gateway", OPTION_STRING, "[HOST:]PORT",
     "let other programs join the buses over TCP, with any socketcand client; HOST is a numeric "
     "address, 127.0.0.1 by default; PORT 0 is any that is free",
     .value = &read.gateway},
    {"--http", OPTION_STRING, "[HOST:]PORT",
     "serve a page that shows and controls the run; HOST is a numeric address, 127.0.0.1 by "
     "default; PORT 0 is any that is free; none: no page, whatever the rig says; see below",
     .value = &read.http},
    {"--fault", OPTION_LIST, "LINE",
     "arm a fault, as 'motor LKneeSag jam 2..2.5'; may be given more than once; see below",
     .value = &read.fault, .noun = "faults"},
    {"--record", OPTION_STRING, "DIR", "record into this directory, new or empty",
     .value = &read.record},
    {"--set", OPTION_LIST, "NAME=VALUE",
     "a setting that the task begins with, as walk.forward_m_s=0.1; \"ctl set\" changes it later; "
     "may be given more than once",
     .value = &read.set, .noun = "settings"},
    {"--ticks", OPTION_INT, "N", "end after N ticks", .value = &read.ticks, .min = 1.0,
     .max = 1e12},
    TASK_OPTION_ROWS(read.input),
    {"--stimulus", OPTION_STRING, "LOG",
     "feed the boards what the controller has sent in this candump log, or recording, at the same "
     "ticks; the run is as long as the log unless --duration or --ticks say otherwise",
     .value = &read.stimulus},
    {"--slcan", OPTION_LIST, "BUS=PATH|tcp:[HOST:]PORT",
     "let programs that know serial adapters (slcan, Lawicel) join a bus: PATH becomes a link to a "
     "pseudo-terminal, tcp: a port; BUS is a name or an interface; may be given more than once",
     .value = &read.slcan},
    {"--control", OPTION_STRING, "PATH",
     "path of the socket for \"coman-hil ctl\"; none: no socket; a default path otherwise, see "
     "below",
     .value = &read.control},
    {"--http-linger", OPTION_REAL, "S",
     "how long the page stays after the run for those who look at it, until they have closed it; "
     "600 by default, 0 under a service manager; see below",
     .value = &read.http_linger_s, .min = 0.0, .max = 86400.0, .unit = "seconds"},
    {"--token-file", OPTION_STRING, "FILE",
     "keep the tokens of the page, and its port, in this file for the next run; none: make them "
     "anew; by default in a file for runs in this directory, see below",
     .value = &read.token_file},
    {"--ready", OPTION_STRING, "FILE",
     "write this file, in one piece, when others can talk to the run, and remove it at the end; it "
     "says where: control socket, gateway, page; see below",
     .value = &read.ready},
    {"--wire", OPTION_ENUM, "MODE",
     "ideal: frames take no time; wire: frames take the time of their bits and of arbitration, on "
     "local buses and at the speed of SocketCAN's; the rig's by default",
     .value = &read.wire, .words = rig_wire_words},
    {"--hold", OPTION_ENUM, "WHEN",
     "links clamped: none, until_enabled (all motors on) or always; the rig's by default",
     .value = &read.hold, .words = rig_hold_words},
    {"--settle", OPTION_FLAG, NULL,
     "start in static equilibrium: springs and contacts carry the weight from the first tick",
     .value = &read.settle},
    {"--energy", OPTION_FLAG, NULL,
     "account for electrical energy, heat and stored energy; the summary says how well the account "
     "balances",
     .value = &read.energy},
    {"--overrun", OPTION_ENUM, "POLICY", "skip, slip or stop; the rig's by default",
     .value = &read.overrun, .words = loop_overrun_words},
    {"--seed", OPTION_INT, "N", "seed of sensor noise and faults; the rig's by default",
     .value = &read.seed, .min = 0.0, .max = 9e15},
    {"--record-format", OPTION_ENUM, "FORMAT",
     "csv: signals.csv and poses.csv; mcap: recording.mcap, for Foxglove, Lichtblick and "
     "PlotJuggler; both; the rig's by default, which is csv",
     .value = &read.record_format, .words = recorder_format_words},
    {"--record-period", OPTION_INT, "MS", "rows of signals every MS ms, 10 by default",
     .value = &read.record_period_ms, .min = 1.0, .max = 60000.0, .unit = "ms"},
    {"--force", OPTION_FLAG, NULL,
     "record into DIR even when it is not empty: replaces the recording in it with its summary",
     .value = &read.force},
    {"--trust", OPTION_FLAG, NULL,
     "let a rig that is not installed record outside this folder and serve its page to other "
     "machines",
     .value = &read.trust},
    {"--quiet", OPTION_FLAG, NULL,
     "print warnings, errors, the addresses that options ask for, and the summary only",
     .value = &read.quiet},
};

bool run_options_read(int argc, char **argv, struct run_options *out, int *status)
{
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name", true, &read.rig, .noun = "rigs"}};
    static char manual[sizeof MANUAL_RUN + KINDS_SIZE];
    static const struct command_spec spec = {
        .name = "run",
        .summary = "Run a rig: robot, boards and buses, in real time, lockstep or free run.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = manual,
    };
    char kinds[KINDS_SIZE];
    size_t used = 0, count = faults_help(0, NULL, 0);
    char line[256];

    /* Write the help on faults: one line per kind */
    kinds[0] = '\0';
    for (size_t i = 0; i < count && used < KINDS_SIZE; i++) {
        faults_help(i, line, sizeof line);
        used += (size_t)snprintf(kinds + used, KINDS_SIZE - used, "  %s\n", line);
    }
    options_insert(manual, sizeof manual, MANUAL_RUN, "@FAULT_KINDS@", kinds);
    read = (struct run_options){.duration_s = INFINITY,
                                .http_linger_s = -1.0,
                                .seed = -1,
                                .clock = -1,
                                .overrun = -1,
                                .hold = -1,
                                .wire = -1,
                                .record_period_ms = 10};
    if (!options_read(&spec, argc, argv, status)) {
        return false;
    }
    *out = read;
    return true;
}

enum error_code run_options_parse_address(const char *option, const char *text, const char *example,
                                          char host[RUN_HOST_SIZE], const char **given,
                                          uint16_t *port, struct error *error)
{
    const char *colon = strrchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    int64_t number;
    struct in6_addr v6;
    struct in_addr v4;

    /* Removes the brackets of an IPv6 address */
    if (length > 2 && text[0] == '[' && text[length - 1] == ']') {
        snprintf(host, RUN_HOST_SIZE, "%.*s", (int)length - 2, text + 1);
    } else {
        snprintf(host, RUN_HOST_SIZE, "%.*s", (int)length, text);
    }
    if (!text_to_int(colon ? colon + 1 : text, 0, UINT16_MAX, &number) ||
        length > RUN_HOST_SIZE - 4 || (colon && length == 0)) {
        return error_set(
            error, ERROR_INPUT,
            "%s: found \"%.100s\", expected PORT or HOST:PORT, as in %s, PORT from 0 to 65535",
            option, text, example);
    }
    /* The only accepted name, because it needs no resolution */
    if (!strcmp(host, "localhost")) {
        snprintf(host, RUN_HOST_SIZE, "127.0.0.1");
    }
    if (colon && inet_pton(AF_INET, host, &v4) != 1 && inet_pton(AF_INET6, host, &v6) != 1) {
        return error_set(error, ERROR_INPUT,
                         "%s: found host \"%.60s\", expected localhost or a numeric address, for "
                         "example 127.0.0.1",
                         option, host);
    }
    *given = colon ? host : NULL;
    *port = (uint16_t)number;
    return ERROR_NONE;
}

/* Reads one --slcan, BUS=PATH or BUS=tcp:[HOST:]PORT, into the next channel. */
static enum error_code run_options_read_channel(const char *text, struct run_slcan *slcan,
                                                struct error *error)
{
    const char *equals = strchr(text, '='), *where = equals ? equals + 1 : "";
    size_t at = slcan->count, length = equals ? (size_t)(equals - text) : 0;
    struct gateway_slcan *channel = &slcan->channel[at];
    enum error_code code = ERROR_NONE;

    if (at == GATEWAY_SLCAN || length == 0 || length >= sizeof slcan->bus[at] || !*where) {
        return error_set(error, ERROR_INPUT,
                         "--slcan: found \"%.100s\", expected BUS=PATH or BUS=tcp:[HOST:]PORT, as "
                         "in can1=/tmp/slcan1, at most %d times",
                         text, GATEWAY_SLCAN);
    }
    snprintf(slcan->bus[at], sizeof slcan->bus[at], "%.*s", (int)length, text);
    *channel = (struct gateway_slcan){.bus = slcan->bus[at]};

    /* A port, or a path that becomes a link to a pseudo-terminal */
    if (strncmp(where, "tcp:", 4) == 0) {
        code = run_options_parse_address("--slcan", where + 4, "tcp:3333", slcan->host[at],
                                         &channel->host, &channel->port, error);
        if (!code && channel->port == 0) {
            code = error_set(error, ERROR_INPUT, "--slcan: found port 0, expected 1 to 65535");
        }
    } else {
        channel->path = where;
    }
    slcan->count += !code;
    return code;
}

enum error_code run_options_read_slcan(const struct run_options *given, struct run_slcan *slcan,
                                       struct error *error)
{
    enum error_code code = ERROR_NONE;

    slcan->count = 0;
    for (size_t i = 0; i < given->slcan.count && !code; i++) {
        code = run_options_read_channel(given->slcan.item[i], slcan, error);
    }
    return code;
}

const char *run_options_http(const struct run_options *given, const struct rig *rig)
{
    const char *text = given->http ? given->http : rig->page.listen;

    return text && strcmp(text, "none") != 0 ? text : NULL;
}

bool run_options_is_loopback(const char *host)
{
    struct in6_addr six;
    struct in_addr four;

    if (inet_pton(AF_INET, host, &four) == 1) {
        return ntohl(four.s_addr) >> 24 == IN_LOOPBACKNET;
    }
    if (inet_pton(AF_INET6, host, &six) != 1) {
        return false;
    }
    return IN6_IS_ADDR_LOOPBACK(&six) ||
           (IN6_IS_ADDR_V4MAPPED(&six) && six.s6_addr[12] == IN_LOOPBACKNET);
}

/* Checks whether a path leads, or may lead through symbolic links, outside the working
 * directory. */
static bool path_leaves_folder(const char *path)
{
    char part[PATH_MAX];
    struct stat there;

    for (const char *at = path; *at;) {
        size_t length = strcspn(at, "/");

        if (length == 0 || (length == 2 && !strncmp(at, "..", 2))) {
            return true;
        }
        snprintf(part, sizeof part, "%.*s", (int)(at - path + (ptrdiff_t)length), path);
        if (!lstat(part, &there) && S_ISLNK(there.st_mode)) {
            return true;
        }
        at += length;
        at += strspn(at, "/");
    }
    return false;
}

/* Checks whether the rig's page listens only on this machine. Returns an error for an invalid
 * address. */
static enum error_code listens_here(const struct rig_page *page, bool *here, struct error *error)
{
    char host[RUN_HOST_SIZE];
    const char *given;
    uint16_t port;

    *here = true;
    if (run_options_parse_address("listen", page->listen, "8080", host, &given, &port, error)) {
        return error_prefix(error, "%s:%d:%d", page->mark.file, page->mark.line, page->mark.column);
    }
    *here = !given || run_options_is_loopback(given);
    return ERROR_NONE;
}

enum error_code run_options_check_trust(const struct run_options *given, const struct rig *rig,
                                        struct error *error)
{
    const struct rig_record *record = &rig->record;
    const struct rig_page *page = &rig->page;
    char host[RUN_HOST_SIZE];
    const char *address;
    uint16_t port;
    bool here = true;

    /* A wrong address on the command line ends the run before it starts */
    if (given->http && run_options_http(given, rig) &&
        run_options_parse_address("--http", given->http, "8080", host, &address, &port, error)) {
        return ERROR_INPUT;
    }

    /* A rig that is not installed may record only below the working directory, and serve its page
     * only on this machine */
    if (!given->record && record->directory && !given->trust &&
        !config_is_installed(record->mark.file) && path_leaves_folder(record->directory)) {
        return yaml_error(error, &record->mark,
                          "found \"%.200s\", expected a directory below the one that coman-hil "
                          "runs in: type --trust to let this rig record there, or --record DIR",
                          record->directory);
    }
    if (!given->http && run_options_http(given, rig) && listens_here(page, &here, error)) {
        return ERROR_INPUT;
    }
    if (!here && !given->trust && !config_is_installed(page->mark.file)) {
        return yaml_error(error, &page->mark,
                          "found \"%.80s\", which other machines can reach, expected an address of "
                          "this one, as 127.0.0.1: type --trust to let this rig listen there, or "
                          "--http [HOST:]PORT",
                          page->listen);
    }
    return ERROR_NONE;
}

enum error_code run_options_configure(const struct run_options *given, const struct rig *rig,
                                      struct simulator_config *config, struct error *error)
{
    *config = (struct simulator_config){
        .rig = rig,
        .clock = given->clock < 0 ? rig->clock : (enum loop_clock)given->clock,
        .hold = given->hold < 0 ? rig->hold : (enum rig_hold)given->hold,
        .settle = given->settle || rig->settle,
        .energy = given->energy,
        .overrun = given->overrun < 0 ? rig->realtime.overrun : (enum loop_overrun)given->overrun,
        .transport = (enum bus_transport)given->transport,
        .interface = given->bus.item,
        .ninterface = given->bus.count,
        .fault = given->fault.item,
        .nfault = given->fault.count,
        .seed_given = given->seed >= 0,
        .seed = (uint64_t)given->seed,
        .ticks = (uint64_t)given->ticks,
        .task = given->task,
        .setting = given->set.item,
        .nsetting = given->set.count,
        .stimulus = given->stimulus,
        .requests = !given->control || strcmp(given->control, "none") != 0,
        .record = given->record ? given->record : rig->record.directory,
        .overwrite = given->force,
        .record_format = given->record_format ? (unsigned)given->record_format : rig->record.format,
        .guests = run_options_http(given, rig) != NULL,
        .row_period_ns = given->record_period_ms * CLOCK_MS,
    };

    if (given->set.count > 0 && !given->task) {
        return error_set(error, ERROR_INPUT, "found --set without --task");
    }

    /* A duration ends at the first tick that reaches it, for any rounding of the quotient */
    if (!isfinite(given->duration_s)) {
        return ERROR_NONE;
    }
    if (given->ticks > 0) {
        return error_set(error, ERROR_INPUT, "found both --duration and --ticks, expected one");
    }
    config->ticks =
        (uint64_t)fmax(1.0, ceil(given->duration_s * 1e9 / (double)rig->tick_ns - 1e-6));
    return ERROR_NONE;
}
