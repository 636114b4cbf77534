/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil replay: sends the frames of a recorded log on live buses at their times, or shows a
 * recording in the page. */
#include "app/cli/cli.h"
#include "app/scenario/scenario.h"
#include "base/input_file.h"
#include "base/text.h"
#include "canbus/candump.h"
#include "manual/replay.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <semaphore.h>
#include <sys/stat.h>
#include <unistd.h>

struct replay_options {
    const char *log;  /* log of frames, or the directory of a recording */
    const char *http; /* "[HOST:]PORT" of the page; NULL = send the frames */
    const char *ready, *rig, *with;
    struct option_list onto, id;
    double from_s, to_s, speed;
};

/* Posted by the signal that ends the page. */
static sem_t replay_page_end;

static void replay_page_stop(void *unused)
{
    (void)unused;
    sem_post(&replay_page_end);
}

/* Refuses a recording of a newer format, which this program could misinterpret. */
static enum error_code replay_page_check_format(const char *path, const json_t *summary,
                                                struct error *error)
{
    const json_t *version = json_object_get(summary, "format_version");

    if (!version || (json_is_integer(version) && json_integer_value(version) >= 1 &&
                     json_integer_value(version) <= RECORDING_FORMAT_VERSION)) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT,
                     "%s: found another format_version, expected 1 to %d: the recording is of a "
                     "newer coman-hil",
                     path, RECORDING_FORMAT_VERSION);
}

/* Loads the rig of a scenario in the summary, with the parameter values of its case. */
static enum error_code replay_page_load_case(const char *file, const json_t *values,
                                             struct arena *arena, const struct rig **rig,
                                             struct error *error)
{
    struct scenario_value value[SCENARIO_PARAMETERS_MAX];
    struct scenario *cases;
    size_t nvalue = 0, count;
    enum error_code code;

    /* Values in the order of the summary, which is the scenario's order */
    for (void *at = json_object_iter((json_t *)(uintptr_t)values);
         at && nvalue < SCENARIO_PARAMETERS_MAX;
         at = json_object_iter_next((json_t *)(uintptr_t)values, at)) {
        const char *text = json_string_value(json_object_iter_value(at));

        value[nvalue++] = (struct scenario_value){json_object_iter_key(at), text ? text : ""};
    }
    code = scenario_read_with(file, value, nvalue, arena, &cases, &count, error);
    return code ? code : scenario_load_rig(&cases[0], arena, rig, error);
}

/* Loads the rig of --rig, or the one in the recording's summary: from its scenario or its file if
 * these still exist, else by its name. */
static enum error_code replay_page_load_rig(const struct replay_options *options,
                                            struct arena *arena, const struct rig **rig,
                                            struct error *error)
{
    char path[PATH_MAX];
    json_t *summary = NULL;
    FILE *in;
    const char *name, *file, *scenario;
    enum error_code code;

    if (access(options->log, F_OK)) {
        return error_set_file(error, errno, options->log, "cannot be read");
    }
    /* Without a summary the names stay NULL */
    snprintf(path, sizeof path, "%s/" RECORDER_SUMMARY, options->log);
    if (!input_file_stream(path, &in, NULL)) {
        summary = json_loadf(in, JSON_REJECT_DUPLICATES, NULL);
        fclose(in);
    }
    name = json_string_value(json_object_get(summary, "rig"));
    file = json_string_value(json_object_get(summary, "rig_file"));
    scenario = json_string_value(json_object_get(summary, "scenario_file"));
    code = replay_page_check_format(path, summary, error);
    if (code) {
        goto done;
    }
    if (options->rig) {
        code = rig_load(options->rig, arena, rig, error);
    } else if (scenario && access(scenario, R_OK) == 0) {
        code =
            replay_page_load_case(scenario, json_object_get(summary, "values"), arena, rig, error);
    } else if (name) {
        code = rig_load(file && access(file, R_OK) == 0 ? file : name, arena, rig, error);
    } else {
        code = error_set(error, ERROR_INPUT,
                         "%s: found no summary that names the rig, as of a run that was killed, "
                         "expected --rig RIG",
                         options->log);
    }
done:
    json_decref(summary);
    return code;
}

