/* SPDX-License-Identifier: Apache-2.0 */
/* What each phase of a tick does and may cost (see the header). */
#include "rt/phase_budget.h"

const struct phase_budget phase_budgets[PHASE_COUNT] = {
    [PHASE_WAIT] = {"sleeps until the deadline (real), until a STEP comes (lockstep) or not at all "
                    "(free); before that, faults that are due begin and end and requests of "
                    "another thread are carried out; an inline task takes its step",
                    0, 0.0, 0.0},
    [PHASE_RECEIVE] = {"takes all frames from all buses and hands each to its board", 7700, 2.2,
                       10.1},
    [PHASE_BOARDS] = {"state machines, time-outs and control loops of the boards: the voltage of "
                      "each motor",
                      7900, 1.7, 4.9},
    [PHASE_PLANT] = {"moves the robot on by a tick: actuators, dynamics, contact", 92000, 19.0,
                     42.0},
    [PHASE_SENSORS] = {"samples, delays, quantizes and disturbs what the boards measure", 20000,
                       2.7, 5.6},
    [PHASE_TRANSMIT] = {"wires in virtual time move on; boards send what is due", 41000, 13.8,
                        34.8},
    [PHASE_PUBLISH] = {"hands state and counters to other threads, a row to the recorder", 1550,
                       0.8, 3.0},
};
