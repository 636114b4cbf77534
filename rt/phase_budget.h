/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What each phase of a tick does and may cost: COMAN's squat on its five buses in wire mode, in
 * instructions of an x86-64 processor as callgrind counts them, the mean of a tick. At one
 * instruction in a nanosecond, which every lab PC exceeds, 10,000 are one per cent of the tick of 1
 * ms. tests/rt/phase_instructions.sh holds the loop to it. A constant table: RT-safe.
 */
#ifndef RT_PHASE_BUDGET_H
#define RT_PHASE_BUDGET_H

#include "rt/loop.h"

#include <stdint.h>

struct phase_budget {
    const char *does;
    uint32_t instructions;       /* 0 = none: the wait */
    double typical_us, worst_us; /* in real time on a virtual machine of two cores: median, 99 % */
};

/* The budget of each phase, by enum loop_phase. */
extern const struct phase_budget phase_budgets[PHASE_COUNT];

#endif
