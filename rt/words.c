/* SPDX-License-Identifier: Apache-2.0 */
/* The words by which a configuration names clocks, overrun policies and formats of recordings. */
#include "rt/recording/recorder.h"
#include "rt/timing.h"

const struct word loop_clock_words[] = {{"real", LOOP_CLOCK_REAL},
                                        {"lockstep", LOOP_CLOCK_LOCKSTEP},
                                        {"free", LOOP_CLOCK_FREE},
                                        {NULL, 0}};
const struct word loop_overrun_words[] = {{"skip", LOOP_OVERRUN_SKIP},
                                          {"slip", LOOP_OVERRUN_SLIP},
                                          {"stop", LOOP_OVERRUN_STOP},
                                          {NULL, 0}};

const struct word recorder_format_words[] = {{"csv", RECORDER_CSV},
                                             {"mcap", RECORDER_MCAP},
                                             {"both", RECORDER_CSV | RECORDER_MCAP},
                                             {NULL, 0}};
