/* SPDX-License-Identifier: Apache-2.0 */
/* Opens and closes the page of a run, and serves it after the run. */
#include "app/cli/cli.h"

#include "sim/summary.h"

#include <inttypes.h>
#include <stdlib.h>

/* Default time for which the page stays after a run, s; maximum number of robot parts listed as
 * not shown. */
#define PAGE_LINGER_S 600.0

enum { LACKS_LISTED = 8 };

/* Prints the page's addresses, and warns if other machines can reach one. Many users can read a
 * journal. So there the address has no token, and the line names the token file. */
static void page_print_addresses(const struct page *page, const char *host, bool secret)
{
    const char *control = viewer_address(page->viewer, true);
    const char *look = viewer_address(page->viewer, false);

    if (secret) {
        fprintf(stderr, "page: %.*s, its tokens: %s\n", (int)strcspn(look, "#"), look,
                page->tokens[0] ? page->tokens : "kept nowhere, give --token-file FILE");
    } else {
        fprintf(stderr, "%s%s%s", control[0] ? "page: " : "", control, control[0] ? "\n" : "");
        fprintf(stderr, "page, to look only: %s\n", look);
    }
    if (host && !run_options_is_loopback(host)) {
        fprintf(
            stderr,
            "%swarning: the page is not encrypted: whoever can listen on the way to %s sees its "
            "token and can then control the robot; 127.0.0.1 and a tunnel keep others out\n",
            journal_prefix(JOURNAL_WARNING), host);
    }
}

void page_print_lacks(const struct robot *robot)
{
    size_t count = 0;
    struct error error;

    for (size_t i = 0; i < robot->nvisual; i++) {
        if (viewer_check_visual(&robot->visual[i], &error) && count++ < LACKS_LISTED) {
            fprintf(stderr, "%snotice: page: %s is not shown as it looks: %s\n",
                    journal_prefix(JOURNAL_NOTICE), robot->visual[i].name, error.text);
        }
    }
    if (count > LACKS_LISTED) {
        fprintf(stderr, "%snotice: page: and %zu others: the page lists them\n",
                journal_prefix(JOURNAL_NOTICE), count - LACKS_LISTED);
    }
}

/* ---- tokens ---- */

/* Handles an error of the token file. A file given by the user must be usable; for the default
 * file, only prints a notice. */
static enum error_code page_judge_token_file(const struct run_options *options,
                                             enum error_code code, const struct error *error)
{
    if (code && !options->token_file && options->quiet) {
        return ERROR_NONE;
    }
    if (code && !options->token_file) {
        fprintf(stderr, "%snotice: %s: this run's page has an address of its own\n",
                journal_prefix(JOURNAL_NOTICE), error->text);
        return ERROR_NONE;
    }
    return code;
}

/* Starts the server with the tokens and the port of the last run in this folder. Uses another port
 * if that port is occupied or the user has given one. Keeps tokens and port for the next run. */
static enum error_code page_start(struct page *page, const struct run_options *options,
                                  bool service, struct viewer_config *config, struct error *error)
{
    const char *runtime = getenv("RUNTIME_DIRECTORY"); /* list of folders, from the manager */
    struct page_tokens tokens = {.port = 0};
    char *path = page->tokens;
    bool any = config->port == 0;
    enum error_code code = ERROR_NONE;

    /* Find the token file; "" = keep no tokens */
    if (options->token_file) {
        snprintf(path, PATH_MAX, "%s",
                 strcmp(options->token_file, "none") == 0 ? "" : options->token_file);
    } else if (service && runtime && *runtime) {
        snprintf(path, PATH_MAX, "%.*s/page", (int)strcspn(runtime, ":"), runtime);
    } else if (!service && !token_file_default(path, PATH_MAX)) {
        path[0] = '\0';
    }
    if (path[0]) {
        code = page_judge_token_file(options, token_file_read(path, &tokens, error), error);
    }
    if (code) {
        return code;
    }

    /* Use the last run's tokens and port; use another port if that one is occupied */
    if (tokens.port > 0) {
        config->token[0] = tokens.token[0];
        config->token[1] = tokens.token[1];
        config->port = any ? tokens.port : config->port;
    }
    code = viewer_start(config, &page->viewer, error);
    if (code == ERROR_SYSTEM && any && config->port > 0) {
        config->port = 0;
        code = viewer_start(config, &page->viewer, error);
    }
    if (code || !path[0]) {
        return code;
    }

    /* Keep the tokens and the port of this run */
    for (int right = 0; right < 2; right++) {
        snprintf(tokens.token[right], VIEWER_TOKEN, "%s", viewer_token(page->viewer, right));
    }
    tokens.port = viewer_port(page->viewer);
    return page_judge_token_file(options, token_file_write(path, &tokens, error), error);
}