/* Serves the recording until the program is stopped. */
static enum error_code replay_page_serve(const struct replay_options *options,
                                         const struct rig *rig, const struct recording *recording,
                                         const struct recording *with, struct error *error)
{
    struct viewer_config config = {.recording = recording, .rig = rig, .with = with};
    struct page page = {.viewer = NULL};
    char host[RUN_HOST_SIZE];
    enum error_code code = run_options_parse_address("--http", options->http, "8080", host,
                                                     &config.host, &config.port, error);

    code = code ? code : viewer_start(&config, &page.viewer, error);
    if (code) {
        return code;
    }
    sem_init(&replay_page_end, 0, 0);
    rig_command_on_stop(replay_page_stop, NULL);
    page_print_lacks(rig->robot);
    fprintf(stderr, "page: %s\n", viewer_address(page.viewer, false));
    if (config.host && !run_options_is_loopback(config.host)) {
        fprintf(stderr,
                "%swarning: the page is not encrypted: whoever can listen on the way to %s sees "
                "its token and can then see the recording\n",
                journal_prefix(JOURNAL_WARNING), config.host);
    }
    viewer_serve(page.viewer);
    code = ready_write(options->ready,
                       &(struct ready){.page_view = viewer_address(page.viewer, false)}, error);

    /* Signals that do not end the page interrupt the wait */
    while (!code && sem_wait(&replay_page_end) && errno == EINTR) {
    }
    ready_end(options->ready);
    rig_command_ignore_stop();
    viewer_stop(page.viewer);
    page_print(&page);
    viewer_destroy(page.viewer);
    return code;
}

/* Reads the recording, and the second one for comparison, and serves them. */
static enum error_code replay_page_play(const struct replay_options *options, const struct rig *rig,
                                        struct arena *arena, struct error *error)
{
    const struct recording_config config = {
        .directory = options->log,
        .rig = rig,
        .from_s = options->from_s,
        .to_s = options->to_s,
        .speed = options->speed,
    };
    struct recording *recording = NULL, *with = NULL;
    enum error_code code;

    if (isatty(STDERR_FILENO)) {
        fprintf(stderr, "reading %s\n", options->log);
    }
    code = recording_open(&config, arena, &recording, error);

    /* The whole second recording, with the times of the first */
    if (!code && options->with) {
        const struct recording_config other = {
            .directory = options->with, .rig = rig, .from_s = -INFINITY, .to_s = INFINITY};

        code = recording_open(&other, arena, &with, error);
    }

    /* Reports frames that are not shown */
    if (!code && recording_strange_frames(recording) > 0) {
        fprintf(stderr,
                "%snotice: %" PRIu64 " frames are of interfaces that the rig does not have, and "
                "are not shown\n",
                journal_prefix(JOURNAL_NOTICE), recording_strange_frames(recording));
    }
    if (!code) {
        fprintf(stderr, "recording: %.3f s of the rig %s\n", recording_duration_s(recording),
                rig->name);
        code = replay_page_serve(options, rig, recording, with, error);
    }
    recording_close(with);
    recording_close(recording);
    return code;
}

static int replay_page(const struct replay_options *options)
{
    const struct rig *rig;
    struct arena arena;
    struct error error;
    enum error_code code = ready_begin(options->ready, &error);

    code = code ? code : arena_init(&arena, RIG_COMMAND_ARENA, &error);
    if (code) {
        return command_fail("replay", &error);
    }
    code = replay_page_load_rig(options, &arena, &rig, &error);
    code = code ? code : replay_page_play(options, rig, &arena, &error);
    arena_fini(&arena);
    return code ? command_fail("replay", &error) : STATUS_OK;
}

enum { NAME_SIZE = 16, BUSES_MAX = OPTION_LIST_MAX };

#define REPLAY_ARENA ((size_t)64 << 20)

/* Frames of different buses may lie a tick apart. A larger step back means that the log's clock was
 * set back */
#define REPLAY_STEP_NS INT64_C(200000000)
/* Highest 29-bit identifier. */
#define EXTENDED_MAX 0x1fffffff

/* An interface, and the name of its bus in the log. */
struct replay_bus {
    char name[NAME_SIZE], interface[NAME_SIZE];
    struct can_port *port;
    uint64_t sent, refused;    /* numbers of frames */
    struct histogram lateness; /* delay between due time and sending, ns */
};

/* Range of identifiers to send. */
struct replay_range {
    int64_t first, last;
};

