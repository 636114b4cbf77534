/* SPDX-License-Identifier: Apache-2.0 */
/* The page of a run (viewer/viewer.h), as requested by the command line and the rig. Not
 * RT-safe. */
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
    double linger_s; /* longest time for which it serves open pages after the run */
};

/* Joins the buses, starts the server, and prints each address on stderr; does nothing if no page
 * is requested. control: path of the control socket, NULL = none. service: the run is under a
 * service manager. Then the page neither stays after a run nor keeps its tokens, unless the
 * options say so. */
enum error_code page_open(struct page *page, const struct run_options *options, bool service,
                          struct simulator *simulator, const char *control, struct error *error);

/* Prints on stderr the visuals that a page cannot show, with reasons. */
void page_print_lacks(const struct robot *robot);

/* Checks whether the page stays after the run: a client watches it, and the user has not stopped
 * the run. */
bool page_stays(const struct page *page, enum loop_end end);

/* Sends the pages the end of the run. stays: page_linger follows, and the recording is
 * complete. */
void page_tell_end(const struct page *page, const struct simulator *simulator, enum loop_end end,
                   bool stays);

/* Serves the open pages until they are closed, the time has passed, or the user stops it by a
 * signal or through control (may be NULL). */
void page_linger(const struct page *page, const struct control *control);

/* Print a line about the clients after the run, and free the page's resources; call them before
 * the simulator is destroyed. */
void page_print(const struct page *page);
void page_close(struct page *page);

#endif
