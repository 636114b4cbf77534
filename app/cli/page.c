/* SPDX-License-Identifier: Apache-2.0 */
/* The page of a run. */
#include "app/cli/page.h"

#include <inttypes.h>
#include <stdio.h>

static void page_print_addresses(const struct page *page, const char *host)
{
    const char *control = viewer_address(page->viewer, true);

    if (control[0]) {
        fprintf(stderr, "page: %s\n", control);
    }
    fprintf(stderr, "page, to look only: %s\n", viewer_address(page->viewer, false));
    if (host && !run_options_is_loopback(host)) {
        fprintf(
            stderr,
            "%swarning: the page is not encrypted: whoever can listen on the way to %s sees its "
            "token and can then control the robot; 127.0.0.1 and a tunnel keep others out\n",
            journal_prefix(JOURNAL_WARNING), host);
    }
}

enum error_code page_open(struct page *page, const struct run_options *options,
                          struct simulator *simulator, const char *control, struct error *error)
{
    const char *text = run_options_http(options, simulator_configuration(simulator)->rig);
    struct viewer_config config = {
        .simulator = simulator, .control = control, .ports = &page->ports};
    char host[RUN_HOST_SIZE];
    enum error_code code;

    *page = (struct page){.viewer = NULL};
    if (!text) {
        return ERROR_NONE;
    }
    code =
        run_options_parse_address("--http", text, "8080", host, &config.host, &config.port, error);
    code = code ? code : simulator_join(simulator, &page->ports, error);
    code = code ? code : viewer_start(&config, &page->viewer, error);
    if (code) {
        return code;
    }
    page_print_addresses(page, config.host);
    return ERROR_NONE;
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
               counters.cut_junk + counters.cut_slow + counters.cut_silent, counters.states,
               counters.skipped_states, counters.frames_sent, counters.frames_untaken);
    }
}

void page_close(struct page *page)
{
    viewer_destroy(page->viewer);
    bus_ports_close(&page->ports);
}
