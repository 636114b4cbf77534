/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The channels and messages that the recorder writes into an MCAP file (docs/recording.md). One
 * thread; not RT-safe.
 *
 *   /signals      coman_hil.Signals          one number per signal, by its title; null = not finite
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

/* Creates the channels of a recording; put and context as in struct mcap_config. Memory from arena.
 * ERROR_MEMORY. */
enum error_code recorder_mcap_create(const struct recorder_config *config,
                                     void (*put)(void *context, const void *bytes, size_t size),
                                     void *context, struct arena *arena,
                                     struct recorder_mcap **mcap, struct error *error);

/* Returns the size of the longest piece of the file in bytes. */
size_t recorder_mcap_longest(const struct recorder_mcap *mcap);

/* Writes the head of the file and the first message of each channel. */
void recorder_mcap_start(struct recorder_mcap *mcap);

void recorder_mcap_frame(struct recorder_mcap *mcap, const struct frame_item *item);
void recorder_mcap_row(struct recorder_mcap *mcap, const double *row);
void recorder_mcap_event(struct recorder_mcap *mcap, const struct event_item *item);

/* Ends the present chunk if it is older than a second. */
void recorder_mcap_tend(struct recorder_mcap *mcap, int64_t now_ns);

/* recorder_mcap_finish ends the file. recorder_mcap_destroy frees all memory outside the arena;
 * NULL is allowed. */
void recorder_mcap_finish(struct recorder_mcap *mcap);
void recorder_mcap_destroy(struct recorder_mcap *mcap);

#endif