/* ---- opening ---- */

enum error_code page_open(struct page *page, const struct run_options *options, bool service,
                          struct simulator *simulator, const char *control, struct error *error)
{
    const char *text = run_options_http(options, simulator_configuration(simulator)->rig);
    struct viewer_config config = {
        .simulator = simulator, .control = control, .ports = &page->ports};
    char host[RUN_HOST_SIZE];
    enum error_code code;

    *page = (struct page){.linger_s = options->http_linger_s >= 0.0 ? options->http_linger_s
                                      : service                     ? 0.0
                                                                    : PAGE_LINGER_S};
    if (!text) {
        return ERROR_NONE;
    }
    code =
        run_options_parse_address("--http", text, "8080", host, &config.host, &config.port, error);

    /* The page has its own ports, and sends frames on the buses beside the host */
    code = code ? code : simulator_join(simulator, &page->ports, error);
    code = code ? code : page_start(page, options, service, &config, error);
    if (code) {
        return code;
    }
    page_print_addresses(page, config.host, service || *journal_prefix(JOURNAL_INFO));
    if (!options->quiet) {
        page_print_lacks(simulator_configuration(simulator)->rig->robot);
    }
    return ERROR_NONE;
}

/* ---- the end of the run ---- */

bool page_stays(const struct page *page, enum loop_end end)
{
    return end != LOOP_END_STOPPED && page->linger_s > 0.0 && viewer_is_watched(page->viewer);
}

void page_tell_end(const struct page *page, const struct simulator *simulator, enum loop_end end,
                   bool stays)
{
    const struct simulator_config *config = simulator_configuration(simulator);
    const struct task_runner *runner = simulator_task_runner(simulator);
    struct task_runner_status task = {.status = TASK_RUNNING, .message = ""};
    struct error error;

    if (!page->viewer) {
        return;
    }
    if (runner) {
        task_runner_read(runner, &task);
    }
    if (viewer_end(page->viewer,
                   &(struct viewer_end){
                       .failed = end == LOOP_END_MODEL || end == LOOP_END_OVERRUNS ||
                                 task.status == TASK_FAILED,
                       .stays = stays,
                       .text = end == LOOP_END_MODEL ? simulator_parts(simulator).failure
                                                     : summary_end_text(end),
                       .time_s = (double)simulator_stats(simulator)->time_ns * 1e-9,
                       .task = config->task,
                       .task_text = task.message[0] ? task.message : NULL,
                       .recording = config->record,
                   },
                   &error)) {
        fprintf(stderr, "%scoman-hil run: %s\n", journal_prefix(JOURNAL_WARNING), error.text);
    }
}

/* Checks whether a signal or the control socket ends the wait. */
static bool page_is_stopped(void *context)
{
    return rig_command_stop_requested() || control_has_stopped(context);
}

void page_linger(const struct page *page, const struct control *control)
{
    fflush(stdout);
    fprintf(stderr, "the page stays until it is closed, %g s at most; Ctrl-C ends it at once\n",
            page->linger_s);
    viewer_linger(page->viewer, page->linger_s, page_is_stopped, (void *)(uintptr_t)control);
}

void page_print(const struct page *page)
{
    struct viewer_counters counters;

    if (!page->viewer) {
        return;
    }
    viewer_counters(page->viewer, &counters);
    if (counters.clients + counters.refused > 0) {
        printf("page: %" PRIu64 " clients, %" PRIu64 " refused, %" PRIu64 " disconnected; %" PRIu64
               " states, %" PRIu64 " skipped; %" PRIu64 " frames to the buses, %" PRIu64
               " rejected by them\n",
               counters.clients, counters.refused,
               counters.cut_junk + counters.cut_slow + counters.cut_silent + counters.cut_idle,
               counters.states, counters.skipped_states, counters.frames_sent,
               counters.frames_untaken);
    }
}

void page_close(struct page *page)
{
    viewer_destroy(page->viewer);
    bus_ports_close(&page->ports);
}
