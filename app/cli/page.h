/* SPDX-License-Identifier: Apache-2.0 */
/* The page of a run (viewer/viewer.h) as the command line and the rig ask for it. Not RT-safe. */
#ifndef APP_CLI_PAGE_H
#define APP_CLI_PAGE_H

#include "app/cli/run_options.h"
#include "sim/buses.h"
#include "viewer/viewer.h"

struct page {
    struct viewer *viewer; /* NULL = none */
    struct bus_ports ports;
};

/* Joins the buses and starts the server, with a line on stderr about each address; nothing when
 * nobody has asked for it. control: path of the control socket, NULL = there is none. */
enum error_code page_open(struct page *page, const struct run_options *options,
                          struct simulator *simulator, const char *control, struct error *error);

/* After the run: a line about the clients; then what it held, before the simulator goes. */
void page_print(const struct page *page);
void page_close(struct page *page);

#endif
