/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a controller and external boards have sent in a recorded run, to be received again at the
 * same ticks: the frames of a candump log (rt/recording/recorder.h) that none of the simulator's
 * own boards sends, by the tables of the boards. Of the lockstep protocol STEP frames are played
 * when the clock is lockstep, DONE never. Bus errors are not played. A log whose first time is of
 * the wall clock (100,000,000 s and more) begins with the run. Times in ns. Not RT-safe.
 */
#ifndef SIM_STIMULUS_H
#define SIM_STIMULUS_H

#include "canbus/frame.h"
#include "rig/rig.h"

struct stimulus {
    struct bus_frame *frame[RIG_BUSES_MAX]; /* of each bus, in the order of the log */
    size_t count[RIG_BUSES_MAX];
    int64_t start_ns; /* time in the log at which the run starts: 0, or of its first frame */
    int64_t end_ns;   /* virtual time of the last frame of the log, whoever sent it */
};

/* Reads a log, or candump.log in a directory. interface: the name of each bus in the log; its
 * name in the rig counts too. Memory from arena. ERROR_INPUT with file:line for a bus that the
 * rig does not have, for times that run backwards, or when there is nothing to play. */
enum error_code stimulus_load(const char *path, const struct rig *rig, const char *const *interface,
                              bool lockstep, struct arena *arena, struct stimulus *stimulus,
                              struct error *error);

#endif