struct replay {
    struct replay_options options;
    char path[PATH_MAX];
    struct replay_bus *bus;
    size_t nbus;
    struct replay_range range[OPTION_LIST_MAX];
    int64_t first_ns;  /* log time of the first frame sent */
    int64_t last_ns;   /* log time of the last frame sent */
    int64_t origin_ns; /* clock time at which the first frame was sent; INT64_MIN = none yet */
};

static atomic_bool replay_stopped;

static void replay_stop(void *unused)
{
    (void)unused;
    atomic_store(&replay_stopped, true);
}

/* ---- options ---- */

/* Parses ID or ID..LAST. */
static enum error_code replay_parse_range(const char *text, struct replay_range *range,
                                          struct error *error)
{
    const char *dots = strstr(text, "..");
    char first[32];

    snprintf(first, sizeof first, "%.*s", dots ? (int)(dots - text) : (int)strlen(text), text);
    if (!text_to_int(first, 0, EXTENDED_MAX, &range->first) ||
        !text_to_int(dots ? dots + 2 : first, range->first, EXTENDED_MAX, &range->last)) {
        return error_set(error, ERROR_INPUT,
                         "--id: found \"%.60s\", expected an identifier or a range of them, as in "
                         "0x481 or 0x100..0x17f",
                         text);
    }
    return ERROR_NONE;
}

/* Parses INTERFACE or NAME=INTERFACE; the default name is the interface's. */
static enum error_code replay_parse_bus(const char *text, struct replay_bus *bus,
                                        struct error *error)
{
    const char *equals = strchr(text, '=');
    size_t length = equals ? (size_t)(equals - text) : strlen(text);
    const char *interface = equals ? equals + 1 : text;

    if (length == 0 || length >= NAME_SIZE || !*interface || strlen(interface) >= NAME_SIZE) {
        return error_set(error, ERROR_INPUT,
                         "--onto: found \"%.60s\", expected INTERFACE or NAME=INTERFACE with names "
                         "of at most %d characters",
                         text, NAME_SIZE - 1);
    }
    memcpy(bus->name, text, length);
    strcpy(bus->interface, interface);
    return ERROR_NONE;
}

/* Opens the interface of one --onto; refuses a repeated name. */
static enum error_code replay_open_bus(struct replay *replay, const char *text, struct arena *arena,
                                       struct error *error)
{
    struct replay_bus *bus = &replay->bus[replay->nbus];
    struct socketcan_config config = {.interface = bus->interface, .fd = true};
    /* A filter that no frame passes, because nothing is received */
    const struct frame_filter none = {.id = 0, .mask = UINT32_MAX, .extended = true};
    struct error classic;
    enum error_code code = replay_parse_bus(text, bus, error);

    if (code) {
        return code;
    }
    for (size_t b = 0; b < replay->nbus; b++) {
        if (!strcmp(replay->bus[b].name, bus->name)) {
            return error_set(error, ERROR_INPUT, "--onto: found %s again, expected it once",
                             bus->name);
        }
    }

    /* Opens it for CAN FD, or else for classic CAN */
    config.filter = &none;
    config.nfilter = 1;
    if (socketcan_open(&config, arena, &bus->port, &classic)) {
        config.fd = false;
        code = socketcan_open(&config, arena, &bus->port, error);
    }
    replay->nbus += !code;
    return code;
}

/* ---- sending ---- */

/* Checks whether an identifier is to be sent; without --id all are sent. */
static bool replay_has_id(const struct replay *replay, uint32_t id)
{
    for (size_t i = 0; i < replay->options.id.count; i++) {
        if (id >= replay->range[i].first && id <= replay->range[i].last) {
            return true;
        }
    }
    return replay->options.id.count == 0;
}

/* Returns the bus for a frame. Returns NULL if it is not to be sent: an error frame, a frame
 * outside the times or identifiers, or a frame of an unknown bus. */
static struct replay_bus *replay_find_bus(const struct replay *replay, const char *name,
                                          const struct bus_frame *frame)
{
    double seconds = (double)frame->time_ns * 1e-9;

    if (frame->flags & FRAME_ERROR || seconds < replay->options.from_s ||
        seconds > replay->options.to_s || !replay_has_id(replay, frame->id)) {
        return NULL;
    }
    for (size_t b = 0; b < replay->nbus; b++) {
        if (!strcmp(replay->bus[b].name, name)) {
            return &replay->bus[b];
        }
    }
    return NULL;
}

