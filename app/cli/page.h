/* SPDX-License-Identifier: Apache-2.0 */
/* The page of a run (viewer/viewer.h) as the command line and the rig ask for it. Not RT-safe. */
#ifndef APP_CLI_PAGE_H
#define APP_CLI_PAGE_H

#include "app/cli/run_options.h"
#include "app/control/control.h"
#include "sim/buses.h"
#include "viewer/viewer.h"

struct page {
    struct viewer *viewer; /* NULL = none */
    struct bus_ports ports;
    double linger_s; /* how long it stays at most for pages that are open at the end of the run */
};

/* Joins the buses and starts the server, with a line on stderr about each address; nothing when
 * nobody has asked for it. control: path of the control socket, NULL = there is none; service:
 * under a service manager, where the page neither stays after a run nor keeps its tokens unless the
 * options say so. */
enum error_code page_open(struct page *page, const struct run_options *options, bool service,
                          struct simulator *simulator, const char *control, struct error *error);

/* Says on stderr which of the robot's looks a page cannot show, and why. */
void page_print_lacks(const struct robot *robot);

/* Whether the page stays: somebody looks at a run that nobody has stopped. */
bool page_stays(const struct page *page, enum loop_end end);

/* Tells the pages how the run has ended; stays: page_linger follows, and what is recorded is
 * complete. */
void page_tell_end(const struct page *page, const struct simulator *simulator, enum loop_end end,
                   bool stays);

/* Serves the pages that are open until they are closed, time is up, or somebody stops it by a
 * signal or by control, which may be NULL. */
void page_linger(const struct page *page, const struct control *control);

/* After the run: a line about the clients; then what it held, before the simulator goes. */
void page_print(const struct page *page);
void page_close(struct page *page);

#endif
