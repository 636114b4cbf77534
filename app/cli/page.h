/* SPDX-License-Identifier: Apache-2.0 */
/* The page of a run (viewer/viewer.h) as the command line and the rig ask for it. Not RT-safe. */
#ifndef APP_CLI_PAGE_H
#define APP_CLI_PAGE_H

#include "app/cli/run_options.h"
#include "control/control.h"
#include "sim/buses.h"
#include "viewer/viewer.h"

/* The page of one run. */
struct page {
    struct viewer *viewer; /* NULL = none */
    struct bus_ports ports;
    double linger_s; /* longest time that it stays after the run for pages that are open */
};

/* Joins the buses and starts the server, and prints each address on stderr; does nothing when no
 * page is asked for. control: path of the control socket, NULL = there is none; service: under a
 * service manager, where the page neither stays after a run nor keeps its tokens unless the options
 * say so. */
enum error_code page_open(struct page *page, const struct run_options *options, bool service,
                          struct simulator *simulator, const char *control, struct error *error);

/* Prints on stderr which of the robot's visuals a page cannot show, and why. */
void page_print_lacks(const struct robot *robot);

/* Checks whether the page stays after the run: somebody looks at it, and nobody has stopped the
 * run. */
bool page_stays(const struct page *page, enum loop_end end);

/* Tells the pages how the run has ended; stays: page_linger follows, and the recording is
 * complete. */
void page_tell_end(const struct page *page, const struct simulator *simulator, enum loop_end end,
                   bool stays);

/* Serves the open pages until they are closed, the time is up, or somebody stops it by a signal or
 * through control, which may be NULL. */
void page_linger(const struct page *page, const struct control *control);

/* Print a line about the clients after the run, and free what the page holds, before the
 * simulator. */
void page_print(const struct page *page);
void page_close(struct page *page);

#endif