/* Waits for a frame's time, scaled by the speed, and sends it; the first frame sets the origin of
 * time. */
static void replay_send_frame(struct replay *replay, struct replay_bus *bus, int line,
                              const struct bus_frame *frame)
{
    const int64_t step_ns = frame->time_ns - replay->last_ns;
    struct clock *clock = clock_monotonic();
    int64_t due, now = clock_now(clock);

    /* The first frame is sent immediately; all others keep their time difference to it */
    if (replay->origin_ns == INT64_MIN) {
        replay->origin_ns = now;
        replay->first_ns = frame->time_ns;
    } else if (step_ns < -REPLAY_STEP_NS) {
        replay->first_ns += step_ns;
        fprintf(stderr,
                "replay: %s:%d: the clock of the log stepped back by %.3f s; the frames from "
                "this line on follow at once\n",
                replay->path, line, (double)-step_ns * 1e-9);
    } else if (step_ns > LOG_GAP_NS) {
        fprintf(stderr, "replay: %s:%d: no frame for %.3f s before this line\n", replay->path, line,
                (double)step_ns * 1e-9);
    }
    replay->last_ns = frame->time_ns;
    due = replay->origin_ns +
          (int64_t)((double)(frame->time_ns - replay->first_ns) / replay->options.speed);

    /* A stop request ends the sleep early */
    while (now < due && !atomic_load(&replay_stopped)) {
        clock_sleep_until(clock, due);
        now = clock_now(clock);
    }
    if (atomic_load(&replay_stopped)) {
        return;
    }
    if (can_send(bus->port, frame, 1) == 1) {
        bus->sent++;
        histogram_add(&bus->lateness, now - due);
    } else {
        bus->refused++;
    }
}

/* Plays the log to its end, or until a stop is requested. */
static enum error_code replay_play(struct replay *replay, struct error *error)
{
    struct candump_reader log;
    enum error_code code = candump_open(&log, replay->path, error);
    char skipped[160];
    bool end = false;

    if (code) {
        return code;
    }
    while (!code && !end && !atomic_load(&replay_stopped)) {
        struct replay_bus *bus = NULL;
        struct bus_frame frame;
        char name[16];

        code = candump_next(&log, &frame, name, &end, error);
        if (!code && !end && (bus = replay_find_bus(replay, name, &frame))) {
            replay_send_frame(replay, bus, log.line, &frame);
        }
    }
    if (candump_skipped(&log, skipped, sizeof skipped)) {
        fprintf(stderr, "replay: %s\n", skipped);
    }
    candump_close(&log);
    return code;
}

/* ---- the command ---- */

/* Prints the number of frames that each interface accepted; returns STATUS_FAILED if one has lost
 * frames. */
static int replay_print(const struct replay *replay)
{
    uint64_t lost = 0;

    for (size_t b = 0; b < replay->nbus; b++) {
        const struct replay_bus *bus = &replay->bus[b];
        uint64_t dropped = bus->port->counters.tx_dropped;

        dropped = dropped > bus->refused ? dropped : bus->refused;
        lost += dropped;
        printf("%s: %" PRIu64 " frames sent, %" PRIu64
               " lost; late by p50 %.3f ms, p99 %.3f ms, max %.3f ms\n",
               bus->interface, bus->sent, dropped,
               (double)histogram_percentile(&bus->lateness, 0.5) * 1e-6,
               (double)histogram_percentile(&bus->lateness, 0.99) * 1e-6,
               (double)bus->lateness.max * 1e-6);
    }
    return lost ? STATUS_FAILED : STATUS_OK;
}

/* Finds the log and opens the interfaces; refuses to run without an interface. */
static enum error_code replay_prepare(struct replay *replay, struct arena *arena,
                                      struct error *error)
{
    const struct replay_options *o = &replay->options;
    struct stat info;
    enum error_code code = ERROR_NONE;

