/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Replays frames of a controller and of external boards from a recorded run, in the same ticks. The
 * frames come from a candump log (rt/recording/recorder.h). Frames that the simulator's own boards
 * send, according to their message tables, are left out. Boards send no remote frames, so every
 * remote frame comes from a controller. Frames of the lockstep protocol: STEP is played if the
 * clock is lockstep, DONE never. Bus errors are not played. A log that begins with wall-clock time
 * (100,000,000 s or more) is shifted to the start of the run. Times in ns. Not RT-safe.
 */
#ifndef SIM_STIMULUS_H
#define SIM_STIMULUS_H

#include "canbus/frame.h"
#include "rig/rig.h"

struct stimulus {
    struct bus_frame *frame[RIG_BUSES_MAX]; /* frames of each bus, in log order */
    size_t count[RIG_BUSES_MAX];
    /* time in the log at which the run starts: 0, or the time of its first frame */
    int64_t start_ns;
    int64_t end_ns;    /* virtual time of the last frame of the log, from any sender */
    int64_t last_ns;   /* virtual time of the last frame to play */
    int64_t gap_ns;    /* longest time without a frame */
    int gap_line;      /* line of the log where that time ends */
    char skipped[160]; /* sentence about lines without a frame; "" = none */
};

/* Reads a log, or candump.log in a directory. interface: name of each bus in the log; its name in
 * the rig is accepted too. Memory from arena. Returns ERROR_INPUT with file:line for an unknown
 * bus or decreasing times, or if there is nothing to play. */
enum error_code stimulus_load(const char *path, const struct rig *rig, const char *const *interface,
                              bool lockstep, struct arena *arena, struct stimulus *stimulus,
                              struct error *error);

#endif
