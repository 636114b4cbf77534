/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the recorder writes into an MCAP file: the channels and their messages (docs/recording.md).
 * One thread; not RT-safe.
 *
 *   /signals      coman_hil.Signals          a number a signal, by its title; null = not finite
 *   /can/NAME     coman_hil.Frame            every frame of the bus
 *   /events       foxglove.Log
 *   /transforms   foxglove.FrameTransforms   every body in the frame "world"
 *
 * and the channels of the configuration.
 */
#ifndef RT_RECORDING_RECORDER_MCAP_H
#define RT_RECORDING_RECORDER_MCAP_H

#include "rt/recording/mcap.h"
#include "rt/recording/recorder_private.h"

struct recorder_mcap;

/* Creates the channels of a recording; put and context are those of struct mcap_config. Memory
 * from arena; ERROR_MEMORY. */
enum error_code recorder_mcap_create(const struct recorder_config *config,
                                     void (*put)(void *context, const void *bytes, size_t size),
                                     void *context, struct arena *arena,
                                     struct recorder_mcap **mcap, struct error *error);

/* Returns the greatest size of a piece of the file in bytes. */
size_t recorder_mcap_longest(const struct recorder_mcap *mcap);

/* Begins the file, with the first messages of its channels. */
void recorder_mcap_start(struct recorder_mcap *mcap);

void recorder_mcap_frame(struct recorder_mcap *mcap, const struct frame_item *item);
void recorder_mcap_row(struct recorder_mcap *mcap, const double *row);
void recorder_mcap_event(struct recorder_mcap *mcap, const struct event_item *item);

/* Ends the chunk when it is a second old. */
void recorder_mcap_tend(struct recorder_mcap *mcap, int64_t now_ns);

/* Ends the file and frees what is not the arena's; after an ended file it only frees. */
void recorder_mcap_finish(struct recorder_mcap *mcap);
void recorder_mcap_destroy(struct recorder_mcap *mcap);

#endif
