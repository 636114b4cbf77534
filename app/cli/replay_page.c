/* SPDX-License-Identifier: Apache-2.0 */
/* Shows a recording in the page. */
#include "app/cli/replay_page.h"

#include "app/cli/commands.h"
#include "app/cli/page.h"
#include "app/cli/ready.h"
#include "app/cli/rig_command.h"
#include "app/scenario/scenario.h"
#include "base/input_file.h"
#include "base/journal.h"
#include "rt/recording/recorder.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

/* Posted by the signal that ends the page. */
static sem_t replay_page_end;

static void replay_page_stop(void *unused)
{
    (void)unused;
    sem_post(&replay_page_end);
}

/* Refuses a recording of a newer format, which may hold what this program takes for something
 * else. */
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

/* Loads the rig that a scenario of the summary made, with the parameter values of its case. */
static enum error_code replay_page_load_case(const char *file, const json_t *values,
                                             struct arena *arena, const struct rig **rig,
                                             struct error *error)
{
    struct scenario_value value[SCENARIO_PARAMETERS_MAX];
    struct scenario *cases;
    size_t nvalue = 0, count;
    enum error_code code;

    /* Values in the order of the summary, which is the scenario's */
    for (void *at = json_object_iter((json_t *)(uintptr_t)values);
         at && nvalue < SCENARIO_PARAMETERS_MAX;
         at = json_object_iter_next((json_t *)(uintptr_t)values, at)) {
        const char *text = json_string_value(json_object_iter_value(at));

        value[nvalue++] = (struct scenario_value){json_object_iter_key(at), text ? text : ""};
    }
    code = scenario_read_with(file, value, nvalue, arena, &cases, &count, error);
    return code ? code : scenario_load_rig(&cases[0], arena, rig, error);
}

/* Loads the rig of --rig, or the one that the summary of the recording names: that of its scenario
 * or its file where that is still there, else one of that name. */
static enum error_code replay_page_load_rig(const struct replay_page_options *options,
                                            struct arena *arena, const struct rig **rig,
                                            struct error *error)
{
    char path[PATH_MAX];
    json_t *summary = NULL;
    FILE *in;
    const char *name, *file, *scenario;
    enum error_code code;

    if (access(options->directory, F_OK)) {
        return error_set_file(error, errno, options->directory, "cannot be read");
    }
    /* A summary that is missing leaves the names NULL */
    snprintf(path, sizeof path, "%s/" RECORDER_SUMMARY, options->directory);
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
                         options->directory);
    }
done:
    json_decref(summary);
    return code;
}

/* Serves the recording until the program is told to end. */
static enum error_code replay_page_serve(const struct replay_page_options *options,
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

    /* A signal that does not end the page interrupts the wait */
    while (!code && sem_wait(&replay_page_end) && errno == EINTR) {
    }
    ready_end(options->ready);
    rig_command_ignore_stop();
    viewer_stop(page.viewer);
    page_print(&page);
    viewer_destroy(page.viewer);
    return code;
}

/* Reads the recording, and the one to compare it with, and serves them. */
static enum error_code replay_page_play(const struct replay_page_options *options,
                                        const struct rig *rig, struct arena *arena,
                                        struct error *error)
{
    const struct recording_config config = {
        .directory = options->directory,
        .rig = rig,
        .from_s = options->from_s,
        .to_s = options->to_s,
        .speed = options->speed,
    };
    struct recording *recording = NULL, *with = NULL;
    enum error_code code;

    if (isatty(STDERR_FILENO)) {
        fprintf(stderr, "reading %s\n", options->directory);
    }
    code = recording_open(&config, arena, &recording, error);

    /* All of the second recording, at the times of the first */
    if (!code && options->with) {
        const struct recording_config other = {
            .directory = options->with, .rig = rig, .from_s = -INFINITY, .to_s = INFINITY};

        code = recording_open(&other, arena, &with, error);
    }

    /* Tell what is not shown */
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

int replay_page(const struct replay_page_options *options)
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
