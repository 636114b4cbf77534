/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What somebody who watches a simulator wants to know of a tick: the status, the values of all
 * signals, how each board is, all of the same moment. The loop publishes it once a tick while it is
 * wanted, and never waits for who reads it; unwanted it costs the loop one load. Where it comes to
 * be wanted while no tick runs (a pause, a controller that is silent), that of the last tick
 * follows within a tenth of a second. Arrays are in the order of simulator_signal_names and of the
 * rig's boards. SI units.
 */
#ifndef SIM_VIEW_H
#define SIM_VIEW_H

#include "sim/simulator.h"

struct simulator_view {
    struct simulator_status status;
    const double *signal;
    const struct board_state *board;
    void *memory; /* of the copy */
};

/* Creates room for one copy, from arena; each reader has its own. ERROR_MEMORY. Not RT-safe. */
enum error_code simulator_view_create(const struct simulator *simulator, struct arena *arena,
                                      struct simulator_view *view, struct error *error);

/* Sets whether views are wanted; from the one thread that reads them. RT-safe. */
void simulator_want_views(struct simulator *simulator, bool wanted);

/* Publishes the last tick's view, whether one is wanted or not; when the loop has ended, from the
 * thread that ran it. Not RT-safe: nothing calls it in the loop. */
void simulator_end_views(struct simulator *simulator);

/* Returns the rows of all signals, of each tick (rt/stream.h), for the same reader: what a ring
 * that holds a second at 1 kHz had no room for is counted. NULL when the simulator was created
 * without guests, or with inline ones only. RT-safe. */
struct stream *simulator_view_stream(const struct simulator *simulator);

/* Copies the last view that was published; before the first tick that of the start. Returns how
 * many were published. Not RT-safe. */
uint64_t simulator_view_read(const struct simulator *simulator, struct simulator_view *view);

#endif