    replay->origin_ns = INT64_MIN;
    replay->bus = arena_alloc(arena, BUSES_MAX, sizeof *replay->bus);
    if (!replay->bus) {
        return error_set(error, ERROR_MEMORY, "no memory");
    }
    if (snprintf(replay->path, sizeof replay->path, "%s%s", o->log,
                 stat(o->log, &info) == 0 && S_ISDIR(info.st_mode) ? "/candump.log" : "") >=
        (int)sizeof replay->path) {
        return error_set(error, ERROR_INPUT, "the name of the log is too long");
    }
    if (o->onto.count == 0) {
        return error_set(error, ERROR_INPUT,
                         "found neither --http nor --onto, expected where to play it");
    }
    for (size_t i = 0; !code && i < o->id.count; i++) {
        code = replay_parse_range(o->id.item[i], &replay->range[i], error);
    }
    for (size_t i = 0; !code && i < o->onto.count; i++) {
        code = replay_open_bus(replay, o->onto.item[i], arena, error);
    }
    return code;
}

/* Sends a recording on buses, or shows it with --http; returns the exit status. */
static int replay_run(const struct replay_options *options)
{
    static struct replay replay;
    struct arena arena;
    struct error error;
    int status = STATUS_OK;

    if (options->http && (options->onto.count > 0 || options->id.count > 0)) {
        error_set(&error, ERROR_INPUT,
                  "found --http beside --onto or --id, expected one: a page shows the recording, "
                  "and sends nothing");
        return command_fail("replay", &error);
    }
    if (options->http) {
        return replay_page(options);
    }

    /* Options that only apply to the page */
    if (options->ready || options->with) {
        error_set(&error, ERROR_INPUT, "found %s without --http, expected both",
                  options->ready ? "--ready" : "--with");
        return command_fail("replay", &error);
    }
    replay.options = *options;
    if (arena_init(&arena, REPLAY_ARENA, &error)) {
        return command_fail("replay", &error);
    }

    /* Sends the frames; a stop ends it early, and the counts are printed anyway */
    if (replay_prepare(&replay, &arena, &error)) {
        status = command_fail("replay", &error);
    } else {
        rig_command_on_stop(replay_stop, NULL);
        status = replay_play(&replay, &error) ? command_fail("replay", &error) : STATUS_OK;
        rig_command_ignore_stop();
        status = status ? status : replay_print(&replay);
    }
    for (size_t b = 0; b < replay.nbus; b++) {
        replay.bus[b].port->ops->close(replay.bus[b].port);
    }
    arena_fini(&arena);
    return status;
}

int cmd_replay(int argc, char **argv)
{
    /* Default: the whole log at its own speed */
    static struct replay_options o = {.from_s = -1e9, .to_s = 1e12, .speed = 1.0};
    static const struct option_spec options[] = {
        {"--http", OPTION_STRING, "[HOST:]PORT",
         "serve a page that plays the recording; HOST is a numeric address, 127.0.0.1 by default; "
         "PORT 0 is any that is free",
         .value = &o.http},
        {"--ready", OPTION_STRING, "FILE",
         "with --http: write this file, in one piece, when the page is served, and remove it at "
         "the end; its line page_view='ADDRESS' says where",
         .value = &o.ready},
        {"--rig", OPTION_STRING, "RIG",
         "the rig that was recorded, for --http; that of the recording's summary by default",
         .value = &o.rig, .noun = "rigs"},
        {"--with", OPTION_STRING, "DIR",
         "with --http: show this recording of the same rig too, its signals in the same plots and "
         "its robot as a ghost",
         .value = &o.with},
        {"--onto", OPTION_LIST, "[NAME=]INTERFACE",
         "send what the log has of NAME, or of INTERFACE, onto this interface; may be given more "
         "than once",
         .value = &o.onto},
        {"--id", OPTION_LIST, "ID[..LAST]",
         "send frames with these identifiers only; may be given more than once", .value = &o.id},
        {"--from", OPTION_REAL, "S", "first second to send, or show", .value = &o.from_s,
         .min = -1e9, .max = 1e12, .unit = "seconds"},
        {"--to", OPTION_REAL, "S", "last second to send, or show", .value = &o.to_s, .min = -1e9,
         .max = 1e12, .unit = "seconds"},
        {"--speed", OPTION_REAL, "X", "so many times as fast, 1 by default", .value = &o.speed,
         .min = 1e-3, .max = 1e3},
    };
    static const struct operand_spec operands[] = {
        {"LOG", "a candump log, or the directory of a recording", true, .value = &o.log}};
    static const struct command_spec spec = {
        .name = "replay",
        .summary = "Play a recording in a page, or its frames onto live buses.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_REPLAY,
    };
    int status;

    return options_read(&spec, argc, argv, &status) ? replay_run(&o) : status;
}
